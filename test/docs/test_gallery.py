"""The gallery has a picture of every experiment, and the command that makes it."""

import sys

import numpy as np
import pytest


@pytest.fixture(scope='module')
def gallery(repository):
    sys.path.insert(0, str(repository / 'examples' / 'gallery'))
    try:
        import gallery as page
        import loop
        import pictures

        yield page, loop, pictures
    finally:
        sys.path.pop(0)
        for name in ('gallery', 'loop', 'pictures'):
            sys.modules.pop(name, None)


def test_the_page_is_what_its_command_writes_with_small_pictures(repository, gallery):
    page, _, pictures = gallery
    assert (repository / 'docs' / 'gallery.md').read_text(encoding='utf-8') == page.page()
    wanted = {'a1', 'a2', 'a3', 'a4', 'a5', 'b1', 'b2', 'c1', 'c2', 'c3', 'd', 'schemes', 'limits'}
    assert set(pictures.PICTURES) == wanted
    for name in wanted:
        path = repository / 'docs' / 'images' / f'gallery_{name}.png'
        assert 10_000 < path.stat().st_size < 150_000


def test_its_runs_are_those_of_the_experiments(gallery):
    _, loop, _ = gallery
    made = loop.simulate('a5_link_orientation', 5.0, tasks__ee_position__gain=[3.0])
    error = made.error('ee_position')
    assert made.run.time[np.flatnonzero(error >= 0.01)[-1] + 1] == pytest.approx(1.92, abs=0.01)
    assert made.run.command.shape == (301, 3)
    np.testing.assert_allclose(
        np.diff(made.run.q, axis=0), made.run.command[:-1] / 60.0, atol=1e-15
    )


def test_a_picture_shows_the_times_of_the_table(gallery):
    _, _, pictures = gallery
    figure = pictures.draw('a5')
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels == [
        'gain 1: below 0.01 m from 4.27 s',
        'gain 3: below 0.01 m from 1.92 s',
        'gain 6: below 0.01 m from 1.42 s',
    ]
