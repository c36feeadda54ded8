"""README.md and the pages of docs say what the code does, and their links lead somewhere."""

import ast
import re
import runpy

import numpy as np
import pytest
import yaml

from tp_controller.checks import NOTE, check_settings, read
from tp_controller.config import build_settings, read_parameter_file, robot_source
from tp_controller.robot import read_description
from tp_controller.tasks import TASK_TYPES

PANDA = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'


@pytest.fixture(scope='module')
def pages(repository):
    """Texts of README.md, CONTRIBUTING.md and all pages by their paths."""
    paths = [repository / 'README.md', repository / 'CONTRIBUTING.md']
    paths += sorted((repository / 'docs').glob('*.md'))
    assert len(paths) > 25
    return {path: path.read_text(encoding='utf-8') for path in paths}


@pytest.fixture(scope='module')
def page(repository):
    return lambda name: (repository / 'docs' / name).read_text(encoding='utf-8')


def test_the_readme_is_short_and_names_the_site(repository):
    readme = (repository / 'README.md').read_text(encoding='utf-8')
    assert len(readme.splitlines()) <= 150
    assert 'make docs' in readme


def test_the_readme_links_every_page(repository):
    readme = (repository / 'README.md').read_text(encoding='utf-8')
    for path in (repository / 'docs').glob('*.md'):
        assert f'(docs/{path.name})' in readme or f'(docs/{path.name}#' in readme, path.name


def test_every_link_leads_somewhere(repository, pages):
    for path, text in pages.items():
        for name, anchor in re.findall(r'\]\(([\w./]*)(#[\w-]+)?\)', text):
            target = path.parent / name if name else path
            assert target.exists(), f'{path.name}: {name}'
            if anchor:
                found = anchors(target.read_text(encoding='utf-8'))
                assert anchor in found, f'{path.name}: {name}{anchor}'
        for name in re.findall(r'`(\w+\.yaml)`', text):
            known = (repository / 'config' / name).exists()
            assert known or name in ('controllers.yaml', 'parameters.yaml'), f'{path.name}: {name}'


def anchors(text):
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r'^#+ (.*)$', text, flags=re.MULTILINE)
    return {'#' + re.sub(r'[^\w\- ]', '', line.lower()).replace(' ', '-') for line in headings}


@pytest.mark.parametrize(
    ('tool', 'name'), [('parameter_table', 'parameters.md'), ('topic_table', 'interface.md')]
)
def test_a_table_is_the_one_that_its_tool_prints(repository, page, tool, name):
    table = runpy.run_path(str(repository / 'tools' / f'{tool}.py'))['table']
    assert '\n'.join(table()) in page(name)


def test_every_topic_and_service_of_the_nodes_is_in_the_table(repository, page):
    places = [*repository.glob('tp_controller/tp_controller/ros/*.py')]
    places.append(repository / 'tp_sim' / 'tp_sim' / 'simulator.py')
    found = set()
    for path in places:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.update(re.findall(r'^~/(\w+)$', node.value))
    assert len(found) > 10
    for name in found:
        assert f'~/{name}`' in page('interface.md') or f'tp_sim/{name}`' in page('interface.md')


def test_every_task_type_and_experiment_is_in_its_table(repository, page):
    for name in TASK_TYPES:
        assert f'| `{name}` |' in page('tasks.md')
    for path in (repository / 'config').glob('*.yaml'):
        assert f'`{path.name}`' in page('experiments.md')


def test_every_parameter_file_in_a_page_can_be_used(pages, tmp_path):
    found = 0
    for page, text in pages.items():
        for block in re.findall(r'```yaml\n(.*?)```', text, flags=re.DOTALL):
            assert yaml.safe_load(block), page.name
            if not re.search(r'^ +hierarchy:', block, flags=re.MULTILINE):
                continue
            found += 1
            path = tmp_path / 'file.yaml'
            path.write_text(block)
            values = read_parameter_file(path, 'tp_controller')
            description = None if robot_source(values) else read_description(PANDA)
            reading = read(values, description)
            assert not reading.errors, page.name
    assert found >= 3


def test_the_stack_of_its_page_has_no_warning_and_gets_there(page, tmp_path):
    (block,) = re.findall(r'```yaml\n(.*?)```', page('own_stack.md'), flags=re.DOTALL)
    path = tmp_path / 'my_stack.yaml'
    path.write_text(block)
    settings = build_settings(read_parameter_file(path, 'tp_controller'))
    q = np.array(read_parameter_file(path, 'tp_sim')['initial_positions'])
    assert all(one.severity == NOTE for one in check_settings(settings, q))
    stack = settings.stack
    hand = stack.tasks['hand_position']
    hand.target = [0.5, 0.2, 0.4]
    for _ in range(1200):
        q = q + stack.step(q).command / 200.0
    assert np.abs(hand.error).max() < 1e-3
    assert np.abs(stack.tasks['tool_down'].error).max() < 1e-2
    assert stack.tasks['table'].distances().min() > 0.0
