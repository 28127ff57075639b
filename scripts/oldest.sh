#!/usr/bin/env bash
# Installs the wheel for Python 3.11 that manylinux.sh has built into Debian 11 and uses it there: with glibc 2.31 the oldest
# system that a Debian mirror delivers. Its own Python is too old, so that of Debian 12 is compiled there, without optimisation
# and without OpenSSL: NumPy's wheel is fetched outside. Works in build-manylinux/oldest.
# The last line is: N passed, M failed, K skipped; exit status 77 where root, mmdebstrap, Debian or PyPI is missing.
#
#   scripts/oldest.sh [WHEEL.whl]
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
# shellcheck source-path=SCRIPTDIR source=systems.sh
. "$root/scripts/systems.sh"

work=${STICTION_MANYLINUX_DIR:-$root/build-manylinux}
oldest=$work/oldest

skip() {
  echo "SKIPPED: no wheel was used on an older glibc, $*"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
}

fetch_source() {
  curl -sSf -m 300 -o "$work/python.tar.gz" "$mirror/pool/main/p/python3.11/python3.11_3.11.2.orig.tar.gz"
}

make_python() {
  mkdir -p "$oldest/python" && tar xf "$work/python.tar.gz" -C "$oldest/python" --strip-components 1 &&
    in_system oldest bash -c "cd /python && ./configure -q --prefix=/usr/local --disable-test-modules CFLAGS='-O0 -g0' &&
      make -j $jobs && make install"
}

fetch_numpy() {
  python3 -m venv "$work/fetcher" && "$work/fetcher/bin/pip" download --quiet --disable-pip-version-check --only-binary :all: \
    --no-deps --python-version 3.11 --platform manylinux_2_28_x86_64 -d "$work/numpy" numpy
}

wheel=${1:-$(find "$work/wheels" -name '*-cp311-cp311-*.whl' 2> /dev/null | head -n 1)}
[ -f "$wheel" ] || skip "scripts/manylinux.sh bookworm has not built one"
reason=$(can_make_systems) || skip "$reason"
mkdir -p "$work/numpy"
say "oldest: system"
if [ ! -x "$oldest/usr/local/bin/python3.11" ]; then
  quiet "$work/oldest.log" fetch_source || skip "Debian does not deliver Python's source"
  quiet "$work/oldest.log" make_system oldest bullseye gcc libc6-dev make zlib1g-dev || skip "Debian does not deliver bullseye"
  say "oldest: Python"
  quiet "$work/oldest.log" make_python
fi
quiet "$work/oldest.log" fetch_numpy || skip "PyPI does not deliver numpy"
cp "$wheel" "$work/numpy/"

say "oldest: use"
in_system oldest bash -c 'rm -rf /venv && python3.11 -m venv /venv && /venv/bin/python -c "import platform; print(*platform.libc_ver())"'
begin=$(date +%s%N)
in_system oldest /venv/bin/pip install --quiet --disable-pip-version-check --no-index --find-links /out/numpy stiction
note "pip install: $((($(date +%s%N) - begin) / 1000000)) ms"
in_system oldest /venv/bin/python /src/python/tests/wheel.py "/out/numpy/$(basename "$wheel")" /src
