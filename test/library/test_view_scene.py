"""What the page draws: meshes with fewer triangles, the ground, and what is moved."""

import contextlib
import io
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from tp_controller import Robot
from tp_controller.view.arm import ArmPicture
from tp_controller.view.coarse import TRIANGLES, coarse_scenes, creased
from tp_controller.view.ground import grid_lines
from tp_controller.view.page import Page
from tp_controller.view.site import SCRIPT, SiteServer
from tp_controller.view.visuals import Visual, visuals

URDF = """<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material>
<link name="base"><visual><geometry><sphere radius="0.2"/></geometry></visual>
<visual><material name="red"/><geometry><box size="1 2 3"/></geometry></visual></link></robot>"""


def scene_of(*meshes):
    scene = trimesh.Scene()
    for mesh in meshes:
        scene.add_geometry(mesh)
    return scene


def faces_of(scene):
    return sum(len(mesh.faces) for mesh in scene.geometry.values())


def test_meshes_of_many_triangles_get_fewer_and_keep_their_shape():
    ball = trimesh.creation.icosphere(6, 0.1)
    (coarse,) = coarse_scenes([scene_of(ball)])
    assert len(ball.faces) > 6 * TRIANGLES
    assert faces_of(coarse) == pytest.approx(TRIANGLES, rel=0.1)
    (simple,) = coarse.geometry.values()
    assert simple.area == pytest.approx(ball.area, rel=0.01)
    outward = simple.vertices / np.linalg.norm(simple.vertices, axis=1, keepdims=True)
    assert np.quantile(np.sum(outward * simple.vertex_normals, axis=1), 0.01) > 0.99


def test_a_flat_part_of_few_triangles_stays():
    # A decimation without a check takes such a part away.
    plate = trimesh.creation.box((0.1, 0.1, 1e-4)).subdivide_loop(1)
    parts = [trimesh.creation.icosphere(6, 0.1), plate]
    (coarse,) = coarse_scenes([scene_of(*parts)])
    (joined,) = coarse.geometry.values()
    assert joined.area == pytest.approx(sum(part.area for part in parts), rel=0.02)


def test_parts_with_colors_of_vertices_stay_as_they_are():
    ball = trimesh.creation.icosphere(6, 0.1)
    ball.visual.vertex_colors = np.arange(4 * len(ball.vertices)).reshape(-1, 4) % 255
    (coarse,) = coarse_scenes([scene_of(ball)])
    assert faces_of(coarse) == len(ball.faces)


def test_normals_are_smooth_except_at_sharp_edges():
    box = trimesh.creation.box()
    vertices, normals, faces = creased(np.array(box.vertices), np.array(box.faces))
    assert len(vertices) == 24
    assert np.allclose(np.sort(np.abs(normals)), [[0.0, 0.0, 1.0]] * 24)
    assert np.allclose(vertices[faces], box.vertices[box.faces])
    ball = trimesh.creation.icosphere(3, 1.0)
    vertices, normals, _ = creased(np.array(ball.vertices), np.array(ball.faces))
    assert len(vertices) == len(ball.vertices)
    assert np.allclose(normals, vertices, atol=0.02)


def test_visuals_have_their_color_and_all_triangles_on_request():
    found = visuals(URDF)
    assert [visual.link for visual in found] == ['base', 'base']
    for visual, faces in zip(found, (1280, 12), strict=True):
        for glb in (visual.glb, visual.fine):
            scene = trimesh.load_scene(io.BytesIO(glb), file_type='glb')
            assert faces_of(scene) == faces
    (box,) = scene.geometry.values()
    assert list(box.visual.material.main_color) == [255, 0, 0, 255]


def test_ground_lines_cross_at_the_origin_and_leave_room_for_strong_ones():
    strong, thin = grid_lines(1.0, 0.5), grid_lines(1.0, 0.1, 0.5)
    assert len(strong) == 10
    assert len(thin) == 2 * 21 - len(strong)
    ends = np.concatenate([strong, thin])
    assert np.allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 2.0)
    assert np.allclose(np.abs(ends).max(axis=(1, 2)), 1.0)


def test_corners_of_the_skeleton_are_there_once():
    robot = Robot.from_dh([0.0, 0.5, 0.5], types=['prismatic', 'revolute', 'revolute'])
    robot.update(np.array([0.3, 0.0, 0.0]))
    segments, corners = robot.segments(), robot.corners()
    assert len(corners) == len(segments) + 1
    for end in segments.reshape(-1, 3):
        assert np.any(np.all(np.isclose(corners, end), axis=1))


def test_what_is_hidden_is_moved_when_it_is_shown():
    robot = Robot.from_dh([0.5, 0.5])
    with contextlib.closing(Page(port=0)) as page:
        arm = ArmPicture(page.server.scene, robot)
        glb = scene_of(trimesh.creation.box()).export(file_type='glb')
        arm.add_visual(Visual('link_1', pin.SE3.Identity(), glb, glb))
        before = arm._balls[-1].position.copy()
        robot.update(np.array([1.0, 0.5]))
        arm.follow()
        assert np.allclose(arm._balls[-1].position, before)
        arm.show(False, False, False)
        arm.follow()
        assert np.allclose(arm._balls[-1].position, robot.frame('link_2').position)
        assert not arm._fine
        arm.show(True, True, False)
        assert [handle.visible for handle in (*arm._visuals, *arm._fine)] == [False, True]


def test_the_page_has_its_script_first_and_leaves_no_folder():
    with contextlib.closing(Page(port=0)) as page:
        server = page.server._websock_server
        assert isinstance(server, SiteServer)
        folder = server.site.name
        text = (Path(folder) / 'index.html').read_text(encoding='utf-8')
        assert f'<head>{SCRIPT}' in text
    assert not Path(folder).exists()
