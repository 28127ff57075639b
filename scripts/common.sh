# Shared by the scripts beside it; sourced, not run. Sets `root` and stays in the caller's directory.
# shellcheck shell=bash
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
jobs=$(nproc 2> /dev/null || echo 2)
build=${STICTION_BUILD_DIR:-$root/build}

say() { printf '\n== %s\n' "$*"; }
note() { printf '   %s\n' "$*"; }

# Runs a command as root, or fails if there is no way to.
as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  elif command -v sudo > /dev/null; then
    sudo -n "$@"
  else
    return 1
  fi
}

have_package() { dpkg-query -W -f='${Status}' "$1" 2> /dev/null | grep -q 'ok installed'; }

# Installs the Debian packages that are missing. One that cannot be installed is named, with its use.
#   install_packages "package: what needs it" ...
install_packages() {
  local line package missing=() begin=$SECONDS
  command -v dpkg-query > /dev/null || { note "not a Debian system: nothing is installed, what is here is used"; return 0; }
  for line in "$@"; do
    package=${line%%:*}
    have_package "$package" || missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && { note "all packages are here"; return 0; }
  note "installing ${#missing[@]} packages: ${missing[*]}"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq > /dev/null 2>&1 || note "apt-get update failed (no network, or neither root nor sudo)"
  if ! as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" > /dev/null 2>&1; then
    for package in "${missing[@]}"; do  # one of them stopped all: take those that can be had
      as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$package" > /dev/null 2>&1 || true
    done
  fi
  for line in "$@"; do
    package=${line%%:*}
    have_package "$package" || note "could not install $package: ${line#*: }"
  done
  note "$((SECONDS - begin)) s"
}

# shellcheck disable=SC2034  # used by the scripts that source this one
build_packages=(
  "g++: nothing can be built without a C++20 compiler"
  "cmake: nothing can be built"
  "ninja-build: nothing can be built"
  "ccache: repeated builds take as long as the first"
  "lld: linking the tests takes five times as long"
  "python3: lint, PTX gate and the test summary are skipped"
  "python3-venv: recording tests and pictures are skipped, the Python package is not built"
  "python3-dev: the Python package is not built"
  "libhdf5-dev: no files and no command line"
  "libcli11-dev: no command line"
  "libfmt-dev: no command line"
  "nlohmann-json3-dev: no command line"
  "graphviz: no pictures of contact graphs"
)
# shellcheck disable=SC2034
test_packages=(
  "libgtest-dev: no tests"
  "libgmock-dev: no tests"
  "librapidcheck-dev: no property tests"
  "libbenchmark-dev: no benchmarks"
  "libeigen3-dev: no minimum-degree ordering, no Eigen baseline in the benchmarks"
  "libspectra-dev: extreme singular values are not compared with Spectra"
  "libsuitesparse-dev: no SuiteSparse ordering"
  "libmetis-dev: no nested dissection"
  "libtbb-dev: oneTBB is not tested"
  "libopenmpi-dev: no stiction-mpi, one scene over several processes is tested by threads alone"
  "openmpi-bin: no mpirun, stiction-mpi is not tested"
  "libhdf5-openmpi-dev: checkpoints of ranks are one file for each rank, and not one"
  "libboost-context-dev: the GPU's generated code is not executed"
  "doxygen: comments of the public headers are not checked"
)

