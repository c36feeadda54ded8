"""Install tp_sim; name, version and people are read from package.xml."""

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
    package_data={'tp_sim.harness': ['discovery.xml']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{name}']),
        (f'share/{name}', ['package.xml']),
        (f'share/{name}/launch', ['launch/simulation.launch.py']),
        (f'share/{name}/rviz', ['rviz/controller.rviz']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['hypothesis', 'pytest', 'pytest-timeout']},
    zip_safe=True,
    entry_points={
        'console_scripts': [
            'simulator = tp_sim.simulator_main:main',
            'compare = tp_sim.compare:main',
            'stress = tp_sim.stress:main',
            'demo = tp_sim.demo.main:main',
            'faults = tp_sim.faults.main:main',
            'live = tp_sim.live:main',
            'description = tp_sim.description_main:main',
        ],
    },
)
