#!/usr/bin/env bash
# Cross-compiles the library for 64-bit Arm (Debian 12's g++-aarch64-linux-gnu) and runs tests of it under qemu-user. These
# are the golden hashes, which are those of x86-64, packs of NEON, the floating-point environment, and what the compiler fused.
# No CUDA, no files, no Python. Builds into build-aarch64/.
# The last line is: N passed, M failed, K skipped; exit status 77 where a compiler or qemu cannot be had.
#
#   scripts/aarch64.sh [CTEST OPTION ...]        for example: scripts/aarch64.sh -R golden
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

work=${STICTION_AARCH64_DIR:-$root/build-aarch64}
target=$work/target
build=$work/stiction
begin=$SECONDS
packages=(
  "g++-aarch64-linux-gnu: nothing can be built"
  "qemu-user: nothing can be run"
  "cmake: nothing can be built"
  "ninja-build: nothing can be built"
  "ccache: repeated builds take as long as the first"
  "googletest: no tests"
  "libeigen3-dev: no minimum-degree ordering"
  "python3: no test of what the compiler fused"
)
# Every test of the promise that the bits are the same, and those of what is written for NEON alone.
names='^(determinism_test_[a-z_]+|algorithm_test_lanes|algorithm_test_velocity_lanes|unit_test_(pack|real|hash|thread_pool))$'
chosen=("$@")
[ $# -gt 0 ] || chosen=(-R "$names|^fused_gate\$")

say "aarch64: packages"
install_packages "${packages[@]}"
for program in aarch64-linux-gnu-g++ qemu-aarch64 cmake ninja; do
  command -v "$program" > /dev/null && continue
  echo "SKIPPED: nothing was built for aarch64, $program is missing"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
done
toolchain=(-G Ninja --toolchain "$root/cmake/toolchain-aarch64.cmake" "-DSTICTION_TARGET_ROOT=$target" -DCMAKE_BUILD_TYPE=Release)
if command -v ccache > /dev/null; then toolchain+=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi
mkdir -p "$work"

# quiet COMMAND ...: its output only where it fails.
quiet() {
  "$@" > "$work/log" 2>&1 || { tail -n 60 "$work/log"; echo "0 passed, 1 failed, 0 skipped"; exit 1; }
}

if [ ! -e "$target/lib/cmake/GTest/GTestConfig.cmake" ]; then
  say "aarch64: GoogleTest"
  quiet cmake -S "${GOOGLETEST:-/usr/src/googletest}" -B "$work/googletest" "${toolchain[@]}" "-DCMAKE_INSTALL_PREFIX=$target" \
    -DCMAKE_INSTALL_LIBDIR=lib
  quiet cmake --build "$work/googletest" -j "$jobs" --target install
fi

say "aarch64: build"
begin_options "$build"
options+=("${toolchain[@]}" -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_BUILD_TOOLS=OFF -DSTICTION_BUILD_BENCH=OFF
  -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_BUILD_GPU_FIRST=OFF -DSTICTION_BUILD_TESTS=ON -DSTICTION_TEST_TIMEOUT=3000
  -DCMAKE_DISABLE_FIND_PACKAGE_HDF5=ON)  # what is found is this machine's, by its h5cc
[ -e /usr/share/eigen3/cmake/Eigen3Config.cmake ] && options+=(-DEigen3_DIR=/usr/share/eigen3/cmake)
quiet cmake "${options[@]}"
programs=$(cmake --build "$build" --target help | sed -n 's/^\([a-z0-9_]*\): phony$/\1/p' | sort)
mapfile -t targets < <(ctest --test-dir "$build" -N "${chosen[@]}" | sed -n 's/^ *Test *#[0-9]*: //p' | sort | comm -12 - <(echo "$programs"))
build_targets "${targets[@]}" stiction_distributed || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
built=$SECONDS

say "aarch64: tests"
status=0
ctest --test-dir "$build" --output-on-failure -j "$jobs" --no-tests=error --test-output-size-passed 1000000 \
  --test-output-size-failed 100000 --output-junit "$build/tests.xml" "${chosen[@]}" || status=$?
note "build $((built - begin)) s, tests $((SECONDS - built)) s"
python3 "$root/tools/test_summary.py" "$build/tests.xml" || status=1
exit "$status"
