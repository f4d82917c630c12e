# The environment of this workspace, for bash and zsh: `source tools/env.sh`, then `ros2 run dart_skill wam_simulator`.
# It is `source install/setup.bash`, completion of `dart-skill` with TAB, and three defaults, each of which a value of your own overrides:
#   ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST   nodes are seen on this machine only
#   OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1  the matrices are small; more threads only get in each other's way

if [ -n "${ZSH_VERSION:-}" ]; then
  eval '_dart_skill_root=${${(%):-%x}:A:h:h}'
  _dart_skill_shell=zsh
else
  _dart_skill_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
  _dart_skill_shell=bash
fi

if [ ! -e "$_dart_skill_root/.venv/bin/python3" ] || [ ! -e "$_dart_skill_root/install/setup.$_dart_skill_shell" ]; then
  echo "the workspace is not set up yet: run 'make setup' in $_dart_skill_root" >&2
  unset _dart_skill_root _dart_skill_shell
  return 1
fi

# setup files of ROS 2 read variables that may not be set
case $- in *u*) _dart_skill_nounset=1; set +u ;; *) _dart_skill_nounset= ;; esac
. "$_dart_skill_root/install/setup.$_dart_skill_shell"
[ -z "$_dart_skill_nounset" ] || set -u

export VIRTUAL_ENV="$_dart_skill_root/.venv"
PATH="$VIRTUAL_ENV/bin:$PATH"
command -v ros2 >/dev/null || PATH="$PATH:$VIRTUAL_ENV/ros2_stand_in"
export PATH
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
. "$_dart_skill_root/tools/completion.$_dart_skill_shell"
unset _dart_skill_root _dart_skill_shell _dart_skill_nounset
