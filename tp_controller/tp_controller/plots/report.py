"""All pictures of a run into a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.plots import curves, planar, spatial
from tp_controller.plots.moments import Scene
from tp_controller.plots.style import FORMATS, save
from tp_controller.recording import Recording, Run, run_of
from tp_controller.stack import Stack


def figures(run: Run, stack: Stack) -> dict[str, Figure]:
    """Pictures of a run by their names; those that have nothing to show are left out.

    Parameters
    ----------
    run
        The run.
    stack
        The stack that it was made with: limits, obstacles, and what the arm looks like.
    """
    made: dict[str, Callable[[], Figure | None]] = {
        'errors': lambda: curves.errors(run, stack.robot),
        'joints': lambda: curves.joints(run, stack.robot),
        'distances': lambda: curves.distances(run, stack.robot),
        'levels': lambda: curves.levels(run),
        'timing': lambda: curves.timing(run),
        'arm': lambda: arm(run, stack),
    }
    found = {name: make() for name, make in made.items()}
    return {name: figure for name, figure in found.items() if figure is not None}


def arm(run: Run, stack: Stack) -> Figure:
    """Draw the arm: a planar one as a filmstrip, any other in three dimensions."""
    scene = Scene(run, stack)
    return planar.filmstrip(scene) if scene.planar else spatial.pictures(scene)


def draw_plots(recording: Recording, folder: Path, file_format: str = 'png') -> list[Path]:
    """Draw all pictures of a recording into a folder.

    Parameters
    ----------
    recording
        The recording.
    folder
        Where they are written; made if it is not there.
    file_format
        One of `FORMATS`.

    Returns
    -------
    list
        What was written.

    Raises
    ------
    InvalidValue
        If there is no cycle in the recording, or no such format.
    """
    if file_format not in FORMATS:
        raise InvalidValue('format', shown(file_format), f'one of {listed(FORMATS)}')
    run, stack = run_and_stack(recording)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in figures(run, stack).items():
        path = folder / f'{name}.{file_format}'
        save(figure, path)
        written.append(path)
    return written


def run_and_stack(recording: Recording) -> tuple[Run, Stack]:
    """What a recording has to draw.

    Raises
    ------
    InvalidValue
        If there is no cycle in it, or its robot cannot be built.
    """
    stack = recording.stack()
    try:
        return run_of(recording.states()), stack
    except ValueError:
        raise InvalidValue(str(recording.path), 'no cycle', 'a recording with one') from None