# install_python WHAT PIP-OPTION ...: into .venv, saying what takes long; fails where it cannot be had. `seconds` limits it.
install_python() {
  local what=$1 line begin=$SECONDS
  shift
  timeout "${seconds:-900}" "$root/.venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off --timeout 15 \
    --retries 1 "$@" 2>&1 | while IFS= read -r line; do
      if [[ $line =~ ^\ *Downloading\ ([^-]+).*\(([0-9.]+\ GB|[0-9]{2,}\.?[0-9]*\ MB)\) ]]; then
        note "  ${BASH_REMATCH[1]}, ${BASH_REMATCH[2]}, $((SECONDS - begin)) s"
      elif [[ $line == "Installing collected packages:"* ]]; then
        note "  installing $(tr ',' '\n' <<< "${line#*:}" | wc -l) packages, $((SECONDS - begin)) s"
      elif [[ $line == ERROR:* ]]; then
        note "  $line"
      fi
    done && note "$what: $((SECONDS - begin)) s"
}

# PyTorch for the CPU alone, from the index that STICTION_TORCH_INDEX names: PyPI's brings NVIDIA's libraries, 5 GB, and
# loads only with them.
install_torch_for_cpu() {
  [ -z "${STICTION_TORCH_INDEX:-}" ] || "$root/.venv/bin/python" -c 'import torch' 2> /dev/null ||
    seconds=300 install_python "PyTorch for the CPU" --retries 0 --index-url "$STICTION_TORCH_INDEX" torch || true
}

# make_venv REQUIREMENTS ...: a virtual environment with what these files name. Sets `python` to it, or to the system's
# where PyPI does not answer.
make_venv() {
  local file stamp
  python=$(command -v python3 || true)
  [ -n "$python" ] || { note "no python3: lint, recording tests and pictures are skipped"; return 0; }
  [ -x "$root/.venv/bin/python" ] || python3 -m venv "$root/.venv" > /dev/null 2>&1 ||
    { note "no python3-venv: recording tests and pictures are skipped"; return 0; }
  for file in "$@"; do
    stamp=$root/.venv/.installed-$(basename "$file" .txt)
    cmp -s "$file" "$stamp" && continue
    note "fetching $(grep -oE '^[a-z0-9-]+' "$file" | tr '\n' ' ')into .venv"
    grep -q '^torch' "$file" && install_torch_for_cpu
    if install_python "$(basename "$file")" -r "$file"; then
      cp "$file" "$stamp"
    elif [ "$file" = "$1" ]; then
      note "PyPI did not deliver: its tests are skipped, and pictures unless the system has matplotlib"
      return 0
    else
      note "PyPI did not deliver what $(basename "$file") names: its tests are skipped"
    fi
  done
  python=$root/.venv/bin/python
}

# Settings of ccache, to see through precompiled headers, and to hand an object of one build to another. Paths count from
# the build's own folder, so folders that lie side by side in the tree share what they compile by the same options.
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:+$CCACHE_SLOPPINESS,}pch_defines,time_macros
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$root} CCACHE_NOHASHDIR=${CCACHE_NOHASHDIR:-1}

# Sets CUDACXX if there is an nvcc, in the environment, on the path, in the usual place or in .cuda.
find_nvcc() {
  local candidate
  for candidate in "${CUDACXX:-}" "$(command -v nvcc || true)" /usr/local/cuda/bin/nvcc \
    "$root"/.cuda/nvidia/cu*/bin/nvcc; do
    if [ -n "$candidate" ] && [ -x "$candidate" ]; then
      export CUDACXX=$candidate
      note "CUDA: $CUDACXX"
      return 0
    fi
  done
  unset CUDACXX
  note "CUDA: no nvcc, so this build is CPU-only (scripts/get_cuda.sh fetches one)"
}

