#!/usr/bin/env bash
# Runs tests of the library under the sanitizers, each in a build of its own. The last line is: N passed, M failed, K skipped
#
#   scripts/sanitize.sh address        the C++ and C tests: heap and globals everywhere, undefined behaviour in core/
#   scripts/sanitize.sh thread         what runs on several threads: pools, teams, the emulated device: data races
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# A test that only calls the library is compiled as test.sh does it. With a compiler's cache, that has been done.
kind=${1:-address}
build=${STICTION_SANITIZE_DIR:-$root/build-sanitize-$kind}
begin_options "$build"
options+=(-G Ninja -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_BUILD_BENCH=OFF
  -DSTICTION_BUILD_TOOLS=OFF -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_BUILD_GPU_FIRST=OFF -DSTICTION_BUILD_TESTS=ON
  -DSTICTION_TEST_TIMEOUT=900)
case $kind in
  address)
    # Checks as calls, and none of the stack: else a kernel takes four times as long to compile. The fuzzers' build checks
    # the stack, and undefined behaviour in kernels.
    # Scratch holds other numbers every time: what is read before it is written shows where bits are compared.
    # Packs are the widest that this machine has: one set of them.
    options+=(-DSTICTION_CPU_KERNELS=native
      "-DSTICTION_LIBRARY_OPTIONS=-O1;-g1;-fno-omit-frame-pointer;-fsanitize=address;SHELL:--param asan-instrumentation-with-call-threshold=0;SHELL:--param asan-stack=0;-DSTICTION_NOISY_SCRATCH"
      "-DSTICTION_CORE_OPTIONS=-fsanitize=undefined;-fno-sanitize-recover=all"
      "-DCMAKE_EXE_LINKER_FLAGS=-fsanitize=address,undefined" "-DCMAKE_SHARED_LINKER_FLAGS=-fsanitize=address,undefined")
    targets=()
    # determinism_test_isa and _isa_forms go through packs of every width by themselves. Tests left out by name take
    # minutes and run no code of the library that others do not.
    chosen=(-L 'unit|algorithm|twin|determinism|c_api' -LE isa
      -E 'golden|twin_test_fallback_chain|unit_test_scenes|algorithm_test_.*_table|algorithm_test_multigrid$')
    # In worlds only the sweeps depend on the instruction set, and tests of bodies go through those of each width.
    # Thousands of spheres find their pairs by the tree that 150 bodies find theirs by.
    export GTEST_FILTER='-*.BitsDoNotDependOnTheInstructionSet*:LargeWorlds.ThousandsOfSpheres*'
    export ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=0:quarantine_size_mb=32 UBSAN_OPTIONS=print_stacktrace=1
    ;;
  thread)
    # Threads do not depend on vectors, and oneTBB is not instrumented. Without precompiled headers a file of the library
    # that does not include what it uses fails.
    options+=(-DSTICTION_ENABLE_AVX2=OFF -DSTICTION_ENABLE_TBB=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
      "-DSTICTION_LIBRARY_OPTIONS=-O1;-g1;-fsanitize=thread" "-DCMAKE_EXE_LINKER_FLAGS=-fsanitize=thread"
      "-DCMAKE_SHARED_LINKER_FLAGS=-fsanitize=thread")
    targets=(determinism_test_threads determinism_test_bodies determinism_test_worlds unit_test_thread_pool
      unit_test_parallel_for unit_test_solver)
    mapfile -t solvers < <(sed -n 's/^stiction_add_solver(\([a-z0-9_]*\).*/\1/p' "$root/cmake/solvers.cmake")
    targets+=("${solvers[@]/#/algorithm_test_torture_}")
    for file in "$root"/tests/algorithm/test_torture*.cpp "$root"/tests/twin/test_device_*.cpp; do
      case $file in  # minutes, of code that others run
        *_golden.cpp | *_failures.cpp | *_replay.cpp | *_trace.cpp) continue ;;
      esac
      targets+=("$(basename "$(dirname "$file")")_$(basename "$file" .cpp)")
    done
    names=$(IFS='|'; echo "${targets[*]}")
    chosen=(-R "^($names)\$")
    export TSAN_OPTIONS=halt_on_error=1:die_after_fork=0
    ;;
  *) echo "sanitize.sh: $kind: give address or thread" >&2; exit 2 ;;
esac

begin=$SECONDS
say "$kind sanitizer: build"
cmake "${options[@]}" > "$build.log" 2>&1 || { cat "$build.log"; echo "0 passed, 1 failed, 0 skipped"; exit 1; }
if [ ${#targets[@]} = 0 ]; then  # what the chosen tests run, and no more: a program takes ten seconds
  programs=$(cmake --build "$build" --target help | sed -n 's/^\([a-z0-9_]*\): phony$/\1/p' | sort)
  mapfile -t targets < <(ctest --test-dir "$build" -N "${chosen[@]}" | sed -n 's/^ *Test *#[0-9]*: //p' | sort | comm -12 - <(echo "$programs"))
fi
build_targets "${targets[@]}" || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
built=$SECONDS
say "$kind sanitizer: tests"
status=0
ctest --test-dir "$build" --output-on-failure -j "$jobs" --no-tests=error --timeout 900 --test-output-size-passed 1000000 \
  --test-output-size-failed 100000 --output-junit "$build/tests.xml" "${chosen[@]}" || status=$?
note "build $((built - begin)) s, tests $((SECONDS - built)) s"
python3 "$root/tools/test_summary.py" "$build/tests.xml" || status=1
exit "$status"
