#!/usr/bin/env bash
# The first eight minutes on a machine with an NVIDIA GPU, and without a network. Are the GPU's bits the CPU's, and how
# long does it take (tools/gpu_first/README.md)?
#
#   scripts/gpu_check.sh [RESULTS]       default: out
#
# A pack in .carry (STICTION_PACK; scripts/pack_for_gpu.sh makes it) is used if it was made of these sources, else
# refused. Without one, gpu_first is compiled, of the kernels in STICTION_PREBUILT_CUDA (scripts/prebuild_cuda.sh; needs CMake
# and g++, some minutes), or by nvcc (an hour of a core). STICTION_GPU_SECONDS limits what it runs (default 470),
# STICTION_GPU_DEVICE=ptx rehearses it without a GPU. Exit status 0: all is right.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

[ $# -le 1 ] || { echo "gpu_check.sh: give a folder for the results" >&2; exit 2; }
out=${1:-$root/out}
pack=${STICTION_PACK:-$root/.carry}
if [ -f "$pack/manifest.txt" ]; then
  python3 "$root/tools/gpu_first/pack_manifest.py" check "$pack"
  exec "$pack/run.sh" "$out"
fi

say "build"
build=${STICTION_GPU_BUILD_DIR:-$root/build-gpu}
mkdir -p "$out"
find_nvcc
begin_options "$build"
options+=(-DSTICTION_ENABLE_CUDA=ON -DSTICTION_BUILD_GPU_FIRST=ON -DSTICTION_WARNINGS_AS_ERRORS=OFF
  -DSTICTION_CPU_KERNELS=native)
for part in TESTS TOOLS BENCH C EXAMPLES; do options+=("-DSTICTION_BUILD_$part=OFF"); done
if [ -n "${STICTION_PREBUILT_CUDA:-}" ]; then
  options+=("-DSTICTION_PREBUILT_CUDA=$STICTION_PREBUILT_CUDA")
else
  capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2> /dev/null | head -n 1 | tr -d '. ' || true)
  case $capability in '' | *[!0-9]*) capability=90 ;; esac
  options+=("-DCMAKE_CUDA_ARCHITECTURES=$capability-real")
fi
if command -v ninja > /dev/null; then options+=(-G Ninja); fi
if ! (cmake "${options[@]}" && cmake --build "$build" --target gpu_first -j "$jobs") > "$out/build.log" 2>&1; then
  tail -n 60 "$out/build.log"
  exit 1
fi
data=${STICTION_SHARED_DIR:-$root/../shared}/data/mujoco
if cmake --build "$build" --target pack_batches -j "$jobs" >> "$out/build.log" 2>&1; then
  "$build/tools/gpu_first/pack_batches" "$build/batches" "$data"/{g1,humanoid,leap_hand}.h5
fi
"$build/tools/gpu_first/gpu_first" --plan minutes --device "${STICTION_GPU_DEVICE:-cuda}" --seconds "${STICTION_GPU_SECONDS:-470}" \
  --out "$out/results.jsonl" --hashes "$root/tools/gpu_first/hashes.csv" --batches "$build/batches"
