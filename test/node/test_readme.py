"""README.md says what the code does."""

import re
import runpy

import pytest

from tp_sim.harness import ClosedLoop


@pytest.fixture(scope='module')
def readme(repository):
    return (repository / 'README.md').read_text(encoding='utf-8')


def blocks(readme, language):
    return re.findall(rf'```{language}\n(.*?)```', readme, flags=re.DOTALL)


def test_the_table_of_parameters_is_the_one_of_the_schemas(repository, readme):
    tool = runpy.run_path(str(repository / 'tools' / 'parameter_table.py'))
    assert '\n'.join(tool['table']()) in readme


def test_the_example_of_an_own_robot_runs_and_reaches_its_targets(readme, tmp_path):
    (example,) = blocks(readme, 'yaml')
    path = tmp_path / 'example.yaml'
    path.write_text(example)
    with ClosedLoop(path) as loop:
        loop.run(10.0)
        record = loop.record
    assert record.error_norm['ee_position'][-1] < 1e-3
    assert record.error_norm['link2_angle'][-1] < 1e-3


def test_the_example_of_the_harness_runs(repository, readme, monkeypatch):
    (example,) = [text for text in blocks(readme, 'python') if 'tp_sim' in text]
    monkeypatch.chdir(repository)
    exec(compile(example, 'README.md', 'exec'), {})


def test_every_file_and_folder_that_it_names_exists(repository, readme):
    names = re.findall(r'\]\(([\w./]+)\)', readme)
    names += [f'config/{name}' for name in re.findall(r'`(\w+\.yaml)`', readme)]
    assert len(names) > 5
    for name in names:
        assert (repository / name).exists(), name


def test_every_task_type_and_experiment_is_in_its_tables(repository, readme):
    from tp_controller.tasks import TASK_TYPES

    for name in TASK_TYPES:
        assert f'| `{name}` |' in readme
    for path in (repository / 'config').glob('*.yaml'):
        assert f'`{path.name}`' in readme
