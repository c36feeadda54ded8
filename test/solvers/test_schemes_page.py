"""docs/schemes.md names everything that there is, and only that."""

import re

import pytest

from tp_controller.objectives import OBJECTIVE_TYPES
from tp_controller.solvers import INVERSES, SOLVER_TYPES


@pytest.fixture(scope='module')
def page(repository):
    return (repository / 'docs' / 'schemes.md').read_text(encoding='utf-8')


def test_every_scheme_has_a_section(page):
    assert set(re.findall(r'^### `(\w+)`', page, flags=re.MULTILINE)) == set(SOLVER_TYPES)


@pytest.mark.parametrize('names', [INVERSES, OBJECTIVE_TYPES], ids=['inverses', 'objectives'])
def test_every_inverse_and_objective_has_a_row(page, names):
    for name in names:
        assert f'| `{name}` | $' in page


def test_both_comparisons_have_a_row_for_every_scheme(page):
    for config in ('c1_algorithmic_singularity', 'c3_repeatability'):
        _, rest = page.split(f'--config config/{config}.yaml')
        table = rest.split('```')[2]
        for name in SOLVER_TYPES:
            assert f'│ {name} ' in table


def test_every_file_that_it_names_exists(page, repository):
    names = re.findall(r'((?:config|examples|benchmarks)/\w+\.\w+)', page)
    names += [f'docs/{name}' for name in re.findall(r'\]\((images/\w+\.png)\)', page)]
    assert len(names) >= 6
    for name in names:
        assert (repository / name).exists(), name
