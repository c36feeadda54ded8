"""Configuration spaces: the coordinates of a robot's joints, and the velocities that move them.

A revolute or prismatic joint has one coordinate and its derivative as the velocity; others have a
pose, see `tp_controller.robot.motions`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot.motions import BENDING, FREE, KEPT, NO_LENGTH, SCALAR, Block
from tp_controller.rotations import wrap

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Space:
    """Configuration space of a robot.

    Parameters
    ----------
    joints
        Names of the controlled joints.
    kinds
        `SCALAR` or one of `MOTIONS` per joint; scalar when left out.
    wrapping
        For every joint whether whole turns make no difference; absent means no.

    Attributes
    ----------
    coordinates, velocities
        Names of the coordinates (nq,) and of the velocities (nv,); those of a planar or floating
        joint are ``<joint>/<name>``. A scalar joint has one of each, by its own name.
    joints, kinds, first_v
        The joints, their kinds, and the first velocity of each.
    own
        Index (nv,) of the coordinate whose derivative a velocity is; -1 if there is none.
    ranged
        Whether each velocity (nv,) has such a coordinate, which may have a range.
    scalars
        Names of the scalar joints.
    blocks
        Planar and floating joints.
    wrapping
        For every coordinate whether whole turns make no difference (nq,).
    neutral
        Scalars at zero, poses at the origin (nq,); a read-only array.
    """

    def __init__(
        self,
        joints: Sequence[str],
        kinds: Sequence[str] | None = None,
        wrapping: Sequence[bool] | None = None,
    ) -> None:
        kinds = [SCALAR] * len(joints) if kinds is None else kinds
        wrapping = [False] * len(joints) if wrapping is None else wrapping
        coordinates: list[str] = []
        velocities: list[str] = []
        wraps: list[bool] = []
        own: list[int] = []
        first: list[int] = []
        blocks: list[Block] = []
        for joint, kind, turns in zip(joints, kinds, wrapping, strict=True):
            first.append(len(velocities))
            if kind == SCALAR:
                own.append(len(coordinates))
                coordinates.append(joint)
                velocities.append(joint)
                wraps.append(turns)
                continue
            block = Block(joint, kind, len(coordinates), len(velocities))
            blocks.append(block)
            names = block.motion.coordinates
            coordinates += [f'{joint}/{name}' for name in names]
            velocities += [f'{joint}/{block.motion.velocities[i]}' for i in block.kept]
            wraps += [name == 'yaw' for name in names]
            own += [-1] * block.kept.size
        self.coordinates, self.velocities = tuple(coordinates), tuple(velocities)
        self.joints, self.kinds, self.first_v = tuple(joints), tuple(kinds), tuple(first)
        self.wrapping, self.blocks = tuple(wraps), tuple(blocks)
        self.own = np.array(own, dtype=np.int64)
        self.ranged = self.own >= 0
        self.scalars = tuple(
            name for name, one in zip(velocities, self.ranged, strict=True) if one
        )
        self._scalar_v = np.flatnonzero(self.ranged)
        self._scalar_q = self.own[self._scalar_v]
        pairs = zip(self._scalar_q.tolist(), self._scalar_v.tolist(), strict=True)
        self._turning = [(i, j) for i, j in pairs if wraps[i]]
        self.neutral: Vector = np.zeros(len(coordinates))
        for block in blocks:
            self.neutral[block.q] = block.motion.neutral()
        self.neutral.flags.writeable = False

    @property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return len(self.velocities)

    def spread(self, values: Sequence[float] | Vector) -> Vector:
        """One value per velocity (nv,) out of one per joint."""
        counts = [1 if kind == SCALAR else len(KEPT[kind]) for kind in self.kinds]
        return np.repeat(np.array(values, dtype=float), counts)

    def integrate(self, q: Vector, way: Vector) -> Vector:
        """Configuration (nq,) after velocities have acted: ``q`` plus ``way`` where that is all.

        Parameters
        ----------
        q
            Configuration (nq,) [rad, m].
        way
            Velocities times a time (nv,) [rad, m]; they are constant during that time.
        """
        if not self.blocks:
            return q + way
        x = way.copy()
        x[self._scalar_v] += q[self._scalar_q]
        return self.point(q, x)

    def difference(self, q0: Vector, q1: Vector) -> Vector:
        """Velocities (nv,) that lead from one configuration to another in one unit of time.

        Turns go the shorter way. What a differential drive cannot do, to the left, is left out.

        Parameters
        ----------
        q0, q1
            Configurations (nq,) [rad, m].
        """
        if not self.blocks:
            way = q1 - q0
        else:
            way = self.chart(q0, q1)
            way[self._scalar_v] -= q0[self._scalar_q]
        for _, j in self._turning:
            way[j] = wrap(way[j])
        return way

    def positions(self, q: Vector) -> Vector:
        """Positions (nv,) of scalar joints; zero for the velocities of a pose."""
        if not self.blocks:
            return q
        x = np.zeros(self.nv)
        x[self._scalar_v] = q[self._scalar_q]
        return x

    def chart(self, anchor: Vector, q: Vector) -> Vector:
        """Positions (nv,) of scalar joints, and the ways of poses from an anchor (nq,).

        Those of a pose that is none, because its quaternion has no length, are infinite.
        """
        x = self.positions(q)
        for block in self.blocks:
            if block.size == FREE and not np.linalg.norm(q[block.q][3:]) > NO_LENGTH:
                x[block.v] = math.inf
                continue
            x[block.v] = block.motion.way(anchor[block.q], q[block.q])[block.kept]
        return x

    def point(self, anchor: Vector, x: Vector) -> Vector:
        """Configuration (nq,) with these positions and ways from an anchor: undoes `chart`."""
        if not self.blocks:
            return x
        q = np.empty(self.nq)
        q[self._scalar_q] = x[self._scalar_v]
        for block in self.blocks:
            q[block.q] = block.motion.moved(anchor[block.q], block.twist(x))
        return q

    def unwrapped(self, q: Vector, near: Vector) -> Vector:
        """Configuration (nq,) whose turning joints are moved by whole turns to be near others.

        Parameters
        ----------
        q
            Configuration (nq,) [rad, m]; it is returned itself if it is near already.
        near
            Positions (nv,) of scalar joints.
        """
        found = q
        for i, j in self._turning:
            turns = round((float(near[j]) - float(q[i])) / math.tau)
            if turns:
                found = q.copy() if found is q else found
                found[i] += math.tau * turns
        return found

    def rates(self, q: Vector) -> Matrix:
        """Derivative (nq, nv) of the coordinates by the velocities at a configuration (nq,)."""
        found = np.zeros((self.nq, self.nv))
        found[self._scalar_q, self._scalar_v] = 1.0
        for block in self.blocks:
            found[block.q, block.v] = block.motion.rates(q[block.q])[:, block.kept]
        return found

    def rate_bounds(self) -> Matrix:
        """Bounds (nq, nv) on `rates` at any configuration, for the way along an arc too.

        The turns of a joint with a pose have `BENDING` for its position.
        """
        found = np.abs(self.rates(self.neutral))
        for block in self.blocks:
            bound = np.ones((block.q.stop - block.q.start, block.size))
            bound[: block.positions, block.positions :] = BENDING
            bound[block.positions :, : block.positions] = 0.0
            found[block.q, block.v] = bound[:, block.kept]
        return found

    def bent(self, coordinates: Sequence[int]) -> bool:
        """Whether `rates` of any of these coordinates change with the configuration."""
        blocks = [self.block_of(i) for i in coordinates]
        return any(
            block is not None and (block.size == FREE or i < block.q.start + block.positions)
            for i, block in zip(coordinates, blocks, strict=True)
        )

    def bends(self, q: Vector) -> NDArray[np.float64]:
        """Second derivative (nq, nv, nv), symmetric, of positions at a configuration (nq,).

        That of coordinates that are no position is not given, but zero.
        """
        found = np.zeros((self.nq, self.nv, self.nv))
        for block in self.blocks:
            free, turns = block.size == FREE, block.size - block.turns
            J = block.motion.rates(q[block.q])
            full = np.zeros((block.positions, block.size, block.size))
            for w in range(turns, block.size):
                axis = np.eye(3)[w - turns if free else 2]
                for v in range(turns):
                    way = np.cross(axis, np.eye(3)[v])[: block.positions]
                    full[:, v, w] = full[:, w, v] = 0.5 * J[: block.positions, :turns] @ way
            kept = full[:, block.kept][:, :, block.kept]
            found[block.q.start : block.q.start + block.positions, block.v, block.v] = kept
        return found

    def velocity(self, q: Vector, rates: Vector) -> Vector:
        """Velocities (nv,) out of the time derivatives (nq,) of the coordinates."""
        if not self.blocks:
            return rates
        found = self.positions(rates)
        for block in self.blocks:
            found[block.v] = block.motion.velocity(q[block.q], rates[block.q])[block.kept]
        return found

    def coordinate_reach(self, reach: Matrix) -> Matrix:
        """Bounds (k, nq) on a change per change of the coordinates, out of those per velocity.

        Parameters
        ----------
        reach
            Bounds (k, nv) per velocity. That of a translation is the same in all directions.
        """
        if not self.blocks:
            return reach
        found = np.zeros((len(reach), self.nq))
        found[:, self._scalar_q] = reach[:, self._scalar_v]
        for block in self.blocks:
            full = np.zeros((len(reach), block.size))
            full[:, block.kept] = reach[:, block.v]
            found[:, block.q] = block.motion.spread(full)
        return found

    def block_of(self, coordinate: int) -> Block | None:
        """Planar or floating joint that a coordinate belongs to; None for a scalar one."""
        for block in self.blocks:
            if block.q.start <= coordinate < block.q.stop:
                return block
        return None
