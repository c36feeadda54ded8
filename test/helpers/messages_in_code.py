"""Messages that nodes and commands can print, read from their sources."""

import ast
import re
from pathlib import Path

PLACES = (
    'tp_controller/tp_controller/ros/*.py',
    'tp_controller/tp_controller/checks/*.py',
    'tp_controller/tp_controller/tasks/*.py',
    'tp_controller/tp_controller/planning/*.py',
    'tp_controller/tp_controller/config/risks.py',
    'tp_controller/tp_controller/config/changes.py',
    'tp_controller/tp_controller/*.py',
    'tp_sim/tp_sim/simulator.py',
    'tp_sim/tp_sim/real_time.py',
)
SILENT = {'batch', 'measuring', 'identification', 'compiled', 'parameters', 'trajectory'}
SILENT |= {'prepared_callers'}
"""Modules that print nothing and warn of nothing."""
REFUSALS = {'InvalidValue', 'Parameter', 'check_times'}
"""Calls with texts of the one form "key: got …; accepts …", and descriptions of parameters."""
MISUSE = {'TypeError', 'ValueError', 'AssertionError', 'NotImplementedError', 'RuntimeError'}
HELP = {'help', 'description', 'epilog', 'usage', 'metavar', 'prog', 'accepts'}
PARTS = {'got', 'accepts', 'what', 'words', 'target_words', 'numbers', 'HELP'}
"""Names of variables that hold a part of a refusal, or the answer to --help."""


def messages(repository: Path) -> dict[str, str]:
    """Texts of three words and more, with … for what varies, and where they stand."""
    found = {}
    for pattern in PLACES:
        for path in sorted(repository.glob(pattern)):
            if path.stem not in SILENT:
                for line, text in _texts(ast.parse(path.read_text(encoding='utf-8'))):
                    found[text] = f'{path.relative_to(repository)}:{line}'
    return found


def _texts(tree):
    skipped = set()
    for node in ast.walk(tree):
        for part in _no_messages(node):
            skipped.update(ast.walk(part))
        if isinstance(node, ast.JoinedStr):
            skipped.update(set(ast.walk(node)) - {node})
    for node in ast.walk(tree):
        if node not in skipped:
            text = _template(node).strip(' …:;,.\n')
            if len(re.findall(r'[a-z]{2,}', text)) >= 3 and ' ' in text:
                yield node.lineno, ' '.join(text.split())


def _no_messages(node):
    """Parts of a node whose texts are no messages."""
    if (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)) or (
        isinstance(node, ast.keyword) and node.arg in HELP
    ):
        yield node
    elif isinstance(node, ast.Dict):
        yield from filter(None, node.keys)
    elif isinstance(node, ast.Assign):
        if any(
            name.id in PARTS
            for t in node.targets
            for name in ast.walk(t)
            if isinstance(name, ast.Name)
        ):
            yield node.value
    elif isinstance(node, ast.AnnAssign) and getattr(node.target, 'id', '') in PARTS:
        yield from filter(None, [node.value])
    elif isinstance(node, ast.Call):
        name = ast.unparse(node.func).rpartition('.')[2]
        if name in REFUSALS or name in MISUSE:
            yield from node.args
        elif (name in ('warning', 'note') and len(node.args) == 3) or name == 'Finding':
            yield node.args[-1]


def _template(node):
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.Constant) else '…' for part in node.values]
        return ''.join(parts)
    return ''
