#!/usr/bin/env bash
# Compiles every CUDA kernel for H100 and H200, fully optimised, and packs the objects into one archive. A build with
# -DSTICTION_PREBUILT_CUDA=ARCHIVE takes them and needs no nvcc. It is for a machine with a GPU and few minutes.
#
#   scripts/prebuild_cuda.sh [ARCHIVE]       default: .carry/stiction_cuda_sm90.tar.xz
#
# An hour of one core, so at the lowest priority. Each object is kept in build-prebuilt/ as it is done. A second call
# goes on where the first was stopped, and later compiles what has changed. STICTION_PREBUILD_JOBS says how many at a
# time. Kernels of the sources in STICTION_PREBUILD_WITHOUT (cuda_pgs,cuda_nsgs) are left out: a launch of one fails.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

archive=${1:-$root/.carry/stiction_cuda_sm90.tar.xz}
folder=${STICTION_PREBUILD_DIR:-$root/build-prebuilt}
without=${STICTION_PREBUILD_WITHOUT:-}
begin=$SECONDS
find_nvcc
[ -n "${CUDACXX:-}" ] || { echo "prebuild_cuda.sh: nvcc is needed (set CUDACXX); scripts/get_cuda.sh fetches it" >&2; exit 2; }

begin_options "$folder"
# Machine code is left as it is: the archive's own compression makes it half as large as nvcc's does.
options+=(-G Ninja -DSTICTION_ENABLE_CUDA=ON -DCMAKE_CUDA_FLAGS=--no-compress
  -DCMAKE_CUDA_ARCHITECTURES=90-real -DSTICTION_BUILD_GPU_FIRST=ON)
for part in TESTS TOOLS BENCH C EXAMPLES; do options+=("-DSTICTION_BUILD_$part=OFF"); done
cmake "${options[@]}" > /dev/null
mapfile -t objects < <(python3 "$root/tools/prebuilt_cuda.py" objects "$folder" --without "$without")
say "${#objects[@]} objects"
nice -n 19 ninja -C "$folder" -j "${STICTION_PREBUILD_JOBS:-$jobs}" "${objects[@]}"
nvcc=$("$CUDACXX" --version | sed -n 's/.*, V\([0-9.]*\)$/\1/p')
python3 "$root/tools/prebuilt_cuda.py" pack "$folder" "$archive" --nvcc "$nvcc" --architectures 90 --without "$without"
note "$((SECONDS - begin)) s"

# The needs of the solvers' machine code must not have grown (tests/ptx/README.md); a table of another nvcc is
# skipped.
[ -z "$without" ] || exit 0
mapfile -t solvers < <(printf '%s\n' "${objects[@]}" | grep stiction_cuda_translated | sed "s#^#$folder/#")
status=0
python3 "$root/tools/check_ptxas.py" --arch 90 --budget "$root/cuda/native/solver_budget.csv" --compiler "$nvcc" "${solvers[@]}" ||
  status=$?
case $status in 0 | 77) ;; *) exit "$status" ;; esac
