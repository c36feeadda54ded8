"""Executable of the controller node."""

from tp_controller.ros.run import run_node


def main() -> int:
    """Run the controller until SIGINT or SIGTERM."""
    return run_node('tp_controller', 'tp_controller.ros.controller', 'ControllerNode')
