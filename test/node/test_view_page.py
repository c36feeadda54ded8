"""The page in the browser, driven by a real mouse in a headless Chromium."""

import contextlib
import io
import math
import os
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from made_recording import make_recording
from PIL import Image

from tp_controller import Robot
from tp_controller.recording import Recording, run_of
from tp_controller.view.site import SCRIPT
from tp_sim.harness import ClosedLoop, NodeProcess
from tp_sim.harness.browser import NAMES, Browser, Place, chromium, text_element

HEIGHT = 4.0
MIDDLE = 1.3
"""The arm is in the left half of the page, beside the panel."""
WIDTH, TALL = 820, 480
"""Small: pictures are made without a graphics card."""
FIELD = math.radians(50.0)
CAMERA = f'/?initialCameraPosition={MIDDLE},-0.001,{HEIGHT}&initialCameraLookAt={MIDDLE},0,0'
SCALE = TALL / 2 / math.tan(FIELD / 2) / HEIGHT
"""Pixels per metre in the plane of the arm."""
ROUGH = "document.querySelector('canvas[data-engine]').getContext('webgl2').getContextAttributes()"
STEEL, BLUE, BALL = (210, 214, 222), (45, 130, 190), (245, 175, 85)
THUMB = "document.querySelector('[role=slider]')"


def pixel(x, y):
    """Where a point of the arm's plane is on the page."""
    return Place(WIDTH / 2 + SCALE * (x - MIDDLE), TALL / 2 - SCALE * y)


def near(picture, place, color, reach=6):
    """Whether a picture has a color, roughly, around a place."""
    x, y = round(place.x), round(place.y)
    part = picture[y - reach : y + reach + 1, x - reach : x + reach + 1]
    return bool((np.abs(part - np.array(color)).max(axis=2) < 50).any())


pytestmark = [
    pytest.mark.timeout(600),
    pytest.mark.skipif(
        chromium() is None,
        reason=f'no Chromium (none of {", ".join(NAMES)}): the page in the browser is not tried '
        'out by a mouse; apt-get install chromium',
    ),
]


@pytest.fixture(scope='module')
def browser():
    with contextlib.closing(Browser(WIDTH, TALL)) as browser:
        yield browser


@contextlib.contextmanager
def shown(browser, environment, *arguments):
    """The page in the browser; at the end it has complained about nothing."""
    page = NodeProcess(
        'tp_controller', 'view', None, environment, arguments=[*arguments, '--port', '0']
    )
    try:
        page.wait_for_output('view: http', timeout=60.0)
        browser.open(page.output.split('view: ')[1].split()[0] + CAMERA)
        yield
        assert browser.errors() == []
    finally:
        # What the page says about a server that has gone is no error of it.
        browser.open('about:blank')
        assert page.stop() == 0
    assert 'Traceback' not in page.output


def seen(browser):
    """The page as an array."""
    return np.asarray(Image.open(io.BytesIO(browser.screenshot())).convert('RGB')).astype(int)


def test_the_mouse_drags_a_target_changes_the_hierarchy_and_records(config, browser, tmp_path):
    with (
        ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop,
        shown(browser, loop.environment, '--folder', str(tmp_path)),
    ):
        drive(browser, loop)
        record(browser, loop, tmp_path / 'run.mcap')


def record(browser, loop, path):
    browser.click(text_element('Record'))
    browser.click(text_element('Start recording'))
    browser.find(text_element('Stop recording'))
    loop.client.wait_for(path.exists, 'the file')
    loop.client.send_goal('ee_position', [1.0, 0.4])
    written = path.stat().st_size
    loop.client.wait_for(lambda: path.stat().st_size > written + 100_000, 'what comes then')
    browser.click(text_element('Stop recording'))
    browser.find(text_element('Start recording'))
    run = run_of(Recording(path).states())
    assert run.time[-1] > 0.2
    assert run.task('ee_position').desired[-1] == pytest.approx([1.0, 0.4])


