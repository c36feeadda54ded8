"""A stand-in for the package ``launch``, which has no wheel: what a launch file would start."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

from ament_index_python.packages import get_package_share_directory


def _made(name):
    """A class whose objects are what they were made of."""
    return lambda *words, **values: SimpleNamespace(made=name, words=words, **values)


class _Configuration:
    def __init__(self, name):
        self.name = name

    def perform(self, context):
        return context[self.name]


MODULES = {
    'launch': {'LaunchDescription': list},
    'launch.actions': {
        name: _made(name) for name in ('DeclareLaunchArgument', 'LogInfo', 'OpaqueFunction')
    },
    'launch.substitutions': {'LaunchConfiguration': _Configuration},
    'launch_ros': {},
    'launch_ros.actions': {'Node': _made('Node')},
}


def stand_in(monkeypatch):
    """Let launch files find the stand-in."""
    for name, values in MODULES.items():
        module = ModuleType(name)
        vars(module).update(values)
        monkeypatch.setitem(sys.modules, name, module)


def started(package, name, **arguments):
    """What a launch file starts, and says, with these arguments, by the names of executables."""
    path = Path(get_package_share_directory(package)) / 'launch' / name
    *declared, last = runpy.run_path(str(path))['generate_launch_description']()
    context = {one.words[0]: one.default_value for one in declared}
    assert set(arguments) <= set(context)
    found = last.function({**context, **arguments})
    return {getattr(one, 'executable', one.made): one for one in found}


def ros_arguments(node):
    """Arguments that a started node gets after ``--ros-args``."""
    words = list(getattr(node, 'ros_arguments', ()))
    for rule in (
        *(('__node', name) for name in [getattr(node, 'name', '')] if name),
        *(('__ns', f'/{name}') for name in [node.namespace] if name),
        *getattr(node, 'remappings', ()),
    ):
        words += ['-r', ':='.join(rule)]
    for given in node.parameters:
        if isinstance(given, str):
            words += ['--params-file', given]
        else:
            words += [word for key, value in given.items() for word in ('-p', f'{key}:={value}')]
    return words
