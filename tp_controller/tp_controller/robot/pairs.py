"""Which links keep clear of an obstacle, and which of each other."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import combinations

import pinocchio as pin

from tp_controller.errors import NO_VALUE, InvalidValue, listed, shown
from tp_controller.robot.bodies import Bodies, body_place
from tp_controller.robot.collision import Clearance, Row
from tp_controller.robot.model import Robot
from tp_controller.robot.reach import joint_path
from tp_controller.robot.shapes import Shape


def obstacle_clearance(
    robot: Robot, bodies: Bodies, obstacle: Shape, links: Sequence[str] | None = None
) -> Clearance:
    """Clearance of links from an obstacle.

    One row per link, and unless the obstacle is a sphere, one per end of its capsules.

    Parameters
    ----------
    robot
        The robot.
    bodies
        The shapes of its links.
    obstacle
        The obstacle, at its pose in the base frame.
    links
        The links; those with a shape that any joint moves when left out.

    Raises
    ------
    InvalidValue
        If a link has no shape, or none is left.
    """
    if links is None:
        links = [link for link in bodies if body_place(robot, link)[0] > 0]
    _check_links('links', links, bodies)
    if not links:
        raise InvalidValue(
            'links', f'{NO_VALUE} for any link', 'robot.link_radius, or robot.capsules of a link'
        )
    rows = [row for link in links for row in _rows(link, bodies[link], obstacle)]
    return Clearance(robot, rows, obstacle)


def _rows(link: str, shapes: tuple[Shape, ...], obstacle: Shape) -> Iterator[Row]:
    """Rows of a link: its shapes together, and the ends of capsules where these may take turns.

    Along a flat obstacle now the one end of a capsule is nearest and now the other: what holds
    the one back says nothing of the other.
    """
    curved = obstacle.kind == 'sphere'
    ends = {} if curved else {i: shape.ends() for i, shape in enumerate(shapes) if shape.ends()}
    # A capsule is as far from a plane as the nearer of its ends.
    flat = obstacle.kind == 'half_space'
    whole = tuple(shape for i, shape in enumerate(shapes) if not (flat and i in ends))
    if whole:
        yield Row(link, link, whole)
    for number, pair in enumerate(ends.values()):
        which = f' {number + 1}' if len(ends) > 1 else ''
        for word, end in zip(('start', 'end'), pair, strict=True):
            yield Row(f'{link}{which} {word}', link, (end,))


def self_clearance(
    robot: Robot,
    bodies: Bodies,
    pairs: Sequence[tuple[str, str]] | None = None,
    ignore: Collection[tuple[str, str]] = (),
) -> Clearance:
    """Clearance of links from each other, one row per pair.

    Parameters
    ----------
    robot
        The robot.
    bodies
        The shapes of its links.
    pairs
        The pairs of links; `link_pairs` without those that the robot has disabled when left
        out.
    ignore
        Pairs that are left out, in either order.

    Raises
    ------
    InvalidValue
        If a link has no shape, no joint is between two links, or no pair is left.
    """
    for key, given in (('pairs', pairs or ()), ('ignore', ignore)):
        for pair in given:
            _check_links(key, pair, bodies)
            if not joint_path(robot.model, *(body_place(robot, link)[0] for link in pair)):
                raise InvalidValue(key, shown(' '.join(pair)), 'links with a joint in between')
    left_out = {frozenset(pair) for pair in ignore}
    if pairs is None:
        chosen: Sequence[tuple[str, str]] = link_pairs(robot, bodies)
        left_out |= robot.disabled_pairs
    else:
        chosen = pairs
    rows = [
        Row(f'{a} - {b}', a, bodies[a], b, bodies[b])
        for a, b in chosen
        if frozenset((a, b)) not in left_out
    ]
    if not rows:
        raise InvalidValue('pairs', NO_VALUE, 'two links that are not neighbours, with shapes')
    return Clearance(robot, rows)


def link_pairs(robot: Robot, bodies: Bodies) -> list[tuple[str, str]]:
    """Pairs of links that may come near: with another link that has a shape in between.

    Neighbours always touch, and so may links between which there are only joints.
    """
    joints = {link: body_place(robot, link)[0] for link in bodies}
    pairs = []
    for a, b in combinations(bodies, 2):
        passed = _links_between(robot.model, joints[a], joints[b])
        if any(joint in passed for joint in joints.values()):
            pairs.append((a, b))
    return pairs


def _links_between(model: pin.Model, start: int, end: int) -> set[int]:
    """Joints whose links are passed on the way between the links of two others."""
    passed = {start, end}
    for joint, _ in joint_path(model, start, end):
        passed |= {joint, model.parents[joint]}
    return passed - {start, end}


def _check_links(key: str, links: Sequence[str], bodies: Bodies) -> None:
    for link in links:
        if link not in bodies:
            raise InvalidValue(key, shown(link), f'links with a shape: {listed(bodies)}')
