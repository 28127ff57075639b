#!/usr/bin/env bash
# Builds Debian packages for this release of Debian, installs them into a fresh system of it, and builds and runs programs
# against them there (tests/consumer). Builds into build-deb/, the packages are in build-deb/packages/.
# The last line is: N passed, M failed, K skipped
#
#   scripts/deb.sh [CMAKE OPTION ...]        for example: scripts/deb.sh -DSTICTION_ENABLE_ORDERINGS=OFF
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
# shellcheck source-path=SCRIPTDIR source=systems.sh
. "$root/scripts/systems.sh"

work=${STICTION_DEB_DIR:-$root/build-deb}
build=$work-objects  # beside build/, whose compiled objects a cache then hands over
begin=$SECONDS
passed=0 failed=0 skipped=0

# count WHAT COMMAND ...: one test.
count() {
  local what=$1
  shift
  if "$@" > "$work/log" 2>&1; then
    passed=$((passed + 1))
    note "passed: $what"
  else
    failed=$((failed + 1))
    note "failed: $what"
    tail -n 40 "$work/log"
  fi
}

use_unpacked() {
  rm -rf "$work/consumer"
  cmake -S "$root/tests/consumer/find_package" -B "$work/consumer" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    "-DCMAKE_PREFIX_PATH=$work/unpacked/usr" && cmake --build "$work/consumer" && "$work/consumer/consumer"
}

# Inside of the fresh system: /src is the source, /out the work folder.
inside() {
  apt-get -qq update
  apt-get -qq install -y --no-install-recommends /out/packages/*.deb g++ gcc cmake ninja-build pkg-config
  cmake -S /src/tests/consumer/find_package -B /tmp/consumer -G Ninja -DCMAKE_BUILD_TYPE=Release
  cmake --build /tmp/consumer
  /tmp/consumer/consumer
  [ ! -e /tmp/consumer/consumer_io ] || /tmp/consumer/consumer_io
  cmake -DINSTALLED=/usr -DSOURCE_DIR=/src -DWORK_DIR=/tmp/c_language -DGENERATOR=Ninja -DCC=gcc -DPKG_CONFIG=pkg-config \
    -P /src/tests/consumer/run_c_language.cmake
  stiction solve /src/examples/data/hand_cube.h5 --solver npgs --tolerance 1e-6 -o /tmp/solution.h5
  stiction verify /src/examples/data/hand_cube.h5 /tmp/solution.h5
  apt-get -qq purge -y libstiction0 libstiction-dev stiction
  left=$(find /usr /etc -name '*stiction*')
  [ -z "$left" ] || { echo "left behind: $left"; return 1; }
}

if [ "${1:-}" = --inside ]; then
  inside
  exit
fi

command -v dpkg-shlibdeps > /dev/null || {
  echo "SKIPPED: no packages were built, dpkg-dev is missing"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
}
say "deb: packages"
install_packages "${build_packages[@]}" "libtbb-dev: the library's own threads" "libsuitesparse-dev: no SuiteSparse ordering" \
  "libmetis-dev: no nested dissection" "libeigen3-dev: no minimum-degree ordering"
mkdir -p "$work"

say "deb: build"
configure -DCMAKE_INSTALL_PREFIX=/usr -DCMAKE_SKIP_INSTALL_ALL_DEPENDENCY=ON -DSTICTION_CPU_KERNELS=all -DSTICTION_ENABLE_CUDA=OFF \
  -DSTICTION_ENABLE_MPI=OFF -DSTICTION_BUILD_PYTHON=OFF -DSTICTION_BUILD_TESTS=OFF -DSTICTION_BUILD_BENCH=OFF \
  -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_KEEP_LINES=ON "$@"
build_targets stiction_facade stiction_io stiction_c stiction_cli || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
find "$build" -name '*.a' -exec strip --strip-debug {} +  # cpack strips programs and shared libraries alone
rm -rf "$work/packages"
quiet "$work/cpack.log" cpack --config "$build/CPackConfig.cmake" -G DEB -B "$work/packages" || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
rm -rf "$work/packages/_CPack_Packages"
note "build $((SECONDS - begin)) s"
for package in "$work/packages/"*.deb; do
  note "$(basename "$package"), $(du -h "$package" | cut -f1), needs $(dpkg-deb -f "$package" Depends)"
done

say "deb: use"
# In a system of its own where one can be made, else only unpacked.
if reason=$(can_make_systems); then
  suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
  rm -rf "$work/system"
  quiet "$work/system.log" make_system system "$suite" ca-certificates || reason="Debian does not deliver $suite"
fi
if [ -z "$reason" ]; then
  count "installed into a fresh $suite, used from C++, C and the command line, and removed" in_system system bash /src/scripts/deb.sh --inside
else
  echo "SKIPPED: not installed into a fresh system, $reason"
  skipped=1
fi
unpacked=$work/unpacked
rm -rf "$unpacked"
for package in "$work/packages/"*.deb; do dpkg-deb -x "$package" "$unpacked"; done
count "unpacked elsewhere and used from C++" use_unpacked
if command -v lintian > /dev/null; then
  count "no error by lintian" lintian --fail-on error "$work/packages/"*.deb
else
  echo "SKIPPED: lintian is missing"
  skipped=$((skipped + 1))
fi
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" = 0 ]
