#!/usr/bin/env bash
# Builds a wheel as `pip install .` does, installs it into an empty environment beside NumPy, and uses it there.
# The last line is: N passed, M failed, K skipped; exit status 77 where PyPI does not deliver what the build needs.
#
#   scripts/wheel.sh [PIP OPTION ...]        for example: scripts/wheel.sh -C cmake.define.STICTION_CPU_KERNELS=all
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

work=${STICTION_WHEEL_DIR:-$root/build-wheel}
begin=$SECONDS

skip() {
  echo "SKIPPED: the wheel is not tested, $*"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
}

fail() {
  echo "$*"
  echo "0 passed, 1 failed, 0 skipped"
  exit 1
}

say "wheel: packages"
install_packages "${build_packages[@]}"
rm -rf "$work" "$work-objects"
mkdir -p "$work/wheels"
python3 -m venv "$work/empty" > /dev/null 2>&1 || skip "there is no python3-venv"
python=$work/empty/bin/python
pip=("$python" -m pip --disable-pip-version-check)
mapfile -t needs < <(sed -n 's/^requires = \[\(.*\)\]$/\1/p' "$root/pyproject.toml" | tr ',' '\n' | tr -d '" ')
note "fetching numpy ${needs[*]}"
"${pip[@]}" install --quiet --timeout 15 --retries 1 numpy > "$work/pip.log" 2>&1 || skip "PyPI does not deliver numpy"
"${pip[@]}" download --quiet --timeout 15 --retries 1 --no-deps -d "$work/needs" "${needs[@]}" >> "$work/pip.log" 2>&1 ||
  skip "PyPI does not deliver ${needs[*]}"

say "wheel: build"
# A compiler's cache, where there is one, makes it quick the second time, and knows what test.sh has compiled by the same
# options beside it.
if command -v ccache > /dev/null; then export CMAKE_CXX_COMPILER_LAUNCHER=ccache; fi
# It counts a compiler of another name as another one, and pip would ask for Python's.
export CXX=${CXX:-c++}
shared=(-C build-dir="$work-objects" -C cmake.define.STICTION_KEEP_LINES=ON -C cmake.define.STICTION_WARNINGS_AS_ERRORS=ON)
log=$work/build.log
if ! "${pip[@]}" wheel -v --no-deps -w "$work/wheels" "${shared[@]}" "$@" "$root" 2>&1 | tee "$log" | only_progress=1 show_progress; then
  tail -n 60 "$log"
  fail "the wheel was not built"
fi
wheel=$(find "$work/wheels" -name '*.whl')
built=$((SECONDS - begin))
note "$(basename "$wheel"), $(du -h "$wheel" | cut -f1)"

say "wheel: install and use"
"${pip[@]}" install --quiet --no-index "$wheel" > "$work/pip.log" 2>&1 || { cat "$work/pip.log"; fail "the wheel was not installed"; }
note "install and build $built s"
cd "$work"
status=0
"$python" "$root/python/tests/wheel.py" "$wheel" "$root" 2>&1 || status=$?
exit "$status"
