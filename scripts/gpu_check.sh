#!/usr/bin/env bash
# The first minutes on a machine with an NVIDIA GPU, and without a network. Two commands, the verdict first:
#
#   scripts/gpu_check.sh verdict [FOLDER]    are the GPU's bits the CPU's? every check, the most telling first
#   scripts/gpu_check.sh tune [FOLDER]       times: classes, robots, limits of classes; a profile; peers
#
# Results are appended to FOLDER (default: out) as they come: verdict.jsonl, tune.jsonl, limits.csv, logs. Exit status of
# `verdict`: 0 where all is right, else 1. STICTION_GPU_SECONDS limits a command (default 340), STICTION_GPU_DEVICE=ptx
# rehearses it without a GPU (tools/gpu_first/README.md).
#
# What scripts/pack_for_gpu.sh collected in .carry/ is used: gpu_first itself, else the kernels' objects (needs CMake,
# ninja and g++, a minute and a half on 16 cores), else nvcc compiles all (many minutes).
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() { echo "gpu_check.sh: say verdict or tune, then a folder for the results" >&2; exit 2; }
case $#:${1:-} in 1:verdict | 2:verdict | 1:tune | 2:tune) command=$1 ;; *) usage ;; esac
out=${2:-$root/out}
mkdir -p "$out"
out=$(cd "$out" && pwd)
device=${STICTION_GPU_DEVICE:-cuda}
seconds=${STICTION_GPU_SECONDS:-340}
begin=$SECONDS
carry=$root/.carry
build=${STICTION_GPU_BUILD_DIR:-$root/build-gpu}
left() { echo $((seconds - SECONDS + begin)); }

configure() {  # options ...: for this GPU, or with the objects that were carried along
  local options
  begin_options "$build"
  options+=(-DSTICTION_ENABLE_CUDA=ON
    -DSTICTION_BUILD_TESTS=OFF -DSTICTION_BUILD_BENCH=OFF -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_BUILD_TOOLS=OFF
    -DSTICTION_BUILD_C=OFF -DSTICTION_WARNINGS_AS_ERRORS=OFF -DSTICTION_CPU_KERNELS=native "$@")
  local archives=("$carry"/stiction_cuda_sm*.tar.xz) capability
  find_nvcc
  if [ -e "${archives[0]}" ]; then
    options+=("-DSTICTION_PREBUILT_CUDA=${archives[0]}")
  else
    capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2> /dev/null | head -n 1 | tr -d '. ' || true)
    case $capability in '' | *[!0-9]*) capability=90 ;; esac
    options+=("-DCMAKE_CUDA_ARCHITECTURES=$capability-real")
  fi
  if command -v ninja > /dev/null; then options+=(-G Ninja); fi
  cmake "${options[@]}"
}

program=$build/tools/gpu_first/gpu_first
if [ -f "$carry/gpu_first.xz" ] && [ -z "${STICTION_GPU_BUILD:-}" ]; then
  mkdir -p "$build"
  xz -dc "$carry/gpu_first.xz" > "$build/gpu_first" && chmod +x "$build/gpu_first"
  if "$build/gpu_first" --list > /dev/null 2>&1; then program=$build/gpu_first; else note "the carried gpu_first does not run here"; fi
fi
if [ "$program" != "$build/gpu_first" ]; then
  say "build"
  if ! (configure -DSTICTION_BUILD_GPU_FIRST=ON && cmake --build "$build" --target gpu_first -j "$jobs") > "$out/build.log" 2>&1; then
    tail -n 60 "$out/build.log"
    exit 1
  fi
fi
note "gpu_first is there after $((SECONDS - begin)) s"

check() {  # FILE options ...: runs gpu_first
  local file=$1
  shift
  "$program" --device "$device" --out "$out/$file" --hashes "$root/tools/gpu_first/hashes.csv" --batches "$carry/batches" \
    --seconds "$(left)" "$@"
}

verdict() {
  local status=0
  check verdict.jsonl --skip robot,tune > "$out/verdict.log" 2>&1 || status=1
  grep -vE '^(right| )' "$out/verdict.log" | cut -c 1-400 || true
  say "$((SECONDS - begin)) s"
  return $status
}

profile() {  # what a kernel waits for, where the machine lets it be seen
  command -v ncu > /dev/null || { note "ncu is not here"; return 0; }
  local name
  for name in thread_small dense_warp dense_large; do
    [ "$(left)" -gt 60 ] || { note "no time to profile $name"; return 0; }
    timeout 40 ncu --clock-control none --section SpeedOfLight --section WarpStateStats --section Occupancy \
      --section MemoryWorkloadAnalysis --launch-count 6 --csv "$program" --device cuda --run "time/$name" \
      --hashes "$root/tools/gpu_first/hashes.csv" > "$out/ncu_$name.csv" 2>&1 || note "ncu: $(tail -n 1 "$out/ncu_$name.csv")"
  done
}

# The Python package in the background, since peers are last; its compiler runs at the lowest priority.
build_package() {
  nice -n 19 bash -c "$(declare -f begin_options configure find_nvcc note); root='$root' build='$build' carry='$carry'
    configure -DSTICTION_BUILD_PYTHON=ON && cmake --build '$build' --target stiction_python -j $jobs" > "$out/package.log" 2>&1
}

peers() {  # PROCESS: waits for the package, then races what STICTION_GPU_PEERS names on recorded robots
  local path=$build/python files=("$carry"/robots/*.h5)
  wait "$1" || { note "the Python package was not built; see package.log"; return 0; }
  [ -e "${files[0]}" ] || { note "no recordings were carried along: no peers"; return 0; }
  [ "$(left)" -gt 30 ] || { note "no time for peers"; return 0; }
  if compgen -G "$carry/wheels/*.whl" > /dev/null; then
    python3 -m pip install --no-index --no-deps --quiet --target "$build/wheels" "$carry"/wheels/*.whl >> "$out/package.log" 2>&1 || true
    path=$path:$build/wheels
  fi
  PYTHONPATH=$path timeout "$(left)" python3 "$root/bench/peers/gpu.py" "${files[@]}" --peers "${STICTION_GPU_PEERS:-torch}" --envs 1024,8192 \
    --goals 1e-4 --results "$out" --images "$out" > "$out/peers.log" 2>&1 || note "peers: $(tail -n 1 "$out/peers.log")"
}

tune() {
  local package=
  if [ "$device" = cuda ]; then build_package & package=$!; fi
  check tune.jsonl --only device,time/,robot,tune > "$out/tune.log" 2>&1 || note "some check failed; see tune.log"
  python3 "$root/tools/gpu_limits.py" "$out/tune.jsonl" "$out/limits.csv" || true
  if [ "$device" = cuda ]; then
    peers "$package"
    profile
  fi
  say "$((SECONDS - begin)) s"
}

"$command"
