"""The parameter file of README.md starts nodes; test/docs runs what else the pages show."""

import re

import pytest

from tp_sim.harness import ClosedLoop


@pytest.fixture(scope='module')
def readme(repository):
    return (repository / 'README.md').read_text(encoding='utf-8')


def blocks(readme, language):
    return re.findall(rf'```{language}\n(.*?)```', readme, flags=re.DOTALL)


def test_the_example_of_an_own_robot_runs_and_reaches_its_targets(readme, tmp_path):
    (example,) = blocks(readme, 'yaml')
    path = tmp_path / 'example.yaml'
    path.write_text(example)
    with ClosedLoop(path) as loop:
        loop.run(10.0)
        record = loop.record
    assert record.error_norm['ee_position'][-1] < 1e-3
    assert record.error_norm['link2_angle'][-1] < 1e-3
