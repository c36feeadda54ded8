"""Installs examples/own_task into a folder of its own, without a network."""

import shutil
import subprocess
import sys


def install(repository, folder):
    """Folder to put on the path of Python."""
    source, target = folder / 'source', folder / 'installed'
    shutil.copytree(repository / 'examples' / 'own_task', source)
    command = [sys.executable, '-m', 'pip', 'install', '-q', '--no-index', '--no-deps']
    subprocess.run(
        [*command, '--no-build-isolation', '--target', target, source],
        check=True,
        capture_output=True,
        timeout=60,
    )
    return target
