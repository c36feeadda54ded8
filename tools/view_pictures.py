"""Make the pictures of the page in the browser for docs/view.md.

Call it in an environment of setup.bash, with a Chromium on the machine::

    python tools/view_pictures.py [FOLDER]

Simulator, controller and page are the real ones.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tp_sim.harness import ClosedLoop, NodeProcess
from tp_sim.harness.browser import Browser, text_element

ROOT = Path(__file__).resolve().parents[1]
SIZE = 1280, 900
ADDRESS = '/?smooth&fixedDpr=1'
"""Behind the page's: with smooth edges and all pixels, as with a graphics card."""
OPEN = "document.querySelector('canvas[data-engine]')?.style.opacity === '1'"
NOTE = "document.querySelectorAll('.mantine-Notification-root').forEach(e => e.remove())"


class Picture(NamedTuple):
    """What is shown."""

    name: str
    config: str
    goals: tuple[tuple[str, tuple[float, ...]], ...]
    """Sent one after the other; the picture is taken on the way to the last."""
    left: float
    """Error [m] of the last one's task when it is taken."""
    clicks: tuple[str, ...]
    """Texts that are clicked before."""


PICTURES = (
    Picture(
        'view_planar.png',
        'b1_obstacles',
        (('ee_position', (-0.9, 0.9)), ('ee_position', (1.0, 0.7))),
        0.3,
        ('3 · ee_position…',),
    ),
    Picture(
        'view_panda.png',
        'panda_table',
        (('hand_position', (0.2, -0.6, 0.4)), ('hand_position', (0.45, 0.25, 0.12))),
        0.15,
        ('3 · hand_position…', 'Show', 'distances'),
    ),
)


def main() -> int:
    """Make all pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'docs' / 'images'
    for picture in PICTURES:
        take(picture, folder)
        print(folder / picture.name)
    return 0


def take(picture: Picture, folder: Path) -> None:
    """Make one picture."""
    with ClosedLoop(ROOT / 'config' / f'{picture.config}.yaml', lockstep=False) as loop:
        page = NodeProcess(
            'tp_controller', 'view', None, loop.environment, arguments=['--port', '0']
        )
        browser = Browser(*SIZE)
        try:
            page.wait_for_output('view: http', timeout=60.0)
            browser.open(page.output.split('view: ')[1].split()[0] + ADDRESS)
            browser.wait_for(lambda: browser.evaluate(OPEN), 'the scene')
            for text in picture.clicks:
                browser.click(text_element(text))
            browser.evaluate(NOTE)
            for number, (name, values) in enumerate(picture.goals, start=1):
                loop.send_goal(name, values)
                last = number == len(picture.goals)
                loop.client.wait_for(near(loop, name, picture.left if last else 0.1), 'the arm')
            browser.frames(1)
            browser.screenshot(folder / picture.name)
        finally:
            browser.close()
            page.stop()


def near(loop: ClosedLoop, name: str, error: float) -> Callable[[], bool]:
    """Whether the task is this near to its goal."""
    return lambda: loop.client.task(name).error_norm < error


if __name__ == '__main__':
    sys.exit(main())
