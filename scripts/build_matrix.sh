#!/usr/bin/env bash
# One hash for each batch, solver and precision, whatever built it. Builds are {g++, clang++} x {-O0, -O3,
# -O3 -march=native}, and -O3 by every other version of them that is installed. They run with 1 and 2 threads, the kernels
# of each instruction set, and the environments in three other orders. Prints one table; exit status 1 if any hash differs.
# Builds into build-matrix/ and leaves every single hash in build-matrix/hashes.csv.
#
#   scripts/build_matrix.sh [BATCH.h5 ...]          default: examples/data/*.h5
#   SOLVERS="npgs pgs" PRECISIONS=f64 ITERATIONS=50 COMPILERS=g++-11 LEVELS="-O0;-O2" scripts/build_matrix.sh
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# Version 13 of clang is older than what is supported.
installed() { compgen -c | grep -E '^(g\+\+-1[1-9]|clang\+\+-(1[4-9]|2[0-9]))$' | sort -uV | tr '\n' ' ' || true; }

read -r -a solvers <<< "${SOLVERS:-npgs subspace pgs apgd nsgs jacobi admm newton ipm auto}"
read -r -a precisions <<< "${PRECISIONS:-f32 f64}"
read -r -a compilers <<< "${COMPILERS:-g++ clang++ $(installed)}"
iterations=${ITERATIONS:-200}
if [ $# -gt 0 ]; then batches=("$@"); else batches=("$root"/examples/data/*.h5); fi
for batch in "${batches[@]}"; do
  [ -f "$batch" ] || { echo "build_matrix.sh: $batch is not there" >&2; exit 2; }
done

matrix=$root/build-matrix
mkdir -p "$matrix"
builds=()
for compiler in "${compilers[@]}"; do
  command -v "$compiler" > /dev/null || { note "$compiler is not here: its rows are missing from the table"; continue; }
  case $compiler in
    g++ | clang++) levels=("-O0" "-O3 -DNDEBUG" "-O3 -DNDEBUG -march=native") ;;
    *) levels=("-O3 -DNDEBUG") ;;
  esac
  [ -z "${LEVELS:-}" ] || IFS=';' read -r -a levels <<< "$LEVELS"
  for flags in "${levels[@]}"; do
    name=${compiler//+/x}$(sed 's/ -DNDEBUG//; s/[ =]//g' <<< "$flags")
    say "$compiler $flags"
    begin_options "$matrix/$name"
    options+=(-G Ninja "-DCMAKE_CXX_COMPILER=$compiler" -DCMAKE_BUILD_TYPE=None
      "-DCMAKE_CXX_FLAGS=$flags" -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_BUILD_TESTS=OFF -DSTICTION_BUILD_BENCH=OFF
      -DSTICTION_BUILD_EXAMPLES=OFF)
    cmake "${options[@]}" > "$matrix/$name.log" || { cat "$matrix/$name.log"; exit 1; }
    cmake --build "$matrix/$name" -j "$jobs" --target stiction_cli | tail -n 1
    builds+=("$name")
  done
done
[ ${#builds[@]} -gt 0 ] || { echo "build_matrix.sh: none of ${compilers[*]} is here" >&2; exit 2; }

say "solve"
csv=$matrix/hashes.csv
echo "batch,solver,precision,build,threads,permute,kernels,hash" > "$csv"
for build in "${builds[@]}"; do
  for batch in "${batches[@]}"; do
    for solver in "${solvers[@]}"; do
      for precision in "${precisions[@]}"; do
        for run in "1 - widest" "2 - widest" "2 1 avx2" "2 2 baseline" "2 3 widest"; do
          read -r threads permute isa <<< "$run"
          options=(--solver "$solver" --precision "$precision" --device cpu --threads "$threads" --tolerance 1e-6
            --max-iterations "$iterations" --quiet --json "$matrix/report.json")
          [ "$permute" = - ] || options+=(--permute "$permute")
          status=0
          STICTION_ISA=$isa "$matrix/$build/bin/stiction" solve "$batch" "${options[@]}" || status=$?
          [ "$status" -le 1 ] || exit "$status"  # 1: some environment missed the tolerance, its bits count all the same
          hash=$(sed -n 's/.*"hash": *"\([0-9a-f]*\)".*/\1/p' "$matrix/report.json")
          [ -n "$hash" ] || { echo "build_matrix.sh: no hash in the report of $build, $batch, $solver" >&2; exit 1; }
          echo "$(basename "$batch" .h5),$solver,$precision,$build,$threads,$permute,$isa,$hash" >> "$csv"
        done
      done
    done
  done
  note "$build: $(grep -c ",$build," "$csv") runs"
done

say "hashes"
awk -F, '
  NR > 1 {
    key = $1 "," $2 "," $3
    if (!(key in first)) { first[key] = $8; order[++keys] = key }
    runs[key]++
    if ($8 != first[key]) { other[key]++; print "different: " $0 " (first: " first[key] ")" }
  }
  END {
    printf "%-20s %-8s %-4s %-17s %5s %9s\n", "batch", "solver", "", "hash", "runs", "different"
    for (k = 1; k <= keys; k++) {
      split(order[k], part, ",")
      printf "%-20s %-8s %-4s %-17s %5d %9d\n", part[1], part[2], part[3], first[order[k]], runs[order[k]], other[order[k]] + 0
      bad += other[order[k]]
    }
    exit bad > 0
  }' "$csv"
note "builds: ${builds[*]}; threads 1 and 2; orders as in the file and three permutations; kernels baseline, avx2 and the widest"
