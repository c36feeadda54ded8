"""Commands that pages show, and what is wrong with them, without running any."""

import ast
import importlib
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import yaml

from tp_controller.config.schema import CONTROLLER, SHARED
from tp_controller.tasks import COMMON
from tp_sim.settings import SIMULATOR

FOREIGN = {'xacro', 'check_urdf', 'dask', 'test', 'colcon'}
"""Programs that this project does not have."""
OTHERS = {
    'robot_state_publisher': {'robot_state_publisher'},
    'controller_manager': {'ros2_control_node', 'spawner'},
    'own_task': set(),
}
"""Executables of other packages."""
VERBS = {
    'lifecycle': {'set', 'get'},
    'control': {'switch_controllers'},
    'node': {'list'},
    'topic': {'echo', 'hz', 'info', 'list', 'pub'},
    'param': {'set', 'get'},
    'service': {'call'},
    'action': {'send_goal'},
}
INLINE = re.compile(r'`((?:ros2|make|python) [^`]+)`')


def commands(text: str) -> Iterator[str]:
    """Commands of a page's fences without a language, and of its inline code."""
    outside: list[str] = []
    block: list[str] = outside
    for line in text.splitlines():
        if not line.startswith('```'):
            block.append(line)
        elif block is outside:
            block = [line]
        else:
            if block[0] == '```':
                yield from _joined(block[1:])
            block = outside
    for code in INLINE.findall('\n'.join(outside)):
        # Names of commands alone, such as those of ros2 param, are no commands.
        if '…' not in code and not re.fullmatch(r'ros2 [a-z]+( [a-z_]+)?', code):
            yield ' '.join(code.split())


def _joined(lines: list[str]) -> Iterator[str]:
    """Lines, those that go on behind a backslash or inside quotes together."""
    whole = ''
    for line in lines:
        whole += line
        if whole.endswith('\\'):
            whole = whole[:-1]
            continue
        try:
            shlex.split(whole, comments=True)
        except ValueError:
            whole += '\n'
            continue
        if whole.strip() and not whole.lstrip().startswith('#'):
            yield whole.strip()
        whole = ''
    assert not whole, f'a quote is not closed: {whole}'


class Known:
    """What commands may name.

    Parameters
    ----------
    root
        The repository.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        makefile = (root / 'Makefile').read_text(encoding='utf-8')
        self.targets = set(re.findall(r'^([\w-]+):', makefile, flags=re.MULTILINE))
        self.variables = set(re.findall(r'^(\w+) \?=', makefile, flags=re.MULTILINE))
        self.executables = {}
        for package in ('tp_controller', 'tp_sim'):
            text = (root / package / 'setup.py').read_text(encoding='utf-8')
            found = re.findall(r"'(\w+) = ([\w.]+):main'", text)
            self.executables[package] = {name: self._module(module) for name, module in found}

    def _module(self, name: str) -> Path:
        package, *rest = name.split('.')
        return self.root.joinpath(package, package, *rest).with_suffix('.py')

    def check(self, command: str) -> None:
        """Raise AssertionError for a command that does not exist, or has unknown options."""
        words = shlex.split(command, comments=True)
        while words and re.fullmatch(r'[A-Z_]+=.*', words[0]):
            words.pop(0)
        if words[0] == 'chrt':
            words = words[3:]
        program, *rest = words
        for word in rest:
            if re.match(r'config/\w+\.yaml$', word):
                assert (self.root / word).exists(), word
        if program == 'ros2':
            self._ros2(*rest)
        elif program == 'make':
            self._make(rest)
        elif program == 'python':
            self._python(rest)
        elif program == 'source':
            assert rest == ['setup.bash'], command
        elif program == 'pip':
            (place,) = (word for word in rest[1:] if not word.startswith('-'))
            assert (self.root / place.partition('[')[0]).exists(), command
        elif program.startswith('install/'):
            _, package, _, same, name = program.split('/')
            assert package == same, command
            self._run(package, name, rest)
        elif '/' in program:
            assert (self.root / program).exists(), program
        else:
            assert program in FOREIGN, f'unknown program {program}'

    def _make(self, rest: list[str]) -> None:
        for word in rest:
            name, sign, _ = word.partition('=')
            known = self.variables if sign else self.targets
            assert name in known, f'make: {name}'

    def _python(self, rest: list[str]) -> None:
        if rest[0] == '-m':
            path = self.root / 'tp_controller' / rest[1].replace('.', '/')
            path = path / '__main__.py' if path.is_dir() else path.with_suffix('.py')
            rest = rest[2:]
        else:
            path, rest = self.root / rest[0], rest[1:]
        assert path.exists(), path
        self._options(path, rest)

    def _run(self, package: str, name: str, rest: list[str]) -> None:
        if package in OTHERS:
            assert name in OTHERS[package], f'{package} {name}'
            return
        assert name in self.executables[package], f'{package} has no executable {name}'
        if '--ros-args' in rest:
            rest = rest[: rest.index('--ros-args')]
        self._options(self.executables[package][name], rest)

    def _options(self, path: Path, words: list[str]) -> None:
        """Look for options among the texts of a program and of its folder's modules."""
        found = set()
        for file in (path, *path.parent.glob('command*.py')):
            for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    found.add(node.value.lstrip('-').replace('_', '-'))
        for word in words:
            if re.match(r'--[a-z]', word):
                assert word[2:].partition('=')[0] in found, f'{path.name} has no option {word}'

    def _ros2(self, kind: str, *rest: str) -> None:
        if kind == 'run':
            self._run(rest[0], rest[1], list(rest[2:]))
            return
        if kind == 'launch':
            path = self.root / rest[0] / 'launch' / rest[1]
            assert path.exists(), path
            text = path.read_text(encoding='utf-8')
            for word in rest[2:]:
                assert f"'{word.partition(':=')[0]}'" in text, f'{path.name}: {word}'
            return
        verb, *rest_of = rest
        assert verb in VERBS[kind], f'ros2 {kind} {verb}'
        plain = [word for word in rest_of if not word.startswith('-')]
        if kind == 'param':
            self._parameter(*plain)
        elif kind in ('service', 'action') or verb == 'pub':
            _typed(plain[1], plain[2:])

    def _parameter(self, node: str, key: str, value: str | None = None) -> None:
        schema = SIMULATOR if node.endswith('tp_sim') else {**SHARED, **CONTROLLER}
        known = COMMON if key.startswith('tasks.') else schema
        parameter = known[key.split('.', 2)[2] if known is COMMON else key]
        if value is not None:
            assert parameter.runtime, f'{key} does not change while running'
            parameter.read(key, yaml.safe_load(value))


def _typed(name: str, values: list[str]) -> None:
    """Check a message of a type by its fields, level by level."""
    package, kind, leaf = name.split('/')
    found = getattr(importlib.import_module(f'{package}.{kind}'), leaf)
    message = {'srv': 'Request', 'action': 'Goal'}.get(kind)
    if values:
        _fields(getattr(found, message) if message else found, yaml.safe_load(values[0]))


def _fields(message: type, values: dict) -> None:
    types = message.get_fields_and_field_types()
    for key, value in (values or {}).items():
        assert key in types, f'{message.__name__} has no {key}'
        inner = re.search(r'(\w+)/(\w+)', types[key])
        for part in value if isinstance(value, list) else [value]:
            if inner and isinstance(part, dict):
                package = importlib.import_module(f'{inner[1]}.msg')
                _fields(getattr(package, inner[2]), part)
