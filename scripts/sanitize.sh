#!/usr/bin/env bash
# Runs tests of the library under the sanitizers, each in a build of its own. The last line is: N passed, M failed, K skipped
#
#   scripts/sanitize.sh address        the C++ and C tests: heap and globals everywhere, undefined behaviour in core/
#   scripts/sanitize.sh thread         what runs on several threads: pools, teams, the emulated device: data races
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

kind=${1:-address}
case $kind in
  address)
    install_packages "${build_packages[@]}" "${clang_packages[@]}" "libgtest-dev: no tests"
    if ! have_clang; then
      echo "SKIPPED: no clang++, so nothing ran under the address sanitizer"
      echo "0 passed, 0 failed, 1 skipped"
      exit 77
    fi
    targets=()
    # determinism_test_isa and _isa_forms go through packs of every width by themselves. What is left out by name takes
    # minutes and runs no code of the library that others do not.
    chosen=(-L 'unit|algorithm|twin|determinism|c_api' -LE isa
      -E 'golden|twin_test_fallback_chain|unit_test_scenes|algorithm_test_.*_table|algorithm_test_multigrid$')
    export ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=0:quarantine_size_mb=32
    ;;
  thread)
    flags="-O1 -g1 -fsanitize=thread"
    # Threads do not depend on vectors, and oneTBB is not instrumented. Without precompiled headers a file that does not
    # include what it uses fails.
    options=(-DSTICTION_ENABLE_AVX2=OFF -DSTICTION_ENABLE_TBB=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
      "-DCMAKE_C_FLAGS=$flags" "-DCMAKE_CXX_FLAGS=$flags")
    targets=(determinism_test_threads determinism_test_bodies determinism_test_worlds unit_test_thread_pool
      unit_test_parallel_for unit_test_solver)
    for solver in $(sed -n 's/^stiction_add_solver(\([a-z0-9_]*\).*/\1/p' "$root/cmake/solvers.cmake"); do
      targets+=("algorithm_test_torture_$solver")
    done
    for file in "$root"/tests/algorithm/test_torture*.cpp "$root"/tests/twin/test_device_*.cpp; do
      case $file in *_golden.cpp | *_failures.cpp) continue ;; esac  # minutes, of code that others run
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
case $kind in
  address) configure_address_sanitized || exit 1 ;;
  thread) configure_sanitized "${STICTION_SANITIZE_DIR:-$root/build-sanitize-thread}" "${options[@]}" || exit 1 ;;
esac
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
