"""docs/troubleshooting.md has every message, status and outcome that there is."""

import re

import pytest
from messages_in_code import messages

from tp_controller.causes import Kind

NO_MESSAGES = {
    'angle about … [rad]',  # parts of refusals
    'a position task of a frame in front of the axle',
    'one twist for each point',
    'in a search from … random',
    'module … has no attribute',  # of Python
    'of the base',  # cells and heads of tables
    'turns without end (rad)',
    'why not more',
    '- history: … depth: … reliability: … durability',  # YAML for other programs
    'age …, at most',
    'which is … from its start',
}


@pytest.fixture(scope='module')
def page(repository):
    text = (repository / 'docs' / 'troubleshooting.md').read_text(encoding='utf-8')
    return ' '.join(text.replace('%s', '…').split())


def test_every_message_of_the_code_is_on_the_page(repository, page):
    found = messages(repository)
    assert len(found) > 150
    assert set(found) >= NO_MESSAGES
    missing = [
        f'{place}: {text}'
        for text, place in found.items()
        if text not in NO_MESSAGES and text.replace('%s', '…') not in page
    ]
    assert not missing, 'not in docs/troubleshooting.md:\n' + '\n'.join(missing)


@pytest.mark.parametrize(
    ('path', 'count'),
    [('msg/ControllerState.msg', 5), ('action/Reach.action', 7), ('msg/Cause.msg', 10)],
)
def test_every_status_outcome_and_cause_is_on_the_page(repository, page, path, count):
    text = (repository / 'tp_interfaces' / path).read_text(encoding='utf-8')
    names = re.findall(r'^uint8 ([A-Z_]+)=', text, flags=re.MULTILINE)
    assert len(names) == count
    for name in names:
        assert f'`{name}`' in page


def test_every_cause_is_there_in_words(page):
    for kind in Kind:
        assert kind.value in page
