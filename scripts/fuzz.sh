#!/usr/bin/env bash
# Builds the fuzzers with clang and the address and undefined-behaviour sanitizers, writes seeds and runs each fuzzer
# (tests/fuzz/README.md). A finding is exit status 1; the input that caused it lies in build-fuzz/findings.
#
#   scripts/fuzz.sh [SECONDS] [FUZZER ...]        default: 60 for each of fuzz_read fuzz_c_api fuzz_solve
#   scripts/fuzz.sh --runs COUNT [FUZZER ...]     a campaign: so many executions of each
#
# The seed is STICTION_FUZZ_SEED, else 1: without a corpus of before, the same build goes through the same inputs, as far as the
# seconds reach. A campaign draws one, and the log says which.
#
# Inputs that reach new code are kept in build-fuzz/corpus and used again.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

limit=-max_total_time=60
seed=${STICTION_FUZZ_SEED:-1}
effort="60 s"
if [ "${1:-}" = --runs ]; then
  limit=-runs=${2:?--runs needs a count}
  effort="$2 runs"
  seed=${STICTION_FUZZ_SEED:-0}  # libFuzzer draws one
  shift 2
elif [ $# -gt 0 ] && [[ $1 =~ ^[0-9]+$ ]]; then
  limit=-max_total_time=$1
  effort="$1 s"
  shift
fi
fuzzers=("$@")
[ $# -gt 0 ] || fuzzers=(fuzz_read fuzz_c_api fuzz_solve)

build=${STICTION_FUZZ_DIR:-$root/build-fuzz}
say "fuzzers: packages"
install_packages "${build_packages[@]}" "clang: no fuzzers" "libclang-rt-14-dev: no fuzzers" "libgtest-dev: no fuzzers"
compiler=${CXX_FOR_FUZZING:-clang++}
if ! command -v "$compiler" > /dev/null; then
  echo "SKIPPED: no $compiler, so nothing was fuzzed"
  echo "0 passed, 0 failed, ${#fuzzers[@]} skipped"
  exit 77
fi

say "fuzzers: build"
# Undefined behaviour traps, and addresses are checked by calls: a kernel compiles in two thirds of the time. A trap cannot
# compare types of functions by name, as it has to across shared libraries. Checks of pointers alone, which addresses are
# besides, make a kernel take two and a half times as long. Only core/ and c_api/ have them, which read what users give.
# Scratch holds other numbers every time.
pointers=null,alignment,object-size,pointer-overflow
flags="-O1 -fno-omit-frame-pointer -fsanitize=address,undefined,fuzzer-no-link -fno-sanitize=function,$pointers
  -fsanitize-trap=undefined -mllvm -asan-instrumentation-with-call-threshold=0 -DSTICTION_NOISY_SCRATCH"
flags=${flags//$'\n'/}
begin_options "$build"
options+=(-G Ninja "-DCMAKE_CXX_COMPILER=$compiler" -DCMAKE_BUILD_TYPE=None
  "-DCMAKE_CXX_FLAGS=$flags" -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_EMULATED_DEVICE=OFF -DSTICTION_ENABLE_AVX2=OFF
  -DSTICTION_ENABLE_TBB=OFF -DSTICTION_BUILD_BENCH=OFF -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_ENABLE_FUZZERS=ON
  "-DSTICTION_CORE_OPTIONS=-fsanitize=$pointers")
mkdir -p "$build"
log=$build/configure.log
cmake "${options[@]}" > "$log" 2>&1 || { cat "$log"; echo "0 passed, 1 failed, 0 skipped"; exit 1; }
build_targets "${fuzzers[@]}" fuzz_seeds || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }

# Inputs of each: files for the readers, bytes that choose calls and numbers for the others.
say "fuzzers: $effort each, $jobs at a time"
findings=$build/findings
mkdir -p "$findings"
fuzz() {
  local fuzzer=$1 own=(-max_len=512 -len_control=0) folders=("$build/corpus/$1")
  mkdir -p "${folders[0]}"
  if [ "$fuzzer" = fuzz_read ]; then
    rm -rf "$build/seeds"
    "$build/tests/fuzz/fuzz_seeds" "$build/seeds" || return 1
    own=("-dict=$root/tests/fuzz/hdf5.dict")
    folders+=("$build/seeds")
  fi
  # Weighing inputs by how rare their features are (entropic) takes 80 % of the time where there are 10^5 features. Without
  # it there are 5 times as many executions, and more edges, in the same time.
  "$build/tests/fuzz/$fuzzer" "${folders[@]}" "$limit" -seed="$seed" -entropic=0 "${own[@]}" -rss_limit_mb=2048 -malloc_limit_mb=1000000 -timeout=60 \
    -artifact_prefix="$findings/$fuzzer-" -print_final_stats=1
}
declare -A process
for fuzzer in "${fuzzers[@]}"; do
  while [ "$(jobs -rp | wc -l)" -ge "$jobs" ]; do sleep 1; done
  fuzz "$fuzzer" > "$build/$fuzzer.log" 2>&1 &
  process[$fuzzer]=$!
done
passed=0 failed=0
for fuzzer in "${fuzzers[@]}"; do
  status=0
  wait "${process[$fuzzer]}" || status=$?
  log=$build/$fuzzer.log
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  coverage=$(grep -aoE 'cov: [0-9]+' "$log" | tail -n 1)
  note "$fuzzer: ${runs:-?} inputs, ${coverage:-cov: ?} edges"
  if [ "$status" = 0 ]; then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    tail -n 60 "$log"
    note "$fuzzer ended with status $status; inputs of findings: $findings/$fuzzer-*"
  fi
done
echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" = 0 ]
