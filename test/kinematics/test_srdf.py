"""Pairs of links that an SRDF leaves out of self_collision."""

import pytest
from planar_config import changed

from tp_controller import InvalidValue
from tp_controller.config import build_settings
from tp_controller.robot.srdf import disabled_pairs

SHARE = 'package://example-robot-data/robots'
LINKS = ('base', 'link_1', 'link_2', 'link_3')


def pairs_of(tmp_path, inside):
    path = tmp_path / 'arm.srdf'
    path.write_text(f'<robot name="arm">{inside}</robot>')
    found = disabled_pairs(str(path), LINKS)
    return {' '.join(sorted(pair)) for pair in found}


def pair(tag, one, other):
    return f'<{tag} link1="{one}" link2="{other}" reason="Never"/>'


def test_the_ur5_of_the_robot_data_is_quiet_about_what_its_srdf_disables():
    robot = {'urdf': f'{SHARE}/ur_description/urdf/ur5_robot.urdf'}
    parameters = {
        'rate': 125.0,
        'robot': robot,
        'hierarchy': ['self'],
        'tasks': {'self': {'type': 'self_collision'}},
    }
    every = build_settings(parameters).stack.tasks['self'].components
    robot['srdf'] = f'{SHARE}/ur_description/srdf/ur5.srdf'
    settings = build_settings(parameters)
    assert 'base_link - upper_arm_link' in every
    left = settings.stack.tasks['self'].components
    assert 'base_link - upper_arm_link' not in left
    assert 0 < len(left) < len(every)
    parameters['tasks']['self']['pairs'] = ['base_link upper_arm_link']
    named = build_settings(parameters).stack.tasks['self'].components
    assert named == ('base_link - upper_arm_link',)


def test_default_collisions_of_a_link_are_disabled_but_for_those_enabled(tmp_path):
    found = pairs_of(
        tmp_path,
        '<disable_default_collisions link="link_3"/>'
        + pair('enable_collisions', 'link_1', 'link_3')
        + pair('disable_collisions', 'base', 'link_2')
        + pair('disable_collisions', 'link_1', 'finger'),
    )
    assert found == {'base link_3', 'link_2 link_3', 'base link_2', 'finger link_1'}


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('<robot', r'malformed XML'),
        ('', r'malformed XML'),
        ('<sdf/>', r'got a document <sdf>; accepts an SRDF'),
        ('<robot><disable_collisions link1="link_1"/></robot>', r'without link2'),
        (f'<robot>{pair("disable_collisions", "link_1", "link_1")}</robot>', r'of one link'),
        ('<robot><joint><parent/></joint></robot>', r'got a URDF'),
        (f'<robot>{pair("disable_collisions", "a", "b")}</robot>', r"links such as 'a'"),
        (None, r'No such file'),
    ],
)
def test_what_is_no_srdf_of_the_robot_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / 'arm.srdf'
    if text is not None:
        path.write_text(text)
    with pytest.raises(InvalidValue, match=message) as caught:
        build_settings(changed({'robot.srdf': str(path)}))
    assert str(caught.value).startswith('robot.srdf: got ')
    assert '\n' not in str(caught.value)
    with pytest.raises(InvalidValue, match=r'^robot.srdf: got the package'):
        build_settings(changed({'robot.srdf': 'package://nothing/arm.srdf'}))
