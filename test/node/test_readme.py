"""README.md and the pages of docs say what the code does."""

import re
import runpy

import pytest

from tp_sim.harness import ClosedLoop


@pytest.fixture(scope='module')
def readme(repository):
    return (repository / 'README.md').read_text(encoding='utf-8')


@pytest.fixture(scope='module')
def page(repository):
    return lambda name: (repository / 'docs' / name).read_text(encoding='utf-8')


def blocks(readme, language):
    return re.findall(rf'```{language}\n(.*?)```', readme, flags=re.DOTALL)


def test_the_table_of_parameters_is_the_one_of_the_schemas(repository, page):
    tool = runpy.run_path(str(repository / 'tools' / 'parameter_table.py'))
    assert '\n'.join(tool['table']()) in page('parameters.md')


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


def test_every_link_leads_somewhere(repository, readme):
    pages = [repository / 'README.md', *(repository / 'docs').glob('*.md')]
    assert len(pages) > 15
    for page in pages:
        text = page.read_text(encoding='utf-8')
        for name, anchor in re.findall(r'\]\(([\w./]*)(#[\w-]+)?\)', text):
            target = page.parent / name if name else page
            assert target.exists(), f'{page.name}: {name}'
            if anchor:
                assert anchor in anchors(target.read_text(encoding='utf-8')), (
                    f'{page}: {name}{anchor}'
                )
        for name in re.findall(r'`(\w+\.yaml)`', text):
            known = (repository / 'config' / name).exists()
            assert known or name in ('controllers.yaml', 'parameters.yaml'), f'{page.name}: {name}'


def anchors(text):
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r'^#+ (.*)$', text, flags=re.MULTILINE)
    return {'#' + re.sub(r'[^\w\- ]', '', line.lower()).replace(' ', '-') for line in headings}


def test_every_task_type_and_experiment_is_in_its_table(repository, page):
    from tp_controller.tasks import TASK_TYPES

    for name in TASK_TYPES:
        assert f'| `{name}` |' in page('tasks.md')
    for path in (repository / 'config').glob('*.yaml'):
        assert f'`{path.name}`' in page('experiments.md')


def test_the_readme_is_short_and_leads_to_every_page(repository, readme):
    assert len(readme.splitlines()) <= 150
    for path in (repository / 'docs').glob('*.md'):
        assert f'(docs/{path.name})' in readme, path.name
