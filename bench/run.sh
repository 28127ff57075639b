#!/usr/bin/env bash
# Every benchmark, into bench/results/<machine>/: headline.csv (8 contacts, 4096 environments against a naive loop),
# bodies.csv, islands.csv, warm_start.csv, ratio.csv (the same over sizes), solvers.csv, baselines.csv. Line 1
# of each is the command, the machine stands below it. About four minutes on two idle cores.
#
#   bench/run.sh [BUILD]                 BUILD: build folder, default build-bench (configured and built if needed)
#   MACHINE=my-laptop bench/run.sh       the name of the results' folder, default: processor and cores
#   QUICK=1 bench/run.sh                 the headline only, in under a minute
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${1:-build-bench}
if [ ! -f "$build/CMakeCache.txt" ]; then
  cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_BUILD_TESTS=OFF \
    -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_BUILD_BENCH=ON
fi
cmake --build "$build" --target bench_bodies bench_body_newton bench_classes bench_islands bench_ratio bench_solvers bench_baselines

model=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
number=$(sed -n 's/^model[[:space:]]*: //p' /proc/cpuinfo | head -n 1)
default=$(echo "$model model $number $(nproc) cores" | sed 's/([A-Za-z]*)//g' | tr -cs '[:alnum:]' '-' |
  tr '[:upper:]' '[:lower:]' | sed 's/^-//; s/-$//')
results=bench/results/${MACHINE:-$default}
mkdir -p "$results"
STICTION_GIT_ID=$(git describe --always --dirty 2> /dev/null || echo unknown)
export STICTION_GIT_ID

"$build/bench/bench_ratio" --contacts 8 --envs 4096 --precision f32 --repeats 9 --csv "$results/headline.csv"
if [ -n "${QUICK:-}" ]; then
  echo "results: $results (headline only)"
  exit
fi
if cmake --build "$build" --target help | grep -q bench_warm_start; then  # not without HDF5
  cmake --build "$build" --target bench_warm_start bench_derivative
  "$build/bench/bench_warm_start" --csv "$results/warm_start.csv"
  "$build/bench/bench_derivative" --csv "$results/derivative.csv"
fi
"$build/bench/bench_bodies" --csv "$results/bodies.csv"
"$build/bench/bench_body_newton" --csv "$results/body_newton.csv"
"$build/bench/bench_classes" --csv "$results/classes.csv"
"$build/bench/bench_islands" --csv "$results/islands.csv"
"$build/bench/bench_ratio" --csv "$results/ratio.csv"
"$build/bench/bench_solvers" --csv="$results/solvers.csv" --benchmark_min_time=0.05
"$build/bench/bench_baselines" --csv="$results/baselines.csv" --benchmark_min_time=0.05
echo "results: $results"
