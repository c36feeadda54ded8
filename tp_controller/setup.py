"""Install tp_controller; name, version and people are read from package.xml.

colcon installs all of it. A wheel (``pip install ./tp_controller``) is the library alone: the
ROS node, its executables and ROS's index of packages are left out, and pip gets the list of
what the library needs. On a ROS machine these come from rosdep; colcon has pip fetch nothing.
"""

import atexit
import shutil
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

manifest = ElementTree.parse('package.xml').getroot()
name = manifest.findtext('name')
maintainer = manifest.find('maintainer')

# What build front ends such as pip run; colcon runs others.
FOR_PIP = ('bdist_wheel', 'dist_info', 'editable_wheel', 'sdist')
for_pip = any(command in sys.argv for command in FOR_PIP)

options = {}
if for_pip:
    # Nothing of an older build gets into a wheel, and nothing is left beside the sources.
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    options = {'build': {'build_base': folder}}

REQUIREMENTS = [
    'coal',  # distances between shapes
    'daqp',  # active sets of the scheme hqp
    'numba',
    'numpy',
    'pin>=3',  # Pinocchio
    'PyYAML',
]
EXTRAS = {
    'around': ['ompl>=2'],  # ways around obstacles
    'batch': ['dask[distributed]', 'matplotlib', 'pyarrow<26', 'rich'],
    # recordings and pictures of them, without ROS
    'recordings': ['matplotlib', 'mcap', 'mcap-ros2-support', 'trimesh', 'zstandard'],
    'robots': ['example-robot-data>=4.4'],  # URDFs of real arms
    'test': ['hypothesis', 'pytest', 'pytest-timeout'],
    'view': ['fast-simplification', 'pycollada', 'viser>=1.1,<1.2'],  # the page, without ROS
}

for_ros = {
    'data_files': [
        ('share/ament_index/resource_index/packages', [f'resource/{name}']),
        (f'share/{name}', ['package.xml']),
        (f'share/{name}/launch', ['launch/robot.launch.py']),
        (f'share/{name}/config', sorted(str(path) for path in Path('config').glob('*.yaml'))),
    ],
    'entry_points': {
        'console_scripts': [
            'batch = tp_controller.batch.command:main',
            'check = tp_controller.checks.command:main',
            'controller = tp_controller.ros.controller_main:main',
            'measure_arm = tp_controller.ros.measure_arm:main',
            'plot = tp_controller.plots.command:main',
            'record = tp_controller.ros.record:main',
            'replay = tp_controller.ros.replay:main',
            'send_goal = tp_controller.ros.send_goal:main',
            'solve = tp_controller.planning.command:main',
            'view = tp_controller.ros.view:main',
            'watch = tp_controller.ros.watch:main',
        ],
    },
}

setup(
    name=name,
    version=manifest.findtext('version'),
    description=manifest.findtext('description'),
    license=manifest.findtext('license'),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    python_requires='>=3.10',
    packages=find_packages(
        exclude=['test', 'test.*'] + (['tp_controller.ros', 'tp_controller.ros.*'] * for_pip)
    ),
    package_data={name: ['py.typed']},
    install_requires=REQUIREMENTS if for_pip else ['setuptools'],
    extras_require=EXTRAS,
    zip_safe=False,
    options=options,
    **({} if for_pip else for_ros),
)
