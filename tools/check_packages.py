"""Check what the ROS tools do not: that the three packages are described correctly.

colcon treats a package with a broken `package.xml` as plain python without a word, and
nothing in ROS compares imports with dependencies. Prints one line per mistake and exits
with status 1 if there was one.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import yaml
from catkin_pkg.package import InvalidPackage, Package, parse_package

ROOT = Path(__file__).resolve().parent.parent
EXPECTED = {
    'tp_controller': 'ros.ament_python',
    'tp_interfaces': 'ros.ament_cmake',
    'tp_sim': 'ros.ament_python',
}
LICENSE = 'Apache-2.0'
# ROS keys of python modules; every other module has the name of its ROS package.
ROS_KEYS = {
    'matplotlib': 'python3-matplotlib',
    'mpl_toolkits': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'rich': 'python3-rich',
    'yaml': 'python3-yaml',
}
# Modules without a ROS key, which tools/setup.sh installs, and names for mypy alone.
WITHOUT_KEY = {
    'daqp',
    'dask',
    'distributed',
    'fast_simplification',
    'mcap',
    'mcap_ros2',
    'ompl',
    'pyarrow',
    'trimesh',
    'typing_extensions',
    'viser',
    'websockets',
    'zstandard',
}


def check_colcon() -> Iterator[str]:
    """Compare what colcon finds with what there is."""
    command = [sys.executable, '-c', 'from colcon_core.command import main; main()']
    listing = subprocess.run(
        [*command, '--log-base', '/dev/null', 'list', '--base-paths', str(ROOT)],
        capture_output=True,
        text=True,
        check=True,
    )
    found = {}
    for line in listing.stdout.splitlines():
        name, _, build_type = line.split('\t')
        found[name] = build_type.strip('()')
    if found != EXPECTED:
        yield f'colcon list shows {found} instead of {EXPECTED}'


def load_packages() -> tuple[dict[str, Package], list[str]]:
    """Parse and validate every package.xml; warnings count as mistakes."""
    packages: dict[str, Package] = {}
    mistakes: list[str] = []
    for name in EXPECTED:
        path = ROOT / name / 'package.xml'
        try:
            package = parse_package(str(path), warnings=mistakes)
            package.validate(warnings=mistakes)
            packages[name] = package
        except (InvalidPackage, OSError) as error:
            mistakes.append(f'{path.relative_to(ROOT)}: {error}')
    return packages, mistakes


def check_release(packages: dict[str, Package]) -> Iterator[str]:
    """Compare version, license and maintainer of the packages and of the project's papers."""
    versions = {f'{name}/package.xml': package.version for name, package in packages.items()}
    versions['CITATION.cff'] = citation_version()
    versions['CHANGELOG.md'] = changelog_version()
    if len(set(versions.values())) > 1 or None in versions.values():
        yield 'versions differ or are missing: ' + ', '.join(
            f'{place} {version or "none"}' for place, version in versions.items()
        )
    maintainers = {
        name: [(person.name, person.email) for person in package.maintainers]
        for name, package in packages.items()
    }
    if any(people != maintainers['tp_controller'] for people in maintainers.values()):
        yield f'maintainers differ: {maintainers}'
    for name, package in packages.items():
        if package.licenses != [LICENSE]:
            yield f'{name}/package.xml: license {package.licenses} instead of {LICENSE}'


def citation_version() -> str | None:
    """Return the version in CITATION.cff."""
    path = ROOT / 'CITATION.cff'
    content = yaml.safe_load(path.read_text(encoding='utf-8')) if path.exists() else {}
    version = content.get('version')
    return None if version is None else str(version)


def changelog_version() -> str | None:
    """Return the version of the newest entry of CHANGELOG.md: its first heading with a number."""
    path = ROOT / 'CHANGELOG.md'
    text = path.read_text(encoding='utf-8') if path.exists() else ''
    heading = re.search(r'^## .*?(\d+\.\d+\.\d+)', text, re.MULTILINE)
    return heading and heading.group(1)


def check_dependencies(package: Package) -> Iterator[str]:
    """Look for modules that the package imports without declaring them."""
    declared = {depend.name for depend in package.exec_depends} | {package.name}
    for path in sorted((ROOT / package.name / package.name).rglob('*.py')):
        for module in sorted(imported_modules(path) - sys.stdlib_module_names - WITHOUT_KEY):
            key = ROS_KEYS.get(module, module)
            if key not in declared:
                place = path.relative_to(ROOT)
                yield f'{package.name}/package.xml: no exec_depend on {key}, imported by {place}'


def imported_modules(path: Path) -> set[str]:
    """Return the top-level modules that a file imports, relative imports left out."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))):
        if isinstance(node, ast.Import):
            modules.update(alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            modules.add(node.module.partition('.')[0])
    return modules


def main() -> int:
    """Run every check; return the exit status."""
    packages, mistakes = load_packages()
    mistakes += check_colcon()
    if packages.keys() == EXPECTED.keys():
        mistakes += check_release(packages)
    for package in packages.values():
        mistakes += check_dependencies(package)
    for mistake in mistakes:
        print(f'check_packages: {mistake}', file=sys.stderr)
    if not mistakes:
        print(f'{len(packages)} ROS packages are described correctly')
    return 1 if mistakes else 0


if __name__ == '__main__':
    sys.exit(main())
