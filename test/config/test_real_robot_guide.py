"""The files in the guide to a real robot are ones that can be used."""

import re

import yaml

from tp_controller.config import build_settings, read_parameter_file
from tp_controller.robot import read_description

URDF = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'


def test_the_parameter_file_of_the_guide_and_that_of_ros2_control_go_together(
    repository, tmp_path
):
    text = (repository / 'docs' / 'real_robot.md').read_text()
    own, control = re.findall(r'```yaml\n(.*?)```', text, re.DOTALL)
    path = tmp_path / 'my_arm.yaml'
    path.write_text(own)
    values = build_settings(
        read_parameter_file(path, 'tp_controller'), read_description(URDF)
    ).values
    control = yaml.safe_load(control)
    assert control['controller_manager']['ros__parameters']['update_rate'] == values['rate']
    for kind in ('velocity', 'position'):
        controller = control[f'{kind}_controller']['ros__parameters']
        assert controller['interface_name'] == kind
        assert tuple(controller['joints']) == tuple(values['robot.joints'])
