"""Install tp_controller; name, version and people are read from package.xml."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

manifest = ElementTree.parse('package.xml').getroot()
name = manifest.findtext('name')
maintainer = manifest.find('maintainer')

setup(
    name=name,
    version=manifest.findtext('version'),
    description=manifest.findtext('description'),
    license=manifest.findtext('license'),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    packages=find_packages(exclude=['test', 'test.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{name}']),
        (f'share/{name}', ['package.xml']),
        (f'share/{name}/config', sorted(str(path) for path in Path('config').glob('*.yaml'))),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['hypothesis', 'pytest', 'pytest-timeout']},
    zip_safe=True,
    entry_points={
        'console_scripts': [
            'batch = tp_controller.batch.command:main',
            'controller = tp_controller.ros.controller_main:main',
            'measure_arm = tp_controller.ros.measure_arm:main',
            'send_goal = tp_controller.ros.send_goal:main',
        ],
    },
)
