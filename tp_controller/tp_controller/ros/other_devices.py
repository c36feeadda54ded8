"""Joint states of other devices on the same topic."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from tp_controller.ros.joint_states import JointStateValues

KNOWN = 8
"""So many lists of names are kept."""
GONE = 3.0
"""A device that was silent for so long [s] counts no more."""


class OtherDevices:
    """Tells joint states that have none of the robot's joints: those of a gripper, for example.

    Such a state says nothing of the arm, whatever its stamp: it is not older or newer than those
    of the arm.

    Parameters
    ----------
    joints
        Names of the robot's joints in joint states.

    Attributes
    ----------
    newest
        The last such state since it was set to None.
    """

    def __init__(self, joints: Collection[str]) -> None:
        self._joints = frozenset(joints)
        self._own: Sequence[str] | None = None
        self._seen: dict[tuple[str, ...], float] = {}
        self.newest: JointStateValues | None = None

    def sent(self, msg: JointStateValues, now: float) -> bool:
        """Whether another device sent this state, at a steady time [s]."""
        names = msg.name
        # Those of known layouts are the same object each time.
        if names is self._own:
            return False
        if not names or not self._joints.isdisjoint(names):
            self._own = names
            return False
        if len(self._seen) >= KNOWN:
            self._seen.clear()
        self._seen[tuple(names)] = now
        self.newest = msg
        return True

    def count(self, now: float) -> int:
        """How many other devices send, as far as their joints tell."""
        return sum(now - seen < GONE for seen in self._seen.values())
