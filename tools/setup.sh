#!/usr/bin/env bash
# Sets up the workspace: python packages and ROS 2 into .venv, the three ROS packages into install.
# Does nothing when nothing has changed; an interrupted run is picked up by the next one.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

log=log/setup.log

say() { echo "setup: $*"; }

fail() {
  echo "setup: $*" >&2
  exit 1
}

# Run a command with its output in the log; on failure show the end of the log.
logged() {
  echo "+ $*" >>"$log"
  "$@" >>"$log" 2>&1 && return
  tail -n 25 "$log" >&2
  fail "failed: $* (everything it printed: $log)"
}

# `wheels`: ROS 2 comes from the package index; `system`: ROS 2 Jazzy is sourced.
find_ros() {
  case "${ROS_DISTRO:-}" in
    '') echo wheels ;;
    jazzy) echo system ;;
    *) fail "ROS 2 Jazzy is needed, but ROS_DISTRO is $ROS_DISTRO" ;;
  esac
}

# The first python that fits; never the one of a venv, because that may be about to go.
find_python() {
  local probe='
import ensurepip, os, sys, sysconfig, venv
assert (3, 10) <= sys.version_info[:2] < (3, 14)
assert os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h"))
'
  [ "$ros" = wheels ] || probe+='import rclpy'$'\n'
  probe+='print(sys._base_executable)'
  local name
  for name in python3 python3.{12,11,13,10} /usr/bin/python3; do
    if "$name" -c "$probe" 2>/dev/null; then return; fi
  done
}

check_tools() {
  local missing=''
  command -v cmake >/dev/null || missing+=', cmake'
  command -v "${CXX:-c++}" g++ clang++ >/dev/null || missing+=', a C++ compiler (g++)'
  if [ -z "$python" ]; then
    missing+=', python 3.10 to 3.13 with venv and headers (python3-venv, python3-dev)'
    [ "$ros" = wheels ] || missing+=' that can import rclpy'
  fi
  [ -z "$missing" ] || fail "missing: ${missing#, }"
}

# What .venv was made from. The folder counts: a copied workspace needs a venv of its own.
venv_state() {
  echo "$PWD $ros"
  sha256sum requirements/* tools/setup.sh tools/patch_ros_wheels.py
}

# What the build was made from: the names of all files, and the contents of those that are not
# linked into install but generated from, copied or compiled.
packages_state() {
  venv_state
  find config/ tp_* \( -name '.?*' -o -name __pycache__ -o -name '*.egg-info' \) -prune \
    -o -type f -print | LC_ALL=C sort
  find tp_* \( -name package.xml -o -name CMakeLists.txt -o -name 'setup.*' -o -name '*.msg' \
    -o -name '*.srv' -o -name '*.action' \) -type f -exec sha256sum {} + | LC_ALL=C sort
  sha256sum tp_sim/tp_sim/servo.py
  .venv/bin/python tp_controller/tp_controller/compiled.py
  # there after a build with --symlink-install, gone after one without
  echo install/*/lib/python*/site-packages/*.egg-link
}

# Where a package has no wheel, the tools that build it come from the lock file too.
export PIP_CONSTRAINT=requirements/lock.txt PIP_BUILD_CONSTRAINT=requirements/lock.txt

# The whole lock file, in thirds side by side: they share nothing, and pip takes one core only.
install_locked() {
  local part parts=()
  for part in 0 1 2; do
    awk -v part=$part '!/^#/ && NR % 3 == part' requirements/lock.txt >".venv/lock.$part.txt"
    logged .venv/bin/pip install --no-deps --no-compile -r ".venv/lock.$part.txt" &
    parts+=($!)
  done
  for part in "${parts[@]}"; do wait "$part" || exit; done
}

install_wheels() {
  say "installing ROS 2 Jazzy and python packages into .venv (one to two minutes)"
  logged "$python" -m venv .venv
  install_locked
  logged .venv/bin/python tools/patch_ros_wheels.py
  # colcon expects one in every prefix; setup.bash does its work
  echo '# Nothing to do: setup.bash of the workspace sets the environment.' >.venv/local_setup.bash
  cp .venv/local_setup.bash .venv/local_setup.sh
}

# Pinocchio and numpy stay those of the sourced ROS: its message modules need numpy 1.
install_beside_system() {
  say "installing python packages into .venv, beside the ROS 2 Jazzy that is sourced"
  "$python" -c 'import pinocchio' 2>/dev/null ||
    fail 'missing: Pinocchio (apt package ros-jazzy-pinocchio)'
  logged "$python" -m venv --system-site-packages .venv
  grep -vE '^(ros-|numpy=)' requirements/lock.txt >.venv/constraints.txt
  echo 'numpy<2' >>.venv/constraints.txt
  local wanted=(-r requirements/runtime.txt -r requirements/dev.txt)
  if ! "$python" -c 'import colcon_cmake, colcon_ros' 2>/dev/null; then
    wanted+=(-r requirements/colcon.txt)
  fi
  PIP_CONSTRAINT=.venv/constraints.txt logged .venv/bin/pip install --no-compile "${wanted[@]}"
  if [ ! -x .venv/bin/colcon ]; then
    # the system's colcon, run by this python, so that the executables it writes use it too
    printf '#!%s\nimport sys\nfrom colcon_core.command import main\nsys.exit(main())\n' \
      "$PWD/.venv/bin/python" >.venv/bin/colcon
    chmod +x .venv/bin/colcon
  fi
}

make_venv() {
  rm -rf .venv build install
  if [ "$ros" = wheels ]; then install_wheels; else install_beside_system; fi
  # Once and on all cores, not by every node anew where Python may not write beside the sources.
  # Not what no node loads. Some packages carry sources for other Pythons, which cannot be compiled.
  .venv/bin/python -m compileall -q -j 0 -x '/(numba|llvmlite|pip|setuptools|mypy|mypyc|docutils|pygments)/' .venv/lib >>"$log" 2>&1 || true
  echo "$ros" >.venv/ros
  venv_state >.venv/state
}

build_packages() {
  say 'building tp_interfaces, tp_controller and tp_sim, compiling the solver'
  rm -f install/state
  # links to files that are gone would stop setuptools
  [ ! -d build ] || find build -xtype l -delete
  source ./setup.bash
  # On all cores while the packages are built on them, too; the nodes load neither numba nor LLVM.
  PYTHONPATH=tp_controller${PYTHONPATH:+:$PYTHONPATH} logged python -m tp_controller.compile_ahead &
  local beside=$!
  logged colcon build --symlink-install
  wait $beside || exit
  PYTHONPATH=tp_controller:tp_sim${PYTHONPATH:+:$PYTHONPATH} logged python -c 'import tp_sim.servo'
  logged python -m compileall -q -j 0 tp_controller tp_sim install
  packages_state >install/state
}

main() {
  local started=$SECONDS
  mkdir -p log
  exec 9>log/setup.lock
  flock 9
  ros=$(find_ros)
  if [ "$ros" = wheels ]; then
    # Traces of other workspaces must not get into this one.
    unset PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH
  fi
  if [ -x .venv/bin/python ] && [ "$(packages_state)" = "$(cat install/state 2>/dev/null)" ]; then
    say 'up to date'
    return
  fi
  python=$(find_python)
  check_tools
  : >"$log"
  if [ ! -x .venv/bin/python ] || [ "$(venv_state)" != "$(cat .venv/state 2>/dev/null)" ]; then
    make_venv
  fi
  build_packages
  say "done in $((SECONDS - started)) s"
}

main
exit
