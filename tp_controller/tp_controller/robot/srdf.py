"""Which links need not be kept apart, out of an SRDF as MoveIt's setup assistant writes it."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations
from xml.etree import ElementTree

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.package_files import place_of

SRDF = 'robot.srdf'

Pairs = frozenset[frozenset[str]]
"""Pairs of links, by name and without an order."""


def disabled_pairs(path: str, links: Collection[str]) -> Pairs:
    """Pairs of links whose collisions an SRDF switches off.

    Those of ``<disable_collisions link1 link2>``, and all of a link with
    ``<disable_default_collisions link>``, except for those of ``<enable_collisions link1
    link2>``. Links that the robot does not have are no reason to refuse: one SRDF often serves
    robots with several hands.

    Parameters
    ----------
    path
        A path, or ``package://<package>/<path>``, see `place_of`.
    links
        Names of the robot's links.

    Raises
    ------
    InvalidValue
        If there is no such file, it is not an SRDF, or none of the links that it names is one
        of the robot's.
    """
    root = _read(path)
    off = {_pair(element) for element in root.findall('disable_collisions')}
    on = {_pair(element) for element in root.findall('enable_collisions')}
    alone = {_name(element, 'link') for element in root.findall('disable_default_collisions')}
    named = alone.union(*off, *on)
    if named and not named & set(links):
        raise InvalidValue(SRDF, f'links such as {shown(min(named))}', f'some of {listed(links)}')
    default = {frozenset(pair) for pair in combinations(links, 2) if alone & set(pair)}
    return frozenset((default - on) | off)


def _read(path: str) -> ElementTree.Element:
    """Root element of an SRDF."""
    try:
        text = place_of(path).read_bytes()
    except InvalidValue as error:
        raise InvalidValue(SRDF, error.got, error.accepts) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or 'no path'
        raise InvalidValue(SRDF, f'{shown(path)} ({reason})', 'a readable SRDF file') from None
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InvalidValue(SRDF, f'malformed XML ({error})', 'an SRDF') from None
    if root.tag != 'robot':
        raise InvalidValue(SRDF, f'a document <{root.tag}>', 'an SRDF, <robot>')
    if root.find('joint/parent') is not None:
        raise InvalidValue(SRDF, 'a URDF', 'an SRDF, which has <disable_collisions>')
    return root


def _pair(element: ElementTree.Element) -> frozenset[str]:
    names = frozenset(_name(element, key) for key in ('link1', 'link2'))
    if len(names) != 2:
        raise InvalidValue(SRDF, f'{_tag(element)} of one link', 'link1 and link2, two links')
    return names


def _name(element: ElementTree.Element, key: str) -> str:
    name = element.get(key)
    if not name:
        raise InvalidValue(SRDF, f'{_tag(element)} without {key}', 'the name of a link')
    return name


def _tag(element: ElementTree.Element) -> str:
    given = ' '.join(f'{key}="{value}"' for key, value in element.attrib.items())
    return shown(f'<{element.tag} {given}>')
