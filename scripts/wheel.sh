#!/usr/bin/env bash
# Builds a wheel as `pip install .` does, installs it into an empty environment beside NumPy, and uses it there.
# The last line is: N passed, M failed, K skipped; exit status 77 where PyPI does not deliver what the build needs.
#
#   scripts/wheel.sh [--sdist] [PIP OPTION ...]        for example: scripts/wheel.sh -C cmake.define.STICTION_CPU_KERNELS=all
#
# --sdist builds it from a source archive of the last commit, as a package index would hand it out (build-wheel/dist).
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

# The archive holds what is committed, less what pyproject.toml excludes, and nothing else. It is made in a clone: its maker
# walks through every build folder that lies in the tree, and follows their links.
make_archive() {
  local excluded
  git clone --quiet "$root" "$work/clone" && python3 -m venv "$work/maker" &&
    "$work/maker/bin/pip" install --quiet --disable-pip-version-check --timeout 15 --retries 1 build &&
    "$work/maker/bin/python" -m build --sdist -o "$work/dist" "$work/clone" || return 1
  source=$(echo "$work/dist/"*.tar.gz)
  excluded=$(sed -n 's/^sdist.exclude = \[\(.*\)\]$/\1/p' "$root/pyproject.toml" | tr -d '" ' | sed 's#^/##; s#,/#|#g')
  diff <(git -C "$work/clone" ls-files | grep -vE "^($excluded)/" | sort) \
    <(tar tzf "$source" | grep -v '/$' | cut -d/ -f2- | grep -vx PKG-INFO | sort)
}

archive=no
if [ "${1:-}" = --sdist ]; then
  archive=yes
  shift
fi
source=$root objects=$work-objects
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

if [ "$archive" = yes ]; then
  say "wheel: source archive"
  make_archive > "$work/archive.log" 2>&1 || { cat "$work/archive.log"; fail "the source archive was not made, or holds other files than the commit"; }
  note "$(basename "$source"), $(du -h "$source" | cut -f1), $(tar tzf "$source" | wc -l) files"
  # pip unpacks it there, and builds below it: paths that count from the build's own folder are then those of other builds.
  mkdir -p "$work/tmp"
  export TMPDIR=$work/tmp CCACHE_BASEDIR=$work/tmp
  objects="build-objects"
fi

say "wheel: build"
# A compiler's cache, where there is one, makes it quick the second time. It knows the kernels of demo.sh and the rest of
# test.sh, compiled by the same options beside it. Sources that include nanobind, which pip keeps elsewhere each time, are compiled.
if command -v ccache > /dev/null; then export CMAKE_CXX_COMPILER_LAUNCHER=ccache; fi
# It counts a compiler of another name as another one, and pip would ask for Python's.
export CXX=${CXX:-c++}
shared=(-C build-dir="$objects" -C cmake.define.STICTION_WARNINGS_AS_ERRORS=ON
  -C "cmake.define.STICTION_KEEP_LINES=${STICTION_KEEP_LINES:-AUTO}")
log=$work/build.log
if ! "${pip[@]}" wheel -v --no-deps -w "$work/wheels" "${shared[@]}" "$@" "$source" 2>&1 | tee "$log" | only_progress=1 show_progress; then
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
