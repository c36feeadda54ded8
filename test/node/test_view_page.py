"""The page in the browser, driven by a real mouse in a headless Chromium."""

import io
import math

import numpy as np
import pytest
from PIL import Image

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
STEEL, BALL = (210, 214, 222), (245, 175, 85)


def pixel(x, y):
    """Where a point of the arm's plane is on the page."""
    return Place(WIDTH / 2 + SCALE * (x - MIDDLE), TALL / 2 - SCALE * y)


def near(picture, place, color, reach=6):
    """Whether a picture has a color, roughly, around a place."""
    x, y = round(place.x), round(place.y)
    part = picture[y - reach : y + reach + 1, x - reach : x + reach + 1]
    return bool((np.abs(part - np.array(color)).max(axis=2) < 50).any())


@pytest.mark.timeout(600)
@pytest.mark.skipif(
    chromium() is None,
    reason=f'no Chromium (none of {", ".join(NAMES)}): the page in the browser is not tried out',
)
def test_a_target_is_dragged_and_the_hierarchy_changed_with_the_mouse(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop:
        page = NodeProcess(
            'tp_controller', 'view', None, loop.environment, arguments=['--port', '0']
        )
        browser = Browser(WIDTH, TALL)
        try:
            page.wait_for_output('view: http', timeout=60.0)
            address = page.output.split('view: ')[1].split()[0]
            browser.open(address + CAMERA)
            drive(browser, loop)
            assert browser.errors() == []
        finally:
            browser.close()
            assert page.stop() == 0
    assert 'Traceback' not in page.output


def drive(browser, loop):
    client = loop.client

    def picture():
        return np.asarray(Image.open(io.BytesIO(browser.screenshot())).convert('RGB')).astype(int)

    def arm_is_drawn():
        # The first link lies along x; the ball of the target is at the end.
        found = picture()
        return near(found, pixel(0.4, 0.0), STEEL) and near(found, pixel(1.0, 0.5), BALL, 12)

    client.wait_for(lambda: client.task('ee_position').error_norm < 5e-3, 'the first target')
    browser.wait_for(arm_is_drawn, 'the arm')

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
