#!/usr/bin/env bash
# Reads the conda recipe (packaging/conda/recipe.yaml) by rattler-build and renders its packages; with `build` it builds and
# tests them, too, which takes compilers and libraries from conda-forge. Works in build-conda/.
# The last line is: N passed, M failed, K skipped; exit status 77 where PyPI does not deliver rattler-build.
#
#   scripts/conda.sh [build]
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

work=${STICTION_CONDA_DIR:-$root/build-conda}
mkdir -p "$work"
if ! { [ -x "$work/venv/bin/python" ] || python3 -m venv "$work/venv"; } > /dev/null 2>&1 ||
  ! "$work/venv/bin/pip" install --quiet --disable-pip-version-check --timeout 15 --retries 1 py-rattler-build > "$work/pip.log" 2>&1; then
  echo "SKIPPED: the conda recipe is not read, PyPI does not deliver py-rattler-build"
  echo "0 passed, 0 failed, 1 skipped"
  exit 77
fi
status=0
"$work/venv/bin/python" - "$root" "$work" "${1:-render}" << 'PROGRAM' || status=$?
import pathlib
import re
import sys

from rattler_build import Stage0Recipe, VariantConfig

root, work, what = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
recipe = Stage0Recipe.from_file(str(root / "packaging/conda/recipe.yaml"))
variants = VariantConfig.from_yaml('python: ["3.10.* *_cpython", "3.12.* *_cpython"]\n')
version = re.search(r"project\(stiction VERSION ([0-9.]+)", (root / "CMakeLists.txt").read_text()).group(1)
found = [re.search(r"package='([^']+)', version='([^']+)'", str(rendered)).groups() for rendered in recipe.render(variants)]
print(found)
if sorted(set(found)) != [("libstiction", version), ("stiction", version)]:
    sys.exit(f"the recipe is not of libstiction and stiction {version}")
if what == "build":
    for result in recipe.run_build(variants, output_dir=work, channels=["conda-forge"]):
        print(result)
PROGRAM
if [ "$status" = 0 ]; then
  passed=1 failed=0
else
  passed=0 failed=1
fi
skipped=0
if [ "${1:-render}" != build ]; then
  echo "SKIPPED: the conda packages were rendered, not built (scripts/conda.sh build)"
  skipped=1
fi
echo "$passed passed, $failed failed, $skipped skipped"
exit "$status"
