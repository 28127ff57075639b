#!/usr/bin/env bash
# Builds the fuzzers with clang and the address and undefined-behaviour sanitizers, writes seeds and runs each fuzzer.
# A finding is exit status 1; the input that caused it lies in build-fuzz/findings.
#
#   scripts/fuzz.sh [SECONDS]        default: 60 for each fuzzer
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

seconds=${1:-60}
build=${STICTION_FUZZ_DIR:-$root/build-fuzz}
say "fuzzers: packages"
install_packages "${build_packages[@]}" "clang: no fuzzers" "libclang-rt-14-dev: no fuzzers" "libgtest-dev: no fuzzers"
compiler=${CXX_FOR_FUZZING:-clang++}
command -v "$compiler" > /dev/null || { echo "SKIPPED: no $compiler, so nothing was fuzzed"; exit 77; }

say "fuzzers: build"
flags="-O1 -fno-omit-frame-pointer -fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=undefined"
options=(-S "$root" -B "$build" -G Ninja "-DCMAKE_CXX_COMPILER=$compiler" -DCMAKE_BUILD_TYPE=None
  "-DCMAKE_CXX_FLAGS=$flags" -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_EMULATED_DEVICE=OFF -DSTICTION_ENABLE_AVX2=OFF
  -DSTICTION_ENABLE_TBB=OFF -DSTICTION_BUILD_BENCH=OFF -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_ENABLE_FUZZERS=ON)
command -v ccache > /dev/null && options+=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
cmake "${options[@]}" > "$build.log" 2>&1 || { cat "$build.log"; exit 1; }
build_targets fuzz_read fuzz_seeds

say "fuzzers: $seconds s each"
corpus=$build/corpus findings=$build/findings
mkdir -p "$corpus" "$findings"
"$build/tests/fuzz/fuzz_seeds" "$corpus"
log=$build/fuzz_read.log
status=0
"$build/tests/fuzz/fuzz_read" "$corpus" -max_total_time="$seconds" -rss_limit_mb=2048 -malloc_limit_mb=1000000 -timeout=25 \
  -artifact_prefix="$findings/" -print_final_stats=1 > "$log" 2>&1 || status=1
runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
coverage=$(grep -oE 'cov: [0-9]+' "$log" | tail -n 1)
note "fuzz_read: ${runs:-?} inputs, ${coverage:-cov: ?} edges"
[ "$status" = 0 ] || { tail -n 60 "$log"; note "findings: $(ls "$findings")"; }
exit "$status"
