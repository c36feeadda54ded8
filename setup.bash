# Puts the calling bash into this workspace: its python, ROS 2 and the built packages.
#
#     source setup.bash
#
# Works from any folder and may be sourced again. `make setup` has to have run before.

_tp_root="$(builtin cd -- "$(dirname -- "${BASH_SOURCE[0]}")" >/dev/null && pwd -P)"

# Put folder $2 first in the colon-separated variable $1, unless it is listed already.
_tp_prepend() {
  [[ ":${!1:-}:" == *":$2:"* ]] || export "$1=$2${!1:+:${!1}}"
}

# Environment of the ROS 2 wheels: what a system-wide ROS does in its own setup.bash.
# ROS_DISTRO stays unset, it marks a system-wide ROS.
_tp_use_wheels() {
  local folder
  for folder in "$_tp_root"/.venv/lib/python3*/site-packages/ros_*.libs "$_tp_root/.venv/lib"; do
    [ ! -d "$folder" ] || _tp_prepend LD_LIBRARY_PATH "$folder"
  done
  _tp_prepend AMENT_PREFIX_PATH "$_tp_root/.venv"
  _tp_prepend CMAKE_PREFIX_PATH "$_tp_root/.venv"
  export ROS_VERSION=2 ROS_PYTHON_VERSION=3
  # LD_LIBRARY_PATH is complete, so python need not start itself a second time to set it.
  export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
}

_tp_use_overlay() {
  [ -f "$_tp_root/install/local_setup.bash" ] || return 0
  local flags=$-
  set +eu # colcon's scripts read variables that may be unset
  source "$_tp_root/install/local_setup.bash"
  [[ "$flags" != *e* ]] || set -e
  [[ "$flags" != *u* ]] || set -u
}

_tp_enter() {
  local ros=''
  if [ -x "$_tp_root/.venv/bin/python" ] && [ -f "$_tp_root/.venv/ros" ]; then
    ros="$(<"$_tp_root/.venv/ros")"
  fi
  case "$ros,${ROS_DISTRO:-}" in
    wheels,) ;;
    system,jazzy) ;;
    system,*)
      echo 'setup.bash: set up for a sourced ROS 2 Jazzy: source that first, or run make setup' >&2
      return 1
      ;;
    wheels,*)
      echo "setup.bash: set up without ROS, but ROS_DISTRO=$ROS_DISTRO: run make setup" >&2
      return 1
      ;;
    *)
      echo "setup.bash: not set up yet; run: make -C $_tp_root setup" >&2
      return 1
      ;;
  esac
  unset PYTHONHOME
  export VIRTUAL_ENV="$_tp_root/.venv"
  [ "$(command -v python)" = "$VIRTUAL_ENV/bin/python" ] || export PATH="$VIRTUAL_ENV/bin:$PATH"
  [ "$ros" = system ] || _tp_use_wheels
  _tp_use_overlay
}

_tp_forget() {
  unset _tp_root
  unset -f _tp_prepend _tp_use_wheels _tp_use_overlay _tp_enter _tp_forget
}

if _tp_enter; then
  _tp_forget
else
  _tp_forget
  return 1
fi
