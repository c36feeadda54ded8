#!/usr/bin/env bash
# Opens the notebooks of the course in JupyterLab; installs that into .venv at the first call.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Versions of what is there already stay as they are.
constraints=.venv/constraints.txt
[ -e "$constraints" ] || constraints=requirements/lock.txt
if ! .venv/bin/python -c 'import ipywidgets, jupyterlab' 2>/dev/null; then
  echo 'course: installing JupyterLab into .venv (about a minute)'
  .venv/bin/pip install --quiet -r course/requirements.txt -c "$constraints"
fi
source ./setup.bash
exec python -m jupyterlab course "$@"
