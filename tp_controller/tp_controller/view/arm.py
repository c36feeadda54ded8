"""The arm in the scene: its meshes, or a skeleton of cylinders and balls; shapes on request."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import viser

from tp_controller.robot import Robot, Shape, sphere
from tp_controller.robot.shapes import rotation_to
from tp_controller.view.solids import Color, Paint, add_solid, put, wxyz
from tp_controller.view.visuals import Visual

STEEL: Color = (150, 156, 165)
BLUE: Color = (31, 119, 180)
GLASS = Paint(BLUE, 0.3, shadow=False)
WIDTH = 0.045
"""Thickness of the skeleton as a share of its extent."""


class ArmPicture:
    """Draws a robot where it is.

    Parameters
    ----------
    scene
        Where it is drawn.
    robot
        The robot.

    Attributes
    ----------
    robot
        The robot; one that looks the same may take its place.
    """

    def __init__(self, scene: viser.SceneApi, robot: Robot) -> None:
        self._scene, self.robot = scene, robot
        self._links: dict[str, viser.SceneNodeHandle] = {}
        self._visuals: list[viser.SceneNodeHandle] = []
        self._fine: list[viser.SceneNodeHandle] = []
        self._looks: list[Visual] = []
        self._shapes: list[viser.SceneNodeHandle] = []
        self._bones: list[viser.CylinderHandle] = []
        self._balls: list[viser.SceneNodeHandle] = []
        ends = robot.corners()
        self.extent = max(float(np.ptp(ends, axis=0).max()) if len(ends) else 0.0, 0.1)
        """Largest side [m] of a box round the arm as it stood first."""
        self._draw_skeleton()
        self._shown = (True, False, False)
        self.has_shapes = False
        """Whether the shapes of the links are known."""
        self.follow()

    def add_visual(self, visual: Visual) -> None:
        """Show a mesh of a link."""
        self._looks.append(visual)
        self._visuals.append(self._add_mesh(visual, 'visual', visual.glb))
        self.show(*self._shown)

    def add_shapes(self, bodies: Mapping[str, tuple[Shape, ...]]) -> None:
        """Have the shapes of the links."""
        self.has_shapes = True
        for link, shapes in bodies.items():
            for shape in shapes:
                name = f'{self._link(link)}/shape_{len(self._shapes)}'
                handle = add_solid(self._scene, name, shape, GLASS, visible=self._shown[2])
                self._shapes.append(handle)

    def show(self, meshes: bool, fine: bool, shapes: bool) -> None:
        """Choose what is shown: meshes rather than the skeleton where there are any; shapes.

        Parameters
        ----------
        meshes
            Whether meshes are shown.
        fine
            Whether those are shown as they are in their files, not with fewer triangles.
        shapes
            Whether shapes are shown.
        """
        self._shown = (meshes, fine, shapes)
        solid = self._solid
        if solid and fine:
            for visual in self._looks[len(self._fine) :]:
                self._fine.append(self._add_mesh(visual, 'fine', visual.fine))
        for handle in self._visuals:
            handle.visible = solid and not fine
        for handle in self._fine:
            handle.visible = solid and fine
        for handle in (*self._bones, *self._balls):
            handle.visible = not solid
        for handle in self._shapes:
            handle.visible = shapes

    def follow(self) -> None:
        """Move what is shown to where the robot is now."""
        for link, handle in self._links.items():
            put(handle, link_place(self.robot, link))
        if self._solid:
            return
        for (start, end), bone in zip(self.robot.segments(), self._bones, strict=True):
            length = float(np.linalg.norm(end - start))
            turn = rotation_to(end - start) if length > 0.0 else np.eye(3)
            put(bone, pin.SE3(turn, 0.5 * (start + end)))
            if abs(bone.scale[2] - length) > 1e-6:  # type: ignore[index]
                bone.scale = (1.0, 1.0, max(length, 1e-6))
        for place, ball in zip(self.robot.corners(), self._balls, strict=True):
            put(ball, pin.SE3(np.eye(3), place))

    @property
    def _solid(self) -> bool:
        """Whether meshes are in the skeleton's place."""
        return self._shown[0] and bool(self._visuals)

    def _add_mesh(self, visual: Visual, kind: str, glb: bytes) -> viser.SceneNodeHandle:
        name = f'{self._link(visual.link)}/{kind}_{len(self._visuals)}_{len(self._fine)}'
        place = visual.place
        return self._scene.add_glb(
            name, glb, position=place.translation, wxyz=wxyz(place.rotation)
        )

    def _draw_skeleton(self) -> None:
        radius = 0.5 * WIDTH * self.extent
        for i, _ in enumerate(self.robot.segments()):
            bone = self._scene.add_cylinder(f'/arm/bone_{i}', radius, 1.0, color=STEEL)
            bone.scale = (1.0, 1.0, 1e-6)
            self._bones.append(bone)
        self._balls = [
            add_solid(self._scene, f'/arm/joint_{i}', sphere(1.7 * radius), Paint(BLUE))
            for i, _ in enumerate(self.robot.corners())
        ]

    def _link(self, link: str) -> str:
        name = f'/arm/{link}'
        if link not in self._links:
            handle = self._scene.add_frame(name, show_axes=False)
            self._links[link] = handle
            put(handle, link_place(self.robot, link))
        return name


def link_place(robot: Robot, link: str) -> pin.SE3:
    """Present pose of a link, the base's too."""
    frame = robot.base if link not in robot.frames else robot.frame(link)
    return pin.SE3(np.array(frame.rotation), np.array(frame.position))
