#!/usr/bin/env bash
# Collects in .carry/ what scripts/gpu_check.sh uses on a machine that has a GPU, few minutes and no network:
#
#   stiction_cuda_sm90.tar.xz   the kernels' objects (scripts/prebuild_cuda.sh; an hour of one core the first time)
#   gpu_first.xz                the program, linked with them; it needs a C library no older than this machine's
#   batches/                    recorded robots for it, which need no HDF5
#   robots/, wheels/            recordings, and h5py for Python 3.12, for bench/peers/gpu.py; left out where they cannot be
#                               had, or where all would be too large with them
#
# Then tries it: the archive is taken by a build, the program runs and finds the committed hashes on the CPU, and all that
# travels (tracked files and .carry) is under 60 MiB. Git ignores the folder.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

carry=$root/.carry
folder=${STICTION_PACK_DIR:-$root/build-carried}
data=${STICTION_SHARED_DIR:-$root/../shared}/data/mujoco
most_mib=60
mkdir -p "$carry"

say "kernels"
"$root/scripts/prebuild_cuda.sh" "$carry/stiction_cuda_sm90.tar.xz"

say "gpu_first"
# With no library of its own but the C library's: that machine has others, or none. The CPU's kernels are those for any
# x86-64: there it is only compared with.
begin_options "$folder"
options+=(-G Ninja -DSTICTION_ENABLE_CUDA=ON
  "-DSTICTION_PREBUILT_CUDA=$carry/stiction_cuda_sm90.tar.xz" -DSTICTION_BUILD_GPU_FIRST=ON -DSTICTION_ENABLE_AVX2=OFF -DSTICTION_ENABLE_TBB=OFF
  -DSTICTION_AMD_LIBRARY= -DSTICTION_METIS_LIBRARY= "-DCMAKE_EXE_LINKER_FLAGS=-static-libstdc++ -static-libgcc")
for part in TESTS TOOLS BENCH C EXAMPLES; do options+=("-DSTICTION_BUILD_$part=OFF"); done
cmake "${options[@]}" > /dev/null
cmake --build "$folder" --target gpu_first -j "$jobs"
strip -o "$folder/gpu_first.stripped" "$folder/tools/gpu_first/gpu_first"
xz -T 0 -9e -c "$folder/gpu_first.stripped" > "$carry/gpu_first.xz"  # two minutes of a core for a fifth less

say "recordings"
rm -rf "$carry/batches" "$carry/robots"
mkdir -p "$carry/batches" "$carry/robots"
if cmake --build "$folder" --target pack_batches -j "$jobs" > /dev/null; then
  "$folder/tools/gpu_first/pack_batches" "$carry/batches" "$data"/{humanoid,g1,go1,leap_hand,franka_cube}.h5
else
  note "no HDF5 here: no recorded robots are timed"
fi
for name in humanoid g1; do
  if [ -f "$data/$name.h5" ]; then install -m 644 "$data/$name.h5" "$carry/robots/"; else note "$data/$name.h5 is not here"; fi
done
if ! compgen -G "$carry/wheels/*.whl" > /dev/null; then
  python3 -m pip download --quiet --no-deps --only-binary=:all: --python-version 3.12 --platform manylinux_2_28_x86_64 \
    --platform manylinux2014_x86_64 -d "$carry/wheels" h5py > "$folder/wheels.log" 2>&1 ||
    note "no Python packages for peers: $(tail -n 1 "$folder/wheels.log")"
fi

say "check"
xz -dc "$carry/gpu_first.xz" > "$folder/gpu_first.carried"
chmod +x "$folder/gpu_first.carried"
"$folder/gpu_first.carried" --device cpu --size small --hashes "$root/tools/gpu_first/hashes.csv" --batches "$carry/batches" |
  tail -n 1
tracked=$(git -C "$root" ls-files -z --cached --others --exclude-standard | (cd "$root" && xargs -0 stat -c %s 2> /dev/null) | awk '{sum += $1} END {print sum + 0}')
travelling_mib() {
  carried=$(find "$carry" -type f -printf '%s\n' | awk '{sum += $1} END {print sum + 0}')
  echo $(((tracked + carried + (1 << 20) - 1) >> 20))
}
if [ "$(travelling_mib)" -gt "$most_mib" ]; then
  note "no recordings and h5py for peers: with them $(travelling_mib) MiB would travel"
  rm -rf "$carry/robots" "$carry/wheels"
fi
du -sm "$carry"/* | sed 's/^/   /'
mib=$(travelling_mib)
echo "$carry and the repository: $mib MiB of $most_mib"
[ "$mib" -le "$most_mib" ] || { echo "pack_for_gpu.sh: more than $most_mib MiB" >&2; exit 1; }
