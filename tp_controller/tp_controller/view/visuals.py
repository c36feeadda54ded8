"""What the links of a URDF look like."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import trimesh

from tp_controller.robot.urdf import numbers, place_of

GREY = (0.75, 0.76, 0.78, 1.0)


class Visual(NamedTuple):
    """One visual of a link."""

    link: str
    place: pin.SE3
    """Pose in the link."""
    glb: bytes
    """The mesh with its colors."""


def visuals(description: str) -> Iterator[Visual]:
    """Visuals of a URDF, read one at a time; those that cannot be read are left out."""
    root = ElementTree.fromstring(description)
    colors = {str(material.get('name')): _color(material) for material in root.findall('material')}
    for link in root.findall('link'):
        name = str(link.get('name'))
        for visual in link.findall('visual'):
            # Readers of meshes raise what they like.
            with contextlib.suppress(Exception):
                found = _read(name, visual, colors)
                if found is not None:
                    yield found


def _read(
    link: str, visual: ElementTree.Element, colors: Mapping[str, tuple[float, ...] | None]
) -> Visual | None:
    scene = _scene(link, visual)
    if scene is None:
        return None
    material = visual.find('material')
    if material is not None:
        _paint(scene, _color(material) or colors.get(str(material.get('name'))))
    origin = visual.find('origin')
    xyz, rpy = (
        np.array(numbers(link, '0 0 0' if origin is None else origin.get(key, '0 0 0'), 3))
        for key in ('xyz', 'rpy')
    )
    glb = scene.export(file_type='glb')  # type: ignore[no-untyped-call]
    return Visual(link, pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz), glb)


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
    _paint(mesh.scene(), GREY)
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
