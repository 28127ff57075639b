#!/usr/bin/env bash
# Fetches NVIDIA's compiler (nvcc), its runtime and CCCL from PyPI into a local prefix, for a machine without a
# CUDA toolkit. Nothing outside the prefix is touched, and no GPU or driver is needed to compile.
#
#   scripts/get_cuda.sh [PREFIX]        default prefix: .cuda in the project; about 270 MB
#
# The last line it prints is the setting to use: export CUDACXX=.../bin/nvcc
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
prefix=${1:-$root/.cuda}
mkdir -p "$prefix"
prefix=$(cd "$prefix" && pwd)

# One toolkit release, so that every machine that runs this script compiles with the same compiler.
packages=("cuda-toolkit[nvcc,crt,nvvm,cudart,cccl]==13.0.2")

fail() { echo "get_cuda.sh: $*" >&2; exit 1; }

case "$(uname -s)-$(uname -m)" in
  Linux-x86_64 | Linux-aarch64) ;;
  *) fail "NVIDIA publishes these wheels for Linux on x86_64 and aarch64; this is $(uname -s) on $(uname -m)" ;;
esac
command -v python3 > /dev/null || fail "python3 is needed to fetch the wheels (Debian: python3 python3-venv)"

find_nvcc() { find "$prefix" -path '*/bin/nvcc' -type f 2> /dev/null | sort | head -n 1; }

works() { [ -n "$1" ] && [ -x "$1" ] && "$1" --version > /dev/null 2>&1; }

nvcc=$(find_nvcc)
if ! works "$nvcc"; then
  pip=(python3 -m pip)
  if ! "${pip[@]}" --version > /dev/null 2>&1; then
    python3 -m venv "$prefix/venv" 2> /dev/null ||
      fail "neither pip nor venv is there (Debian: apt-get install python3-venv)"
    pip=("$prefix/venv/bin/python" -m pip)
  fi
  export PIP_ROOT_USER_ACTION=ignore
  echo "get_cuda.sh: fetching ${packages[*]} into $prefix"
  "${pip[@]}" install --quiet --disable-pip-version-check --no-warn-script-location --only-binary=:all: \
    --upgrade --target "$prefix" "${packages[@]}" ||
    fail "PyPI did not deliver ${packages[*]}; without nvcc the build is CPU-only"
  nvcc=$(find_nvcc)
fi
[ -n "$nvcc" ] || fail "the wheels hold no bin/nvcc"

# The wheels are laid out for Python, nvcc looks for lib64 and for the unversioned runtime.
toolkit=$(dirname "$(dirname "$nvcc")")
[ -e "$toolkit/lib64" ] || ln -s lib "$toolkit/lib64"
if [ ! -e "$toolkit/lib/libcudart.so" ]; then
  runtime=$(cd "$toolkit/lib" && find . -name 'libcudart.so.*' -printf '%f\n' | head -n 1)
  [ -n "$runtime" ] && ln -s "$runtime" "$toolkit/lib/libcudart.so"
fi

"$nvcc" --version | tail -n 2
echo "export CUDACXX=$nvcc"
