"""Make the CMake exports of the ROS wheels usable on this machine.

The wheels record the include folders of the machine that built them:
`<build python>/include/pythonX.Y` and `<build python>/.../numpy/_core/include`.
CMake refuses targets whose include folders do not exist, so every message package
that depends on another one fails to configure. This script puts this machine's
folders in their place. Run it with the python that the wheels are installed in;
a second run finds nothing left to do.
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy as np

BUILD_MACHINE = r'/[\w./-]+/cp\d+-cp\d+'


def patch(share: Path) -> int:
    """Rewrite the exports below `share`; return how many files changed."""
    replacements = [
        (re.compile(BUILD_MACHINE + r'/include/python[\d.]+'), sysconfig.get_path('include')),
        (
            re.compile(BUILD_MACHINE + r'/lib/python[\d.]+/site-packages/numpy/_?core/include'),
            np.get_include(),
        ),
    ]
    changed = 0
    for path in sorted(share.glob('*/cmake/*.cmake')):
        original = text = path.read_text(encoding='utf-8')
        for pattern, folder in replacements:
            text = pattern.sub(lambda _, folder=folder: folder, text)
        if text != original:
            path.write_text(text, encoding='utf-8')
            changed += 1
    return changed


if __name__ == '__main__':
    if sys.prefix == sys.base_prefix:
        sys.exit('patch_ros_wheels.py: run this with the python of the virtual environment.')
    print(f'{patch(Path(sys.prefix) / "share")} CMake exports of the ROS wheels corrected')
