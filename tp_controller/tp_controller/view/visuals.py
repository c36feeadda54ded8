"""What the links of a URDF look like."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import trimesh

from tp_controller.robot.package_files import place_of
from tp_controller.robot.urdf import numbers
from tp_controller.view.coarse import coarse_scenes

GREY = (0.75, 0.76, 0.78, 1.0)


class Visual(NamedTuple):
    """One visual of a link."""

    link: str
    place: pin.SE3
    """Pose in the link."""
    glb: bytes
    """The mesh with its colors, of few triangles."""
    fine: bytes
    """The same with all its triangles."""


class _Look(NamedTuple):
    """One visual as it is read."""

    link: str
    place: pin.SE3
    scene: trimesh.Scene


def visuals(description: str) -> list[Visual]:
    """Visuals of a URDF; those that cannot be read are left out."""
    looks = list(_looks(description))
    scenes = [look.scene for look in looks]
    coarse = scenes
    # Readers and writers of meshes raise what they like.
    with contextlib.suppress(Exception):
        coarse = coarse_scenes(scenes)
    found = []
    for look, simple in zip(looks, coarse, strict=True):
        with contextlib.suppress(Exception):
            found.append(Visual(look.link, look.place, _glb(simple), _glb(look.scene)))
    return found


def _glb(scene: trimesh.Scene) -> bytes:
    return bytes(scene.export(file_type='glb'))  # type: ignore[no-untyped-call]


def _looks(description: str) -> Iterator[_Look]:
    root = ElementTree.fromstring(description)
    colors = {str(material.get('name')): _color(material) for material in root.findall('material')}
    for link in root.findall('link'):
        name = str(link.get('name'))
        for visual in link.findall('visual'):
            with contextlib.suppress(Exception):
                found = _read(name, visual, colors)
                if found is not None:
                    yield found


def _read(
    link: str, visual: ElementTree.Element, colors: Mapping[str, tuple[float, ...] | None]
) -> _Look | None:
    scene = _scene(link, visual)
    if scene is None:
        return None
    material = visual.find('material')
    named = None if material is None else colors.get(str(material.get('name')))
    _paint(scene, (None if material is None else _color(material)) or named or GREY)
    origin = visual.find('origin')
    xyz, rpy = (
        np.array(numbers(link, '0 0 0' if origin is None else origin.get(key, '0 0 0'), 3))
        for key in ('xyz', 'rpy')
    )
    return _Look(link, pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz), scene)


def _scene(link: str, visual: ElementTree.Element) -> trimesh.Scene | None:
    kinds = visual.findall('geometry/*')
    if len(kinds) != 1:
        return None
    element = kinds[0]

    def size(key: str, count: int, default: str = '') -> list[float]:
        return numbers(link, element.get(key, default), count)

    if element.tag == 'mesh':
        path = element.get('filename', '').removeprefix('file://')
        scene = trimesh.load_scene(str(place_of(path)))
        stretch = np.diag([*size('scale', 3, '1 1 1'), 1.0])
        scene.apply_transform(stretch)  # type: ignore[no-untyped-call]
        return scene
    if element.tag == 'box':
        mesh = trimesh.creation.box(size('size', 3))
    elif element.tag == 'sphere':
        mesh = trimesh.creation.icosphere(3, size('radius', 1)[0])
    elif element.tag == 'cylinder':
        mesh = trimesh.creation.cylinder(size('radius', 1)[0], size('length', 1)[0])
    else:
        return None
    return mesh.scene()


def _color(material: ElementTree.Element) -> tuple[float, ...] | None:
    color = material.find('color')
    try:
        return None if color is None else tuple(map(float, color.get('rgba', '').split()))
    except ValueError:
        return None


def _paint(scene: trimesh.Scene, color: tuple[float, ...] | None) -> None:
    """Give meshes without a color of their own this one."""
    if color is None or len(color) != 4:
        return
    for mesh in scene.geometry.values():
        if not mesh.visual.defined or mesh.visual.kind is None:
            material = trimesh.visual.material.PBRMaterial(  # type: ignore[no-untyped-call]
                baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.6
            )
            visual = trimesh.visual.TextureVisuals(material=material)  # type: ignore[no-untyped-call]
            mesh.visual = visual
