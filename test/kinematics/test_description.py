"""URDFs made of Denavit-Hartenberg parameters, read back by the library's own reader."""

import math
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import arms, examples, states
from references import dh_poses
from urdf_reference import poses

from tp_controller import InvalidValue
from tp_controller.robot import (
    DHParameters,
    Limits,
    dh_description,
    dh_robot,
    same_description,
    urdf_robot,
)

# Names that the description would choose for links and joints of its own.
NAMES = ['base', 'world', 'link_1_start', 'link_1_start_', 'link_1_end', 'link_2_end', 'a&<"b']


@st.composite
def arguments(draw):
    """Joints, parameters, base frame and limits of an arm, and a configuration."""
    block = draw(arms())
    n = len(block['joints'])
    joints = draw(st.permutations([*NAMES, *block['joints']]))[:n]
    given = {}
    if draw(st.booleans()):
        given['velocity'] = draw(st.lists(st.floats(0.1, 9.0), min_size=n, max_size=n))
    if draw(st.booleans()):
        given['position_min'] = draw(st.lists(st.floats(-9.0, 0.0), min_size=n, max_size=n))
    if draw(st.booleans()):
        given['position_max'] = draw(st.lists(st.floats(0.1, 9.0), min_size=n, max_size=n))
    arm = (joints, DHParameters(**block['dh']), draw(st.sampled_from(NAMES)), Limits(n, **given))
    return arm, draw(states(n))


@given(arguments())
@examples(150)
def test_a_dh_arm_and_its_description_are_the_same_robot(case):
    arm, q = case
    expected, found = dh_robot(*arm), urdf_robot(dh_description(*arm))
    assert found.joints == expected.joints
    assert found.base_frame == expected.base_frame
    expected.update(q)
    found.update(q)
    for name in expected.frames:
        frame, same = expected.frame(name), found.frame(name)
        np.testing.assert_allclose(same.position, frame.position, atol=1e-9)
        np.testing.assert_allclose(same.rotation, frame.rotation, atol=1e-9)
        np.testing.assert_allclose(same.jacobian, frame.jacobian, atol=1e-9)


@given(arguments())
@examples(60)
def test_an_independent_reader_finds_the_product_of_the_dh_matrices(case):
    (joints, dh, _, limits), q = case
    found = poses(dh_description(joints, dh, 'link_0', limits), dict(zip(joints, q, strict=True)))
    for i, expected in enumerate(dh_poses(dh._asdict(), q)):
        np.testing.assert_allclose(found[f'link_{i + 1}'], expected, atol=1e-9)


@given(arguments())
@examples(60)
def test_limits_survive_the_description_and_absent_ones_stay_absent(case):
    arm, _ = case
    expected, found = dh_robot(*arm).limits, urdf_robot(dh_description(*arm)).limits
    for key in ('velocity', 'position_min', 'position_max'):
        np.testing.assert_array_equal(getattr(found, key), getattr(expected, key))


@given(arguments())
@examples(60)
def test_documents_have_what_other_tools_ask_for(case):
    """What urdfdom refuses else: limits with effort and velocity, materials that exist."""
    arm, _ = case
    text = dh_description(*arm)
    model = pin.buildModelFromXML(text)
    assert set(model.names) == {'universe', *arm[0]}
    document = ElementTree.fromstring(text)
    for joint in document.findall('joint'):
        if joint.get('type') == 'fixed':
            continue
        limit = {key: float(value) for key, value in joint.find('limit').items()}
        assert {'effort', 'velocity'} <= set(limit)
        assert joint.get('type') == 'continuous' or limit['lower'] < limit['upper']
    materials = {material.get('name') for material in document.findall('material')}
    for visual in document.iter('visual'):
        assert visual.find('material').get('name') in materials
        (shape,) = visual.find('geometry')
        assert shape.tag in ('cylinder', 'box')
        sizes = [float(word) for value in shape.attrib.values() for word in value.split()]
        assert all(size > 0.0 for size in sizes)


def test_only_a_revolute_joint_without_position_limits_is_continuous():
    zeros = [0.0] * 4
    types = ['revolute', 'prismatic', 'revolute', 'revolute']
    text = dh_description(['a', 'b', 'c', 'd'], DHParameters(zeros, zeros, zeros, zeros, types))
    kinds = [joint.get('type') for joint in ElementTree.fromstring(text).findall('joint')]
    assert [kind for kind in kinds if kind != 'fixed'] == [
        'continuous',
        'prismatic',
        'continuous',
        'continuous',
    ]
    robot = urdf_robot(text)
    assert robot.wrapping == (True, False, True, True)


def test_bars_lie_along_the_links():
    zeros, half = [0.0] * 2, math.pi / 2
    dh = DHParameters(zeros, [0.4, 0.0], [0.3, 0.5], [half, 0.0], ['revolute'] * 2)
    document = ElementTree.fromstring(dh_description(['a', 'b'], dh))
    found = {}
    for link in document.findall('link'):
        for visual in link.findall('visual'):
            shape = visual.find('geometry')[0]
            if visual.find('material').get('name') == 'bar':
                origin = visual.find('origin')
                xyz, rpy = ([float(w) for w in origin.get(k).split()] for k in ('xyz', 'rpy'))
                found[link.get('name')] = (xyz, rpy, float(shape.get('length')))
    assert set(found) == {'link_1_start', 'link_2_start'}
    xyz, rpy, length = found['link_1_start']
    assert xyz == pytest.approx([0.15, 0.0, 0.2])
    assert rpy == pytest.approx([0.0, math.atan2(0.3, 0.4), 0.0])
    assert length == pytest.approx(0.5)


def test_parameters_that_are_no_arm_are_refused_as_by_the_robot():
    dh = DHParameters([0.0], [0.0], [1.0, 2.0], [0.0], ['revolute'])
    with pytest.raises(InvalidValue) as error:
        dh_description(['a'], dh)
    assert error.value.key == 'robot.dh.a'


def test_white_space_makes_no_other_description():
    text = dh_description(['a'], DHParameters([0.0], [0.0], [1.0], [0.0], ['revolute']))
    assert same_description(text, ' '.join(text.split('\n')))
    assert not same_description(text, text.replace('"a"', '"b"'))
    assert not same_description(text, text[:-9])
    assert same_description('', '')
