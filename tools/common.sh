# shellcheck shell=bash
# What the commands of this folder share. Sourced by them, not run.

# shellcheck disable=SC2034  # used by the commands
hsi4d_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '\n== %s\n' "$*"; }

# fail_with STATUS MESSAGE
fail_with() {
  printf '%s: %s\n' "${0##*/}" "${*:2}" >&2
  exit "$1"
}

fail() { fail_with 1 "$@"; }

# refuse MESSAGE: of a mistake in the command or in an input; the exit status is that of hsi4d.
refuse() { fail_with 2 "$@"; }

# The exit status where what is needed cannot be installed: later it may.
# shellcheck disable=SC2034
readonly not_now=75
# The last playwright-core that runs with Debian 12's Node 18.
# shellcheck disable=SC2034  # of tools/frontend and tools/test_report
readonly playwright_version=1.60.0

# timed TITLE COMMAND...: runs the command and prints how long it took.
timed() {
  local title=$1 start=$SECONDS status=0
  shift
  say "$title"
  "$@" || status=$?
  if [[ $status -eq 0 ]]; then
    printf -- '-- %s: %d s\n' "$title" $((SECONDS - start))
  else
    printf -- '-- %s: failed (exit %d) after %d s\n' "$title" "$status" $((SECONDS - start))
  fi
  return "$status"
}

# Memory that may still be used, KiB: what the kernel has to give, or a container's limit where that is lower.
available_memory_kib() {
  local available limit
  available=$(awk '/^MemAvailable:/ {print $2}' /proc/meminfo)
  limit=$(cat /sys/fs/cgroup/memory.max 2>/dev/null || echo max)
  if [[ $limit =~ ^[0-9]+$ ]] && ((limit / 1024 < available)); then
    available=$((limit / 1024))
  fi
  echo "$available"
}

# Compilers to run at once: one a core, as far as memory goes (the largest files need about 2 GiB each).
build_jobs() {
  local jobs by_memory
  if [[ -n ${CMAKE_BUILD_PARALLEL_LEVEL:-} ]]; then
    echo "$CMAKE_BUILD_PARALLEL_LEVEL"
    return
  fi
  jobs=$(nproc)
  by_memory=$(($(available_memory_kib) / (2 * 1024 * 1024)))
  if ((by_memory < jobs)); then jobs=$by_memory; fi
  if ((jobs < 1)); then jobs=1; fi
  echo "$jobs"
}

# configure PRESET [CMAKE-ARGUMENT]...
configure() { timed "configure $1" cmake --preset "$@"; }

# compile PRESET [TARGET...]: builds the targets (everything, if none is named) of a configured preset.
compile() {
  local preset=$1 jobs
  shift
  jobs=$(build_jobs)
  timed "build $preset${*:+: $*} (jobs: $jobs)" \
    cmake --build --preset "$preset" --parallel "$jobs" ${1:+--target "$@"}
}

# find_chromium: prints where a Chromium is, or nothing; the variable CHROMIUM names another than that in PATH.
find_chromium() { command -v "${CHROMIUM:-}" chromium chromium-browser google-chrome 2>/dev/null | head -n 1; }

# install_debian PACKAGE...: as root or through sudo.
install_debian() {
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -q -y)
  if [[ $EUID -ne 0 ]]; then apt=(sudo "${apt[@]}"); fi
  "${apt[@]}" update || echo "the package lists could not be refreshed; trying with those that are there" >&2
  "${apt[@]}" install --no-install-recommends "$@"
}

# install_chromium [PACKAGE]...: Debian's, where there is none, with these packages.
install_chromium() {
  [[ -z $(find_chromium) ]] || return 0
  timed "install chromium" install_debian chromium "$@" ||
    fail_with $not_now "there is no Chromium, and it cannot be installed (Debian package chromium); the variable CHROMIUM names one"
}

# provide PROGRAM PACKAGE: Debian's, where there is none.
provide() {
  if command -v "$1" >/dev/null; then return; fi
  timed "install $1" install_debian "$2" ||
    fail_with $not_now "there is no $1, and it cannot be installed (Debian package $2)"
}

# print_usage FILE: the comment at the top of a command.
print_usage() { sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$1"; }
