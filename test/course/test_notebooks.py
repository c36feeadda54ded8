"""The notebooks of the course run with and without the library, and are kept in order."""

import importlib.util
import json
import os
import re
import subprocess
import sys

import pytest

from run import cells, solutions

NOTEBOOKS = (
    '1_kinematics',
    '2_redundancy',
    '3_two_priorities',
    '4_more_levels',
    '5_inequalities',
    '6_limits',
)
FIGURES = {'1': 24, '2': 13, '3': 27, '4': 6, '5': 5, '6': 5}
"""How many figures each notebook compares at least."""
RIDDLES = ('one-sided', 'guard', 'the last word', 'comes in handy', 'needless to say', 'obviously')
LONGEST = 32
"""Words of a sentence."""


@pytest.fixture(params=NOTEBOOKS)
def notebook(request, repository):
    return repository / 'course' / f'{request.param}.ipynb'


def test_there_are_exactly_these_notebooks(repository):
    assert sorted(path.stem for path in (repository / 'course').glob('*.ipynb')) == list(NOTEBOOKS)


@pytest.mark.parametrize('options', [[], ['--without-library']], ids=['library', 'plain numpy'])
def test_figures_are_the_expected_ones_and_checks_tell_right_from_empty(repository, options):
    # The first notebook has no stack: without the library it is the same.
    names = NOTEBOOKS[1:] if options else NOTEBOOKS
    paths = [str(repository / 'course' / f'{name}.ipynb') for name in names]
    # A process of its own: it decides which modules are there.
    done = subprocess.run(
        [sys.executable, str(repository / 'course' / 'run.py'), '--output', *options, *paths],
        env={**os.environ, 'MPLBACKEND': 'agg'},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = re.findall(r'^(\d)_\w+\.ipynb: (\d+) figures, (\d+) exercises', done.stdout, re.M)
    assert [number for number, _, _ in found] == [name[0] for name in names]
    for number, figures, exercises in found:
        assert int(figures) >= FIGURES[number]
        assert 3 <= int(exercises) <= 5
    missing = 'The library tp_controller is missing'
    assert done.stdout.count(missing) == (len(names) if options else 0)


def test_a_notebook_has_the_form_that_jupyter_expects_and_no_outputs(notebook):
    text = notebook.read_text(encoding='utf-8')
    content = json.loads(text)
    assert (content['nbformat'], content['nbformat_minor']) == (4, 5)
    assert set(content['metadata']) == {'kernelspec', 'language_info'}
    names = [cell['id'] for cell in content['cells']]
    assert len(set(names)) == len(names)
    for cell in content['cells']:
        keys = {'cell_type', 'id', 'metadata', 'source'}
        if cell['cell_type'] == 'code':
            keys |= {'execution_count', 'outputs'}
            assert cell['outputs'] == []
            assert cell['execution_count'] is None
        assert set(cell) == keys
        assert set(cell['metadata']) <= {'tags', 'exercise'}
        assert ''.join(cell['source']).strip()
    # As `python course/run.py --clear` writes it.
    assert text == json.dumps(content, indent=1, ensure_ascii=False) + '\n'
    if importlib.util.find_spec('nbformat') is not None:  # installed by `make course`
        import nbformat

        nbformat.validate(nbformat.reads(text, as_version=4))


def test_cells_are_in_order_and_every_exercise_has_a_text_a_check_and_a_solution(notebook):
    number = notebook.stem[0]
    found = cells(notebook)
    assert found[0].text.startswith(f'# {number} ')
    assert found[1].kind == 'code'
    assert 'import lab' in found[1].text
    text = '\n'.join(cell.text for cell in found if cell.kind == 'markdown')
    sections = re.findall(rf'^## {number}\.(\d) ', text, re.M)
    assert sections == [str(i + 1) for i in range(len(sections))]
    exercises = [(i, cell) for i, cell in enumerate(found) if cell.exercise]
    expected = [f'{number}.{i + 1}' for i in range(len(exercises))]
    assert [cell.exercise for _, cell in exercises] == expected
    assert re.findall(r'\*\*Exercise (\d\.\d)\.\*\*', text) == expected
    assert list(solutions(notebook))[1:] == expected
    for i, cell in exercises:
        assert f'**Exercise {cell.exercise}.**' in found[i - 1].text
        (name,) = re.findall(r'^check\.(\w+)\(\1\)$', found[i + 1].text, re.M)
        assert re.search(rf'^(def {name}\(|{name} = )', cell.text, re.M)


def test_every_link_and_source_is_there(notebook):
    found = [cell.text for cell in cells(notebook) if cell.kind == 'markdown']
    assert '## Sources' in found[-1]
    links = re.findall(r'\]\(([^)]+)\)', '\n'.join(found))
    for link in links:
        assert (notebook.parent / link).exists(), link
    later = NOTEBOOKS[NOTEBOOKS.index(notebook.stem) + 1 :]
    assert links == [f'{name}.ipynb' for name in later[:1]]


def test_the_language_is_plain(notebook):
    for cell in cells(notebook):
        if cell.kind != 'markdown':
            continue
        for riddle in RIDDLES:
            assert riddle not in cell.text.lower()
        prose = cell.text.partition('## Sources')[0]
        prose = re.sub(r'\$\$.*?\$\$', '.', prose, flags=re.S)
        prose = re.sub(r'\$[^$]+\$|`[^`]+`', 'x', prose)
        for sentence in re.split(r'[.:?!](?:\s|$)|\n\n|\n[-|\d#]', prose):
            assert len(sentence.split()) <= LONGEST, ' '.join(sentence.split())
