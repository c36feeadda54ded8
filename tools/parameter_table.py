"""Print the table of parameters of docs/parameters.md, from the schemas that the nodes read."""

from collections.abc import Mapping

from tp_controller.config.schema import CONTROLLER, OBJECTIVE_GAIN, SHARED
from tp_controller.objectives import OBJECTIVE_TYPES
from tp_controller.parameters import REQUIRED, Parameter
from tp_controller.tasks import COMMON, TASK_TYPES
from tp_sim.demo.script import DEMO
from tp_sim.settings import SIMULATOR


def main() -> None:
    """Print the table."""
    print('\n'.join(table()))


def table() -> list[str]:
    """Lines of the table."""
    lines = ['| parameter | meaning | default | while running |', '|---|---|---|---|']
    lines += _group('both nodes', SHARED)
    lines += _group('`tp_controller`', CONTROLLER, without=SHARED)
    lines += _group('every objective, `solver.objective.…`', {'gain': OBJECTIVE_GAIN})
    for name, objective in OBJECTIVE_TYPES.items():
        if objective.parameters:
            title = f'objective of type `{name}`, `solver.objective.…`'
            lines += _group(title, objective.parameters)
    lines += _group('every task, `tasks.<name>.…`', COMMON)
    for name, task in TASK_TYPES.items():
        lines += _group(f'tasks of type `{name}`, `tasks.<name>.…`', task.parameters)
    lines += _group('`tp_sim`', SIMULATOR, without=SHARED)
    lines += _group('`tp_demo` (read by `make demo`)', DEMO)
    return lines


def _group(
    title: str, schema: Mapping[str, Parameter], without: Mapping[str, Parameter] | None = None
) -> list[str]:
    rows = [f'| **{title}** | | | |']
    for key, parameter in schema.items():
        other = (without or {}).get(key)
        if other is None or other.description != parameter.description:
            changes = 'yes' if parameter.runtime else ''
            rows.append(f'| `{key}` | {_meaning(parameter)} | {_default(parameter)} | {changes} |')
    return rows


def _meaning(parameter: Parameter) -> str:
    if parameter.choices:
        return f'{parameter.description}: {parameter.accepts}'
    return parameter.description


def _default(parameter: Parameter) -> str:
    value = parameter.default
    if value is REQUIRED:
        return 'required'
    if value is None:
        return ''
    if isinstance(value, tuple):
        value = list(value)
    return f'`{str(value).lower() if isinstance(value, bool) else value}`'


if __name__ == '__main__':
    main()
