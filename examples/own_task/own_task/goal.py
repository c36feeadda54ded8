"""Goals of the task as std_msgs/Float64; only the ROS node imports this."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64

from own_task.frame_distance import FrameDistanceTask
from tp_controller.ros.codecs import Frames, GoalCodec


class DistanceGoal(GoalCodec):
    """A distance [m] as Float64."""

    def target(self, task: FrameDistanceTask, msg: Float64, frames: Frames) -> NDArray[np.float64]:
        """Return the distance (1,), which has no frame."""
        return task.check_target([msg.data])

    def fill(self, msg: Float64, names: Sequence[str], values: list[float]) -> None:
        """Put the distance in."""
        (msg.data,) = values

    def word(self, name: str) -> str:
        """Return the name of the value with its unit."""
        return f'{name} [m]'


DISTANCE = DistanceGoal(Float64)
