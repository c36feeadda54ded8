"""Clearance of an arm: signed distances of its links from an obstacle and from each other.

coal computes the distances (Gilbert, Johnson and Keerthi 1988, and expanding polytopes where
shapes overlap), and only those that can be small: from a distance d at one configuration
follows, at any other, ``d - reach |q' - q|``.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.robot.bodies import body_place
from tp_controller.robot.model import Robot
from tp_controller.robot.reach import joint_path
from tp_controller.robot.shapes import Shape

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

TOLERANCE = 1e-7
"""Of the iterations, relative; where these fail, `COARSE`. Smaller ones fail more often."""
COARSE = 1e-6
ITERATIONS = 255
"""Most that deeply overlapping round shapes may take."""
SHORT = 1.0
"""Moves [m] of an obstacle from this one on make every distance new."""
MANY = 0.5
"""From this share of all pairs on, all are computed: one call for all costs about as much."""
RESULT = 160
"""Bytes from one of coal's results to the next, where these are as they are known."""


class Row(NamedTuple):
    """What one distance is between: some shapes of a link, and an obstacle or another link's."""

    name: str
    link: str
    shapes: tuple[Shape, ...]
    other: str | None = None
    """The other link, None for the obstacle."""
    others: tuple[Shape, ...] = ()


class Clearance:
    """Signed distances between shapes at the robot's present configuration, in k rows.

    A row has the least distance between shapes of a link and an obstacle, or between those
    of two links; where they overlap it is minus the length of the shortest way apart.
    Its derivative is ``nᵀ (J_a - J_b)`` with the unit normal n from the one to the other and
    the Jacobians of the nearest points. In the depth at which the middle lines of rounded
    shapes meet, n is one of the many that lead out.

    `obstacle_clearance` and `self_clearance` choose the rows.

    Parameters
    ----------
    robot
        The robot.
    rows
        What each distance is between (k,); between two links there has to be a joint.
    obstacle
        The obstacle, at its pose in the base frame; None if the rows have two links.

    Attributes
    ----------
    names
        Name of each row: a link, or two links ``a - b``.
    links
        The link of each row, and the other one, None for the obstacle.
    distance
        Distance (k,) [m] of every row that is nearer than its threshold, of the others a
        lower bound that is not below the threshold; the least of all is exact. Filled by
        `update`.
    slope
        Derivative (k, n) of the distances that are nearer than their threshold, for the
        others zero; filled by `update`.
    reach
        Bound (k, n) on the size of the derivative, at every configuration inside the limits.
    """

    def __init__(self, robot: Robot, rows: Sequence[Row], obstacle: Shape | None = None) -> None:
        # Compiled, or loaded, for tasks that need it.
        from tp_controller.robot import bounds

        self._bounds = bounds
        self.robot = robot
        self.names = tuple(row.name for row in rows)
        self.links = tuple((row.link, row.other) for row in rows)
        self._geometry = pin.GeometryModel()
        self._hulls: list[tuple[Matrix, float]] = []
        self._obstacle = obstacle
        added: dict[tuple[str, int], int] = {}
        starts, counts, sides = [], [], []
        reaches: list[Vector] = []
        if obstacle is not None:
            self._place('obstacle', 0, obstacle)
        for row in rows:
            starts.append(len(reaches))
            for shape in row.shapes:
                one = self._add(row.link, shape, added)
                # The obstacle is the first of all.
                others = (
                    [0]
                    if row.other is None
                    else [self._add(row.other, other, added) for other in row.others]
                )
                for other in others:
                    self._geometry.addCollisionPair(pin.CollisionPair(one, other))
                    reaches.append(self._pair_reach(one, other))
            counts.append(len(reaches) - starts[-1])
            sides.append(self._sides(row))
        self._results = self._geometry.createData()
        for request in self._results.distanceRequests:
            _set_tolerance(request, TOLERANCE)
            request.epa_max_iterations = ITERATIONS
            _start_afresh(request)
        k, n, pairs = len(rows), robot.n, len(reaches)
        self._starts, self._sides_of = np.array(starts, dtype=np.int64), np.array(sides)
        self._row_of = np.repeat(np.arange(k), counts)
        self.reach: Matrix = np.maximum.reduceat(np.array(reaches), self._starts)
        # Distances between configurations are those of their coordinates.
        self._pair_reaches = robot.space.coordinate_reach(np.array(reaches))
        self.distance: Vector = np.full(k, math.nan)
        self.slope: Matrix = np.zeros((k, n))
        # For every pair of shapes: a distance, the configuration of it, and the bound that is
        # left of it.
        self._known, self._lower = np.full(pairs, -math.inf), np.full(pairs, -math.inf)
        self._anchor, self._ways = np.zeros((pairs, robot.nq)), np.zeros((pairs, 6))
        S = None if robot.coupling is None else robot.coupling.S
        self._S: Matrix = np.zeros((0, 0)) if S is None else np.array(S, dtype=float, order='C')
        self._coupled = S is not None
        view = _view(robot, self._geometry, self._results)
        self._copies = view is None
        self._found: Matrix = np.zeros((pairs, bounds.WIDTH)) if view is None else view
        self._near = np.zeros(pairs, dtype=np.int64)
        self._threshold, self._pair_threshold = np.full(k, math.inf), np.full(pairs, math.inf)

    @property
    def threshold(self) -> Vector:
        """Distance (k,) [m] below which each row is computed, infinite at first; a copy."""
        return self._threshold.copy()

    @threshold.setter
    def threshold(self, values: float | Vector) -> None:
        self._threshold[:] = values
        self._threshold.take(self._row_of, out=self._pair_threshold)

    @property
    def obstacle(self) -> Shape | None:
        """The obstacle where it is now, None between links."""
        return self._obstacle

    def move(self, pose: pin.SE3) -> None:
        """Move the obstacle to a pose in the base frame."""
        if self._obstacle is None:
            raise ValueError('there is no obstacle to move')
        before = self._obstacle.pose
        way = float(np.linalg.norm(pose.translation - before.translation))
        if way < SHORT and np.array_equal(before.rotation, pose.rotation):
            # No distance changes by more than that.
            self._known -= way
        else:
            self._known[:] = -math.inf
        self._obstacle = self._obstacle._replace(pose=pin.SE3(pose))
        self._geometry.geometryObjects[0].placement = self._obstacle.pose

    def update(self) -> None:
        """Fill `distance` and `slope` at the robot's present configuration."""
        self._measure(self._pair_threshold, self.distance, True)
        arguments = (
            self._found, self._ways, self._lower, self._starts, self.distance, self._threshold,
            self._sides_of, self.robot.twists, self._S, self._coupled, self._near, self.slope,
        )  # fmt: skip
        missing = self._bounds.slopes(*arguments)
        if missing:
            self._ways.fill(0.0)
            for pair in self._near[:missing].tolist():
                self._ways[pair] = self._any_way(pair)
            self._bounds.slopes(*arguments)
            self._ways.fill(0.0)

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write what `update` would make of `distance` (k,) to ``out``, and nothing else.

        Parameters
        ----------
        out
            The distances.
        enough
            Distances (k,) [m] that take the place of the thresholds.
        """
        threshold = self._pair_threshold if enough is None else enough[self._row_of]
        self._measure(threshold, out)

    def distances(self) -> Vector:
        """Every distance (k,) [m], however far; leaves `distance` and `slope` as they are."""
        distance = np.empty(len(self.names))
        self._measure(np.full(len(self._known), math.inf), distance)
        return distance

    def nearest_points(self) -> Matrix:
        """Nearest points (k, 2, 3) [m] of every row, in the base frame, the link's first."""
        self.distances()
        results = self._results.distanceResults
        return np.array(
            [
                (results[pair].getNearestPoint1(), results[pair].getNearestPoint2())
                for pair in map(self._nearest_pair, range(len(self.names)))
            ]
        )

    def _measure(self, threshold: Vector, distance: Vector, least: bool = False) -> bool:
        """Fill distances (k,), and the least of all exactly on demand; whether any is near."""
        q, lower = self.robot.q, self._lower
        count = self._bounds.lower_bounds(
            q, self._anchor, self._pair_reaches, self._known, threshold, lower, self._near
        )
        if count:
            self._place_shapes()
            self._compute(count)
        if least:
            self._find_least(count > 0)
        self._bounds.least(lower, self._starts, distance)
        return count > 0

    def _place_shapes(self) -> None:
        pin.updateGeometryPlacements(
            self.robot.model, self.robot.data, self._geometry, self._results
        )

    def _find_least(self, placed: bool) -> None:
        """Compute distances until the least one is known; shapes may be in place already."""
        lower = self._lower
        for _ in range(len(lower)):
            pair = int(lower.argmin())
            if lower[pair] == self._known[pair]:
                return
            if not placed:
                self._place_shapes()
                placed = True
            self._near[0] = pair
            if self._compute(1):
                return

    def _compute(self, count: int) -> bool:
        """Distances of the first pairs of ``_near``; their placements are up to date.

        Returns
        -------
        bool
            Whether iterations failed; what was known of these pairs then stays.
        """
        near, q = self._near, self.robot.q
        if count > MANY * len(self._known):
            pin.computeDistances(self._geometry, self._results)
        else:
            for pair in near[:count].tolist():
                pin.computeDistance(self._geometry, self._results, pair)
        known = self._known, self._lower, self._anchor
        if self._copies:
            self._copy(count)
        failed = self._bounds.take(self._found, q, near, count, *known)
        if not failed:
            return False
        for pair in near[:failed].tolist():
            request = self._results.distanceRequests[pair]
            _set_tolerance(request, COARSE)
            pin.computeDistance(self._geometry, self._results, pair)
            _set_tolerance(request, TOLERANCE)
        if self._copies:
            self._copy(failed)
        return bool(self._bounds.take(self._found, q, near, failed, *known))

    def _copy(self, count: int) -> None:
        """Copy the results of the first pairs of ``_near``, where no view has them."""
        for pair in self._near[:count].tolist():
            self._found[pair] = _result(self._results.distanceResults[pair])

    def _any_way(self, pair: int) -> Vector:
        """Direction from the middle of one shape to that of the other, or any; the middle (6,)."""
        ends = self._geometry.collisionPairs[pair]
        one, other = (self._results.oMg[i].translation for i in (ends.first, ends.second))
        way = other - one
        length = float(np.linalg.norm(way))
        direction = way / length if length > 0.0 else np.array([0.0, 0.0, -1.0])
        return np.concatenate([direction, one])

    def _nearest_pair(self, row: int) -> int:
        start = int(self._starts[row])
        end = start + int(np.count_nonzero(self._row_of == row))
        return start + int(np.argmin(self._lower[start:end]))

    def _add(self, link: str, shape: Shape, added: dict[tuple[str, int], int]) -> int:
        """Index of a link's shape, which many rows may have."""
        key = (link, id(shape))
        if key not in added:
            joint, placement = body_place(self.robot, link)
            added[key] = self._place(f'{link} {len(added)}', joint, shape.moved(placement))
        return added[key]

    def _place(self, name: str, joint: int, shape: Shape) -> int:
        geometry = pin.GeometryObject(name, joint, shape.pose, shape.geometry())
        self._hulls.append(shape.hull())
        return self._geometry.addGeometryObject(geometry)

    def _pair_reach(self, a: int, b: int) -> Vector:
        """Bound (n,) on the derivative of the distance between two shapes.

        A joint moves the one as seen from the other by no more than either is away from its
        axis: the normal's moment about the axis is that of both nearest points.
        """
        joints = [self._geometry.geometryObjects[i].parentJoint for i in (a, b)]
        bounds = []
        for shape, path in ((a, joints), (b, joints[::-1])):
            hull, radius = self._hulls[shape]
            way = joint_path(self.robot.model, *path)
            bounds.append(self.robot.path_reach(way, hull, radius))
            if self._obstacle is not None:
                break
        return np.min(bounds, axis=0)

    def _sides(self, row: Row) -> Vector:
        """For the model's joints whether they move the link (1), the other (-1) or both (0)."""
        model = self.robot.model
        start = body_place(self.robot, row.link)[0]
        end = 0 if row.other is None else body_place(self.robot, row.other)[0]
        sides = np.zeros(model.nv)
        for joint, up in joint_path(model, start, end):
            first = model.joints[joint].idx_v
            sides[first : first + model.joints[joint].nv] = 1.0 if up else -1.0
        return sides


