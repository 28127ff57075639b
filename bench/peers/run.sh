#!/usr/bin/env bash
# Every comparison on the CPU: builds what is needed into a folder of its own and runs bench/peers/run.py, which takes the
# other arguments (--judge, --data, --python-package, --parts, ...).
#
# The parts that need the Python package need nanobind to build it (or --python-package, where it is built already).
#
#   bench/peers/run.sh [BUILD] --judge check_solution.py --data DATA         BUILD: default build-bench
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
build=build-bench
if [ $# -gt 0 ] && [ "${1#--}" = "$1" ]; then
  build=$1
  shift
fi
python=python3
if [ -x .venv/bin/python ]; then
  python=$PWD/.venv/bin/python
fi
with_python=()
if "$python" -c "import nanobind" 2> /dev/null; then
  with_python=(-DSTICTION_BUILD_PYTHON=ON "-DPython_EXECUTABLE=$(command -v "$python")")
fi
if [ ! -f "$build/CMakeCache.txt" ]; then
  cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTICTION_ENABLE_CUDA=OFF -DSTICTION_BUILD_TESTS=OFF \
    -DSTICTION_BUILD_EXAMPLES=OFF -DSTICTION_BUILD_BENCH=ON "${with_python[@]}"
fi
targets=(bench_ratio bench_body_file stiction_cli)
if grep -q "^STICTION_BUILD_PYTHON:BOOL=ON" "$build/CMakeCache.txt"; then
  targets+=(stiction_python)
fi
cmake --build "$build" --target "${targets[@]}"
exec "$python" bench/peers/run.py --build "$build" "$@"
