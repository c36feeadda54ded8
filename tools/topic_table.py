"""Print the table of the tasks' topics of docs/interface.md, from the codecs that the node has."""

from tp_controller.ros.codecs import GOALS


def main() -> None:
    """Print the table."""
    print('\n'.join(table()))


def table() -> list[str]:
    """Lines of the table: the message of each topic by type of task."""
    lines = [
        '| task type | `~/<task>/goal` | `~/<task>/feedforward` | `~/<task>/trajectory` |',
        '|---|---|---|---|',
    ]
    for name, codec in GOALS.items():
        types = (codec.message, codec.feedforward_message, codec.trajectory_message)
        lines.append(f'| `{name}` | ' + ' | '.join(map(_message, types)) + ' |')
    return lines


def _message(kind: type | None) -> str:
    return '–' if kind is None else f'{kind.__module__.split(".")[0]}/{kind.__name__}'


if __name__ == '__main__':
    main()