class _Memory:
    """Numbers that another library keeps, as an array."""

    def __init__(self, owner: object, address: int, shape: tuple[int, int], step: int) -> None:
        self._owner = owner  # goes on to live as long as the array
        self.__array_interface__ = {
            'version': 3,
            'typestr': '<f8',
            'data': (address, True),
            'shape': shape,
            'strides': (step, 8),
        }


def _view(robot: Robot, geometry: pin.GeometryModel, results: pin.GeometryData) -> Matrix | None:
    """View (p, 10) of the results where coal keeps them; None if it keeps them in another way."""
    found, last = results.distanceResults, len(results.distanceResults) - 1
    normal = found[0].normal
    address = normal.__array_interface__['data'][0]
    if last and found[last].normal.__array_interface__['data'][0] != address + last * RESULT:
        return None
    view = np.asarray(_Memory(results, address - 8, (last + 1, 10), RESULT))
    pin.updateGeometryPlacements(robot.model, robot.data, geometry, results)
    for pair in {0, last}:
        pin.computeDistance(geometry, results, pair)
        if not np.array_equal(view[pair], _result(found[pair]), equal_nan=True):
            return None
    return view


def _result(result: coal.DistanceResult) -> Vector:
    """Distance, normal and nearest points (10,) of a result."""
    ends = result.getNearestPoint1(), result.getNearestPoint2()
    return np.concatenate([[result.min_distance], result.normal, *ends])


def _set_tolerance(request: coal.DistanceRequest, value: float) -> None:
    request.gjk_tolerance = request.epa_tolerance = value


def _start_afresh(request: coal.DistanceRequest) -> None:
    """Let no iterations start from where those before have ended: same state, same distance."""
    with warnings.catch_warnings():
        # coal's newer setting does not switch this one off.
        warnings.simplefilter('ignore', DeprecationWarning)
        request.enable_cached_gjk_guess = False
