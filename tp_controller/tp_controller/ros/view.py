"""Executable that shows a running controller on a page in the browser."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from tp_controller.command_line import OneLineParser
from tp_controller.config import read_parameter_file
from tp_controller.errors import InvalidValue, TaskPriorityError, shown
from tp_controller.parameters import Flat
from tp_controller.recording import Recording
from tp_controller.ros.arguments import one_line
from tp_controller.ros.codecs import GOALS
from tp_controller.ros.parent import end_with_ros2
from tp_controller.ros.remote_parameters import RemoteParameters
from tp_controller.ros.view_link import ViewLink
from tp_controller.ros.view_model import ViewModel
from tp_controller.ros.view_recording import ViewRecording
from tp_controller.ros.watch_table import Sight
from tp_controller.ros.watcher import Watcher
from tp_controller.view.page import Page
from tp_controller.view.playback import Playback
from tp_controller.view.view import View
from tp_controller.view.wishes import Record

REFUSED = 2
PERIOD = 0.045
"""Time [s] between two pictures."""
RETRY = 2.0
"""Time [s] after which a robot without a description is tried again."""
FILE = 'stack.yaml'
DEFAULT = 'tp_controller'


def main() -> int:
    """Show a controller until Ctrl-C.

    Returns
    -------
    int
        Exit status 2: an argument cannot be used. After Ctrl-C the process ends here, with 0.
    """
    given = _parser().parse_args(remove_ros_args(sys.argv)[1:])
    for number in (signal.SIGINT, signal.SIGTERM):
        # Who started this in the background of a script had SIGINT ignored.
        signal.signal(number, signal.default_int_handler)
    end_with_ros2()
    page: Page | None = None
    node: Node | None = None
    try:
        if given.recording is not None:
            return _play(given)
        parameters = read_file(given.config)
        if not given.folder.is_dir():
            got = shown(str(given.folder))
            raise InvalidValue('folder', got, 'a folder that is there')
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node(f'tp_view_{os.getpid()}', start_parameter_services=False)
        page = Page(given.host, given.port)
        viewer = Viewer(node, page, given, parameters)
        for line in greeting(page, given.port, given.read_only):
            print(line, flush=True)
        for number in (signal.SIGINT, signal.SIGTERM):
            # An exception could come while something is collected or called back, and be lost.
            signal.signal(number, viewer.stop)
        viewer.run()
        viewer.close()
    except InvalidValue as error:
        return _refuse(str(error))
    except NameValidationException as error:
        return _refuse(one_line(error))
    except RuntimeError as error:
        if rclpy.ok():
            raise
        return _refuse(one_line(error))
    except KeyboardInterrupt:
        pass
    finally:
        # A second Ctrl-C, of a terminal and a parent that passes it on, changes nothing.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if page is not None:
            page.close()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    # The interpreter would wait for the thread that reads meshes.
    sys.stdout.flush()
    os._exit(0)


def _parser() -> argparse.ArgumentParser:
    parser = OneLineParser(
        prog='view',
        description='Show a running controller on a page in the browser, with targets to drag, '
        'or a recording with a slider of time. Ctrl-C ends it.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog='examples:\n'
        '  ros2 run tp_controller view\n'
        '  ros2 run tp_controller view --controller /arm_1/tp_controller --port 8081\n'
        '  ros2 run tp_controller view --read-only --host 0.0.0.0\n'
        '  ros2 run tp_controller view run.mcap',
    )
    parser.add_argument(
        'recording', type=Path, nargs='?', help='a recording to look at, in place of a controller'
    )
    parser.add_argument(
        '--controller', default=DEFAULT, help='name of the node (default: %(default)s)'
    )
    parser.add_argument(
        '--simulator', default='tp_sim', help='name of the simulator (default: %(default)s)'
    )
    parser.add_argument(
        '--config',
        type=Path,
        help='parameter file of a robot that is shown until the controller answers',
    )
    parser.add_argument(
        '--host',
        default='127.0.0.1',
        help='address to listen on; 0.0.0.0: all, open to the network (default: %(default)s)',
    )
    parser.add_argument(
        '--port',
        type=int,
        default=8080,
        help='the next free one if it is taken; 0: any (default: %(default)s)',
    )
    parser.add_argument(
        '--folder',
        type=Path,
        default=Path(),
        help='folder of what the page records (default: the present one)',
    )
    parser.add_argument(
        '--read-only', action='store_true', help='nothing on the page moves or changes anything'
    )
    return parser


def _play(given: argparse.Namespace) -> int:
    """Show a recording until Ctrl-C; no node is needed."""
    recording = Recording(given.recording)
    page = Page(given.host, given.port)
    try:
        playback = Playback(page, recording, tuple(GOALS))
    except TaskPriorityError as error:
        page.close()
        return _refuse(str(error))
    if not recording.complete:
        print(f'view: {given.recording} breaks off: it was not finished', flush=True)
    for line in greeting(page, given.port, read_only=True):
        print(line, flush=True)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, playback.stop)
    playback.run()
    page.close()
    return 0


def read_file(path: Path | None) -> Flat:
    """Parameters of a controller in a file, none without one.

    Raises
    ------
    InvalidValue
        If the file cannot be used.
    """
    return {} if path is None else read_parameter_file(path, DEFAULT)


def greeting(page: Page, port: int, read_only: bool) -> Sequence[str]:
    """What the terminal says once the page is there."""
    lines = [f'view: {page.address}']
    if port not in (0, page.port):
        lines[0] += f' (port {port} is taken)'
    if page.open_to_network:
        can = 'watch' if read_only else 'move the arm (--read-only: watch alone)'
        lines.append(f'view: open to the network: whoever reaches this machine can {can}')
    return lines


def _refuse(message: str) -> int:
    print(f'view: {message}', file=sys.stderr)
    return REFUSED


class Viewer:
    """Brings together the page and the nodes.

    Parameters
    ----------
    node
        Listens and asks.
    page
        The page.
    given
        The arguments of the command line.
    parameters
        Of a controller that is shown until one answers.
    """

    def __init__(
        self, node: Node, page: Page, given: argparse.Namespace, parameters: Flat
    ) -> None:
        self._page = page
        self._watcher = Watcher(node, given.controller)
        name = self._watcher.topic.removesuffix('/state')
        namespace = name.rpartition('/')[0]
        simulator = given.simulator
        if '/' not in simulator:
            simulator = f'{namespace}/{simulator}'
        folder = Path.cwd() / FILE
        self.view = View(page, tuple(GOALS), str(folder), given.read_only)
        self._parameters = RemoteParameters(node, name)
        self._model = ViewModel(node, namespace)
        self._link: ViewLink | None = None
        self._recording: ViewRecording | None = None
        if not given.read_only:
            self._link = ViewLink(node, name, simulator, page.say)
            self._recording = ViewRecording(name, given.folder.resolve(), page.say)
        self._stopped = False
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._name = name
        self._tasks: frozenset[str] = frozenset()
        self._cycles, self._silent = 0, True
        self._due = 0.0
        self._wait = ''
        self._built = False
        if parameters:
            self._build(parameters)
            self._built = False

    def run(self) -> None:
        """Show until `stop` is called."""
        while not self._stopped:
            begin = time.monotonic()
            self.work()
            left = PERIOD - (time.monotonic() - begin)
            if left > 0.0:
                # Answers are taken meanwhile.
                self._executor.spin_once(timeout_sec=left)
                left = PERIOD - (time.monotonic() - begin)
                if left > 0.0:
                    time.sleep(left)

    def stop(self, *_: object) -> None:
        """Let `run` end after the present picture; may be the handler of a signal."""
        self._stopped = True

    def work(self) -> None:
        """Make one picture, and do what has been asked for since the last one."""
        for _ in range(20):
            self._executor.spin_once(timeout_sec=0.0)
        sight = self._watcher.look()
        self._follow_restarts(sight)
        self._parameters.work()
        if self._parameters.complete and not self._built and time.monotonic() >= self._due:
            self._build(self._parameters.values)
        self._take_model()
        for wish in self.view.wishes.take():
            if isinstance(wish, Record):
                self._record(wish.name)
            elif self._link is not None:
                self._link.grant(wish, None if sight.silence else sight.state)
        panel = self.view.panel
        panel.wait(f'waiting for {self._name}: {sight.silence}' if sight.silence else self._wait)
        if self._link is not None:
            panel.show_simulator(self._link.simulated)
        if self._recording is not None:
            self._recording.work()
            panel.show_recording(str(self._recording.path or ''))
        try:
            self.view.show(sight.state, sight.rate, self._parameters.values)
        except InvalidValue as error:
            # The state is of another robot than the model, which follows.
            self._wait = f'the state cannot be drawn: {error}'

    def close(self) -> None:
        """Finish the recording, if one is being made."""
        if self._recording is not None:
            self._recording.close()

    def _record(self, name: str) -> None:
        if self._recording is not None:
            if name:
                self._recording.start(name)
            else:
                self._recording.stop()

    def _follow_restarts(self, sight: Sight) -> None:
        """Ask for everything anew if the controller is another one, or has other tasks."""
        state = sight.state
        if state is None:
            return
        tasks = frozenset(task.name for task in state.tasks)
        back = state.cycles < self._cycles or (self._silent and not sight.silence)
        self._cycles, self._silent = state.cycles, bool(sight.silence)
        if sight.silence or not (back or tasks != self._tasks):
            return
        self._tasks, self._built = tasks, False
        self._parameters.ask_again()
        if self._link is not None:
            self._link.prepare(state)

    def _build(self, parameters: Flat) -> None:
        self._wait = self._model.build(parameters)
        if self._wait:
            self._wait = f'waiting for {self._wait}'
            self._due = time.monotonic() + RETRY
        else:
            self._built = True

    def _take_model(self) -> None:
        try:
            found = self._model.take_stack()
        except TaskPriorityError as error:
            self._wait = f'the robot cannot be drawn: {error}'
            return
        if found is not None:
            self.view.set_stack(*found)
        for visual in self._model.take_visuals():
            self.view.add_visual(visual)