def drive(browser, loop):
    client = loop.client

    def arm_is_drawn():
        # The first link lies along x; the ball of the target is at the end.
        found = seen(browser)
        return near(found, pixel(0.4, 0.0), STEEL) and near(found, pixel(1.0, 0.5), BALL, 12)

    client.wait_for(lambda: client.task('ee_position').error_norm < 5e-3, 'the first target')
    browser.wait_for(arm_is_drawn, 'the arm')

    assert not browser.evaluate(ROUGH)['antialias'], 'smooth edges take a graphics card'

    # The square between two arrows moves the target in their plane.
    extent = 0.2 * 1.25 * SCALE
    start = pixel(1.0, 0.5)
    start = Place(start.x + 0.25 * extent, start.y - 0.25 * extent)
    end = Place(start.x - 0.4 * SCALE, start.y - 0.3 * SCALE)
    accepted = client.task('ee_position').accepted_goals
    browser.drag(start, end)
    client.wait_for(
        lambda: np.allclose(client.task('ee_position').desired, [0.6, 0.8], atol=0.03),
        'the goal where the mouse left it',
    )
    assert client.task('ee_position').accepted_goals > accepted
    client.wait_for(lambda: client.task('ee_position').error_norm < 5e-3, 'the arm at the goal')

    browser.click(text_element('0 · ee_position…'))
    browser.click(text_element('down'))
    client.wait_for(lambda: client.task('ee_position').level == 1, 'the task one level lower')
    assert client.task('joint_1_position').level == 0
    # The folder takes its new place on the page first.
    browser.find(text_element('1 · ee_position…'))
    browser.click(text_element('on'))
    client.wait_for(lambda: not client.task('ee_position').enabled, 'the task off')
    browser.find(text_element('1 · ee_position · off'))
    browser.click(text_element('Hold'))
    client.wait_for(lambda: loop.state.held, 'the hold')
    browser.click(text_element('Resume'))
    client.wait_for(lambda: not loop.state.held, 'the end of the hold')


def test_a_slider_scrubs_through_a_recording(tmp_path, browser):
    goals = [(1.0, 'ee_position', [0.3, 1.2])]
    path = make_recording(tmp_path / 'run.mcap', 'a4_position_joint', 8.0, goals)
    run = run_of(Recording(path).states())
    robot = Robot.from_dh([0.75, 0.5, 0.5])

    def arm_is_where_it_was(time):
        """Whether the ball at its second elbow is there."""
        robot.update(run.q[int(np.searchsorted(run.time, time, 'right')) - 1])
        x, y, _ = robot.frame('link_2').position
        return near(seen(browser), pixel(x, y), BLUE)

    with shown(browser, dict(os.environ), str(path)):
        browser.wait_for(lambda: arm_is_where_it_was(0.0), 'the arm at the beginning')
        thumb = browser.find(THUMB)
        track = browser.evaluate(f'{THUMB}.parentElement.getBoundingClientRect().width')
        for share in (0.25, 0.6, 1.1):
            browser.drag(browser.find(THUMB), Place(thumb.x + share * track, thumb.y))
            time = browser.evaluate(f"Number({THUMB}.getAttribute('aria-valuenow'))")
            assert time == pytest.approx(min(share, 1.0) * run.time[-1], abs=0.3)
            browser.wait_for(lambda time=time: arm_is_where_it_was(time), f'the arm at {time} s')
        browser.find("document.querySelector('.uplot .u-over')")
        browser.click(text_element('Play'))
        # From the end it begins anew.
        browser.find(text_element('Pause'))


@pytest.mark.parametrize(
    ('address', 'width', 'told'),
    [
        ('', 2 * WIDTH, '?fixedDpr=0.50'),
        (
            '?initialCameraPosition=1,2,3',
            2 * WIDTH,
            '?initialCameraPosition=1%2C2%2C3&fixedDpr=0.50',
        ),
        ('?fixedDpr=2', 2 * WIDTH, '?fixedDpr=2'),
        ('?smooth', 2 * WIDTH, '?smooth'),
        ('', WIDTH, ''),
    ],
)
def test_larger_windows_have_larger_pixels_without_a_graphics_card(
    browser, tmp_path, address, width, told
):
    (tmp_path / 'index.html').write_text(f'<html><head>{SCRIPT}</head></html>')
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    with ThreadingHTTPServer(('127.0.0.1', 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        size = {'width': width, 'height': width * TALL // WIDTH}
        browser.call(
            'Emulation.setDeviceMetricsOverride', **size, deviceScaleFactor=1, mobile=False
        )
        try:
            browser.open(f'http://127.0.0.1:{server.server_port}/{address}')
            there = (
                f"location.port === '{server.server_port}' && document.readyState === 'complete'"
            )
            browser.wait_for(lambda: browser.evaluate(there), 'the page')
            assert browser.evaluate('location.search') == told
        finally:
            browser.call('Emulation.clearDeviceMetricsOverride')
            browser.open('about:blank')
            server.shutdown()
