#!/usr/bin/env bash
# Rewrites requirements/lock.txt with the newest versions that the other requirement files allow.
# Needs `uv` on the PATH; nothing else in this workspace does.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../requirements"

{
  echo '# Every package that a machine without ROS installs. Written by tools/lock.sh.'
  uv pip compile ros.txt colcon.txt runtime.txt dev.txt --quiet --universal --upgrade \
    --python-version 3.10 --no-annotate --no-header | grep -v "sys_platform == 'win32'"
} >lock.new
mv lock.new lock.txt
