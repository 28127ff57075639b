#!/usr/bin/env bash
# Installs what is missing (Debian 12), builds, and runs every test. Runs from any directory, and again.
# The last line is: N passed, M failed, K skipped
#
#   scripts/test.sh [CTEST OPTION ...]        for example: scripts/test.sh -L lint
#   scripts/test.sh --frameworks [CTEST OPTION ...]        PyTorch, JAX, Newton and others, too: gigabytes, once
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

requirements=("$root/tools/requirements.txt" "$root/tools/requirements-lint.txt")
if [ "${1:-}" = --frameworks ]; then
  requirements+=("$root/tools/requirements-frameworks.txt")
  shift
fi

begin=$SECONDS
say "packages"
install_packages "${build_packages[@]}" "${test_packages[@]}"
make_venv "${requirements[@]}"
find_nvcc
installed=$SECONDS

say "build"
# Compiling for a GPU and reading what comes out needs none: the gates are for machines like this one.
options=()
[ -n "${CUDACXX:-}" ] && options+=(-DSTICTION_ENABLE_CUDA=ON)
{ configure "${options[@]}" && build_targets all; } || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
built=$SECONDS

say "tests"
junit=$build/tests.xml
rm -f "$junit"
status=0
# Passed tests' output is kept whole: it is where skips explain themselves.
ctest --test-dir "$build" --output-on-failure -j "$jobs" --no-tests=error \
  --test-output-size-passed 1000000 --test-output-size-failed 1000000 --output-junit "$junit" "$@" || status=$?

say "summary"
note "packages $((installed - begin)) s, build $((built - installed)) s, tests $((SECONDS - built)) s"
if [ ! -f "$junit" ]; then
  echo "0 passed, 1 failed, 0 skipped"
  exit 1
fi
python3 "$root/tools/test_summary.py" "$junit" || status=1
exit "$status"