# begin_options FOLDER: sets `options` to those of a build in that folder, each at its default, with the compiler's cache where
# there is one. Every script begins with these (tools/lint_options.py): what an earlier one has left in the folder's own
# cache of options does not count.
begin_options() {
  local launcher=
  if command -v ccache > /dev/null; then launcher=ccache; fi
  options=(-S "$root" -B "$1" --no-warn-unused-cli -DCMAKE_BUILD_TYPE=Release
    "-DCMAKE_C_COMPILER_LAUNCHER=$launcher" "-DCMAKE_CXX_COMPILER_LAUNCHER=$launcher" "-DCMAKE_CUDA_COMPILER_LAUNCHER=$launcher"
    -DSTICTION_ENABLE_CUDA=AUTO -DSTICTION_PREBUILT_CUDA:FILEPATH= -DSTICTION_PTX_SOLVERS=npgs -DSTICTION_EMULATED_DEVICE=AUTO
    -DSTICTION_CPU_KERNELS=all -DSTICTION_ENABLE_AVX2=ON -DSTICTION_ENABLE_AVX512=ON
    "-DSTICTION_KEEP_LINES=${STICTION_KEEP_LINES:-AUTO}"
    -DSTICTION_LIBRARY_OPTIONS= -DSTICTION_CORE_OPTIONS= -DSTICTION_WARNINGS_AS_ERRORS=ON
    -DSTICTION_ENABLE_TBB=AUTO -DSTICTION_ENABLE_MPI=AUTO -DSTICTION_PARALLEL_HDF5=ON -DSTICTION_ENABLE_ORDERINGS=ON
    -DSTICTION_BUILD_TOOLS=ON -DSTICTION_BUILD_TESTS=ON -DSTICTION_BUILD_GPU_FIRST=AUTO -DSTICTION_BUILD_BENCH=ON
    -DSTICTION_BUILD_C=ON -DSTICTION_BUILD_EXAMPLES=ON -DSTICTION_BUILD_PYTHON=OFF
    -DSTICTION_ENABLE_FUZZERS=OFF -DSTICTION_TEST_TIMEOUT=300 "-DSTICTION_SHARED_DIR:PATH=${STICTION_SHARED_DIR:-$root/../shared}")
}

# configure [CMAKE OPTION ...]: the Release build that scripts share, in build/ (or STICTION_BUILD_DIR).
configure() {
  local options
  begin_options "$build"
  options+=(-G Ninja)
  [ -n "${python:-}" ] && options+=("-DPython3_EXECUTABLE=$python" "-DPython_EXECUTABLE=$python" "-DSTICTION_PYTHON=$python")
  if [[ $* == *STICTION_BUILD_PYTHON=* ]]; then
    true  # the caller has decided
  elif [ -n "${python:-}" ] && "$python" -c '
import nanobind, pathlib, sysconfig
assert (pathlib.Path(sysconfig.get_paths()["include"]) / "Python.h").exists()' 2> /dev/null; then
    options+=(-DSTICTION_BUILD_PYTHON=ON)
  else
    note "no nanobind or no Python.h: the Python package is not built"
  fi
  if [ -n "${CUDACXX:-}" ] && grep -qs '^CMAKE_CUDA_COMPILER:.*NOTFOUND' "$build/CMakeCache.txt"; then
    options+=(-U CMAKE_CUDA_COMPILER)  # an earlier configuration found none and remembers it
  fi
  options+=("$@")
  local log
  log=$(mktemp)
  cmake "${options[@]}" > "$log" 2>&1 || { cat "$log" >&2; rm -f "$log"; return 1; }
  sed -n '/stiction [0-9]/,$p' "$log" | grep -E '^-- (stiction [0-9]|  .*: (yes|no))' | sed 's/^-- /   /' || true
  rm -f "$log"
}

# show_progress: copies a build's output, but of its progress only a line whenever another tenth is done or half a minute has
# passed. From pip's output it takes ninja's.
show_progress() {
  local line tenth last=-1 begin=$SECONDS shown=$SECONDS
  while IFS= read -r line; do
    if [[ $line =~ ^\ *\[([0-9]+)/([0-9]+)\] ]]; then
      tenth=$((10 * BASH_REMATCH[1] / BASH_REMATCH[2]))
      [ "$tenth" -gt "$last" ] || [ $((SECONDS - shown)) -ge 30 ] || continue
      last=$tenth shown=$SECONDS
      note "${BASH_REMATCH[1]} of ${BASH_REMATCH[2]}, $((SECONDS - begin)) s"
    elif [ -z "${only_progress:-}" ]; then
      printf '%s\n' "$line"
    fi
  done
}

# build_targets [TARGET ...]: all of it if none is named.
build_targets() {
  cmake --build "$build" -j "$jobs" ${1:+--target "$@"} 2>&1 | show_progress
}
