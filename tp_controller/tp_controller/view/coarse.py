"""Meshes with fewer triangles, for browsers that draw without a graphics card."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import fast_simplification
import numpy as np
import trimesh
from numpy.typing import NDArray

TRIANGLES = 12_000
"""Triangles of all links together, about."""
LEAST = 60
"""Meshes with no more triangles stay as they are."""
CREASE = 40.0
"""Angle [deg] between neighbouring triangles from which an edge is sharp."""
CHANGE = 0.1
"""Share of its area that a mesh may win or lose."""
CARE = 3.0
"""How slowly the library proceeds; a small number keeps shapes better."""

Points = NDArray[np.float64]
Faces = NDArray[np.int64]


def coarse_scenes(scenes: Sequence[trimesh.Scene]) -> list[trimesh.Scene]:
    """Scenes with about `TRIANGLES` triangles in all, with more if meshes would lose their shape.

    Every mesh gets a share by the square root of its area. Meshes of one material become one.
    Meshes with textures, or with colors of single vertices, stay as they are.
    """
    meshes = [_meshes(scene) for scene in scenes]
    whole = sum(float(mesh.area) ** 0.5 for found in meshes for mesh in found)
    coarse = []
    for found in meshes:
        groups: dict[object, list[trimesh.Trimesh]] = {}
        for mesh in found:
            target = int(TRIANGLES * float(mesh.area) ** 0.5 / whole) if whole else 0
            key = _material(mesh)
            if key is None:
                groups[id(mesh)] = [mesh]
            else:
                groups.setdefault(key, []).append(_simplified(mesh, max(target, LEAST)))
        scene = trimesh.Scene()
        for same in groups.values():
            scene.add_geometry(_joined(same))
        coarse.append(scene)
    return coarse


def _meshes(scene: trimesh.Scene) -> list[trimesh.Trimesh]:
    """Meshes of a scene where they are in it."""
    found = scene.dump()
    return [mesh for mesh in found if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]


def _material(mesh: trimesh.Trimesh) -> object | None:
    """What meshes have in common that look the same; None if more than that decides on it."""
    visual: Any = mesh.visual
    if visual.kind is None or not visual.defined:
        return ''
    if visual.kind != 'texture':
        return None
    material = visual.material
    kinds = ('image', 'baseColorTexture', 'metallicRoughnessTexture', 'normalTexture')
    if any(getattr(material, kind, None) is not None for kind in kinds):
        return None
    return hash(material)


def _simplified(mesh: trimesh.Trimesh, target: int) -> trimesh.Trimesh:
    """The mesh with about `target` triangles, with more if it would lose its shape."""
    welded = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    welded.merge_vertices()
    area = float(mesh.area)
    simple = welded
    while target < len(welded.faces):
        points, faces = welded.vertices.astype(np.float32), welded.faces.astype(np.int32)
        found = fast_simplification.simplify(points, faces, target_count=target, agg=CARE)
        simple = trimesh.Trimesh(found[0], found[1], process=False)
        if abs(float(simple.area) - area) < CHANGE * area:
            break
        target, simple = 2 * target, welded
    vertices, normals, corners = creased(simple.vertices, simple.faces)
    made = trimesh.Trimesh(vertices, corners, vertex_normals=normals, process=False)
    _paint_like(made, mesh)
    return made


def _joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Meshes of one material as one."""
    if len(meshes) == 1:
        return meshes[0]
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    joined = trimesh.Trimesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + i for mesh, i in zip(meshes, before, strict=False)]),
        vertex_normals=np.concatenate([mesh.vertex_normals for mesh in meshes]),
        process=False,
    )
    _paint_like(joined, meshes[0])
    return joined


def _paint_like(mesh: trimesh.Trimesh, other: trimesh.Trimesh) -> None:
    look: Any = other.visual
    if look.kind == 'texture':
        mesh.visual = trimesh.visual.TextureVisuals(  # type: ignore[no-untyped-call]
            material=look.material
        )


def creased(points: Points, faces: Faces) -> tuple[Points, Points, Faces]:
    """Vertices with normals that are smooth, except at edges sharper than `CREASE`.

    Parameters
    ----------
    points
        Vertices (v, 3) [m].
    faces
        Triangles (f, 3), indices of vertices.

    Returns
    -------
    tuple
        Vertices (w, 3), of which each is there once for every normal, normals (w, 3), and
        triangles (f, 3).
    """
    edges = points[faces]
    across = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    unit = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    corner = faces.ravel()
    # Every corner of a triangle meets all corners at its vertex.
    order = np.argsort(corner, kind='stable')
    first = np.searchsorted(corner[order], np.arange(len(points) + 1))
    count = np.diff(first)[corner]
    own = np.repeat(np.arange(len(corner)), count)
    place = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count)
    other = order[np.repeat(first[corner], count) + place]
    smooth = np.sum(unit[own // 3] * unit[other // 3], axis=1) > np.cos(np.radians(CREASE))
    smooth |= own == other
    normals = np.zeros((len(corner), 3))
    np.add.at(normals, own[smooth], across[other[smooth] // 3])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    key = np.column_stack([corner, np.round(64.0 * normals).astype(np.int64)])
    _, kept, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return points[corner[kept]], normals[kept], index.reshape(-1, 3)
