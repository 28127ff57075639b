#!/usr/bin/env bash
# Makes a folder with all that the first minutes on a GPU need (tools/gpu_first/README.md). It works in any place:
#
#   scripts/pack_for_gpu.sh --alone [FOLDER]     default: .carry, which git ignores
#
#   gpu_first.xz     the program with its kernels as machine code for H100 and H200. It needs a C library no older than
#                    this machine's, and NVIDIA's driver
#   batches/         recorded robots as J and M
#   hashes.csv       what the CPU answers
#   run.sh           runs it all; manifest.txt says what sources it was made of
#
# Kernels are compiled at the lowest priority, and what was compiled before is kept. Kernels of two solvers that
# auto never takes are left out for time (STICTION_PACK_WITHOUT, names of .cu files with commas between them). Then the pack
# is tried: it is under 35 MB, unpacks, and finds its hashes on the CPU.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [ "${1:-}" != --alone ] || [ $# -gt 2 ]; then
  echo "pack_for_gpu.sh: say --alone, then a folder" >&2
  exit 2
fi
pack=${2:-$root/.carry}
folder=${STICTION_PACK_DIR:-$root/build-carried}
data=${STICTION_SHARED_DIR:-$root/../shared}/data/mujoco
without=${STICTION_PACK_WITHOUT-cuda_pgs,cuda_nsgs}
most_bytes=35000000
begin=$SECONDS
mkdir -p "$pack" "$folder"
pack=$(cd "$pack" && pwd)

sources=$(python3 "$root/tools/gpu_first/pack_manifest.py" sources)
say "kernels"
STICTION_PREBUILD_WITHOUT=$without "$root/scripts/prebuild_cuda.sh" "$folder/kernels.tar.xz"

say "gpu_first"
# With no library of its own but the C library's: that machine has others, or none. The CPU's kernels are those for any
# x86-64: there it is only compared with.
begin_options "$folder"
options+=(-G Ninja -DSTICTION_ENABLE_CUDA=ON
  "-DSTICTION_PREBUILT_CUDA=$folder/kernels.tar.xz" -DSTICTION_BUILD_GPU_FIRST=ON -DSTICTION_ENABLE_AVX2=OFF -DSTICTION_ENABLE_TBB=OFF
  -DSTICTION_AMD_LIBRARY= -DSTICTION_METIS_LIBRARY= "-DCMAKE_EXE_LINKER_FLAGS=-static-libstdc++ -static-libgcc")
for part in TESTS TOOLS BENCH C EXAMPLES; do options+=("-DSTICTION_BUILD_$part=OFF"); done
cmake "${options[@]}" > /dev/null
cmake --build "$folder" --target gpu_first -j "$jobs" | show_progress
strip -o "$folder/gpu_first.stripped" "$folder/tools/gpu_first/gpu_first"
rm -rf "$pack/batches" "$pack/manifest.txt"
xz -T 0 -6 -c "$folder/gpu_first.stripped" > "$pack/gpu_first.xz"

say "batches"
mkdir -p "$pack/batches"
if cmake --build "$folder" --target help | grep -q pack_batches; then
  cmake --build "$folder" --target pack_batches -j "$jobs" > /dev/null
  "$folder/tools/gpu_first/pack_batches" "$pack/batches" "$data"/{g1,humanoid,leap_hand}.h5
else
  note "no HDF5 here: no recorded robots are compared or timed"
fi
install -m 644 "$root/tools/gpu_first/hashes.csv" "$pack/hashes.csv"
install -m 755 "$root/tools/gpu_first/run.sh" "$pack/run.sh"
python3 "$root/tools/gpu_first/pack_manifest.py" write "$pack" --sources "$sources" --note "kernels left out: ${without:-none}" \
  --note "commit $(git -C "$root" rev-parse --short HEAD 2> /dev/null || echo unknown)"

say "check"
bytes=$(find "$pack" -type f -printf '%s\n' | awk '{sum += $1} END {print sum + 0}')
note "$pack: $bytes bytes of $most_bytes, made in $((SECONDS - begin)) s"
[ "$bytes" -le "$most_bytes" ] || { echo "pack_for_gpu.sh: more than $most_bytes bytes" >&2; exit 1; }
found=$(mktemp -d)
trap 'rm -rf "$found"' EXIT
env -C "$found" STICTION_GPU_DEVICE=cpu STICTION_GPU_SIZE=small "$pack/run.sh" "$found" > "$found/said" ||
  { cat "$found/said"; exit 1; }
note "$(head -n 1 "$found/summary.txt")"
