#!/usr/bin/env bash
# On a machine with an NVIDIA GPU, and without a network: builds for that GPU, runs every test, compares the GPU's bits
# with the CPU's, runs compute-sanitizer and the benchmarks. Needs CMake, ninja, nvcc and a C++20 compiler. About eight
# minutes on 16 cores. Writes gpu_check.json; exit status 1 if anything failed or there was no device.
#
#   scripts/gpu_check.sh [FOLDER]        where gpu_check.json and the logs go; default: out
#
# Optional dependencies, and what goes missing without them: GoogleTest (tests), HDF5 + CLI11 + fmt + nlohmann-json
# (command line, so hash comparison and sanitizer; bench_classes), Google Benchmark (benchmarks), rapidcheck (property
# tests). tools/gpu_check.py --device emulated rehearses what follows the build where there is no GPU. Where
# the machine lacks them, run scripts/pack_for_gpu.sh on one that has them and bring its folder .carry along.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

out=${1:-$root/out}
mkdir -p "$out"
out=$(cd "$out" && pwd)
seconds=${STICTION_GPU_CHECK_SECONDS:-460}
begin=$SECONDS

for program in cmake ninja python3; do
  command -v "$program" > /dev/null || { echo "gpu_check.sh: $program is needed" >&2; exit 2; }
done
find_nvcc
[ -n "${CUDACXX:-}" ] || { echo "gpu_check.sh: nvcc is needed (set CUDACXX)" >&2; exit 2; }

capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2> /dev/null | head -n 1 | tr -d '. ' || true)
case $capability in '' | *[!0-9]*) capability=90; note "nvidia-smi names no device: building for sm_90" ;; esac

build=$root/build-gpu
options=(-S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTICTION_ENABLE_CUDA=ON
  "-DCMAKE_CUDA_ARCHITECTURES=$capability-real" -DSTICTION_WARNINGS_AS_ERRORS=OFF)
if [ -d "$root/.carry/usr" ]; then
  carried=$root/.carry/usr/lib/$(uname -m)-linux-gnu
  # RPATH and not RUNPATH: the libraries that were carried need one another.
  options+=("-DCMAKE_PREFIX_PATH=$root/.carry/usr" "-DHDF5_ROOT=$root/.carry/hdf5" "-DCMAKE_BUILD_RPATH=$carried"
    "-DCMAKE_EXE_LINKER_FLAGS=-Wl,--disable-new-dtags,-rpath-link,$carried")
  if [ -d "$root/.carry/shared" ]; then options+=("-DSTICTION_SHARED_DIR=$root/.carry/shared"); fi
fi
if command -v ccache > /dev/null; then
  options+=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache -DCMAKE_CUDA_COMPILER_LAUNCHER=ccache)
fi

say "build for sm_$capability"
cmake "${options[@]}" > "$out/configure.log" 2>&1 || { cat "$out/configure.log"; exit 1; }
grep -E '^--  ' "$out/configure.log" || true
cmake --build "$build" -j "$jobs" > "$out/build.log" 2>&1 || { tail -n 60 "$out/build.log"; exit 1; }
note "$((SECONDS - begin)) s"

exec python3 "$root/tools/gpu_check.py" --root "$root" --build "$build" --out "$out" --jobs "$jobs" \
  --seconds "$((seconds - SECONDS + begin))" --build-seconds "$((SECONDS - begin))"
