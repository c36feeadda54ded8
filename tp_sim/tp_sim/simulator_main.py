"""Executable of the simulator node."""

from tp_controller.ros.run import run_node


def main() -> int:
    """Run the simulator until SIGINT or SIGTERM."""
    return run_node('tp_sim', 'tp_sim.simulator', 'SimulatorNode')
