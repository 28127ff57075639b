#!/usr/bin/env python3
"""The conda packages of packaging/conda/recipe.yaml: rendered, built and tested by rattler-build. scripts/conda.sh calls it.

    conda_packages.py render|build|stand-ins FOLDER

`build` takes compilers and libraries from conda-forge. `stand-ins` makes packages of the same names in their place. They hold
nothing where the system's own compiler or library is found in any case, and PyPI's package where one is Python's. It
runs the recipe's own steps and tests, and does not show the effect of conda-forge's packages. The last line is: N
passed, M failed, K skipped; exit status 77 where conda-forge is out of reach.
"""

import argparse
import os
import pathlib
import re
import sys
import urllib.error
import urllib.request

from rattler_build import EnvironmentIsolation, Stage0Recipe, ToolConfiguration, VariantConfig

ROOT = pathlib.Path(__file__).resolve().parents[1]
CHANNEL = "https://conda.anaconda.org/conda-forge"
SYSTEM = {"gcc_linux-64": "12", "gxx_linux-64": "12", "cmake": "3.25", "ninja": "1.11", "hdf5": "1.10.8", "cli11": "2.3",
          "fmt": "9.1", "nlohmann_json": "3.11", "pip": "23"}
PYPI = {"nanobind": "2.13", "scikit-build-core": "0.10", "numpy": "1.24"}
LOG_LINES = 20  # of a script that failed
# Variables that conda-forge's compilers set when an environment is activated, and a cache that knows the objects of
# other builds. ccache counts another locale or option as another compile. rattler-build sets LC_ALL, and those builds
# stop at warnings.
ACTIVATION = """
export CC=/usr/bin/cc CXX=/usr/bin/c++ CMAKE_ARGS="-DSTICTION_KEEP_LINES=ON -DSTICTION_WARNINGS_AS_ERRORS=ON"
if command -v ccache > /dev/null; then
  unset LC_ALL
  export CMAKE_CXX_COMPILER_LAUNCHER=ccache CCACHE_DIR={cache} CCACHE_BASEDIR=$SRC_DIR CCACHE_NOHASHDIR=1
  export CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_MAXSIZE=0
fi
"""


def stand_in(name, version, script, host=()):
    lines = [f"package: {{name: {name}, version: '{version}'}}", "build: {number: 0, script: " + repr(script) + "}",
             "requirements: {host: " + repr(list(host)) + ", run: " + repr(list(host)) + "}",
             "about: {license: Apache-2.0, summary: stand-in}"]
    return Stage0Recipe.from_yaml("\n".join(lines))


def make_stand_ins(folder, variants):
    """A channel of packages that let the recipe's requirements be met by this Debian; those that are there are kept."""
    channel = folder / "channel"
    cache = os.environ.get("CCACHE_DIR", pathlib.Path.home() / ".cache/ccache")
    (folder / "activate.sh").write_text(ACTIVATION.format(cache=cache))
    # It reads the file that this call has written, so that it need not be made again.
    activate = f"mkdir -p $PREFIX/etc/conda/activate.d && echo . {folder}/activate.sh > $PREFIX/etc/conda/activate.d/stand_in.sh"
    pip = "env -u PIP_NO_INDEX -u PIP_NO_DEPENDENCIES $PREFIX/bin/python -m pip install"
    needed = [("python", "3.11.2", "/usr/bin/python3 -m venv $PREFIX", [])]
    needed += [(name, version, activate if name == "gxx_linux-64" else "true", []) for name, version in SYSTEM.items()]
    needed += [(name, version, f"{pip} '{name}>={version}'", ["python"]) for name, version in PYPI.items()]
    for name, version, command, host in needed:
        if not list(channel.glob(f"*/{name}-{version}-*.conda")):
            stand_in(name, version, [command], host).run_build(variants, output_dir=channel, channels=[channel.as_uri()],
                                                               env_isolation=EnvironmentIsolation.NONE)
    return channel.as_uri()


def expected_packages():
    version = re.search(r"project\(stiction VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
    return [("libstiction", version), ("stiction", version)]


def end_of_log(folder, name):
    """The last lines of a package's build script. rattler-build's own error does not have them."""
    builds = (folder / "packages" / "bld").glob(f"rattler-build_{name}_*")
    logs = sorted((build / "work" / "conda_build.log" for build in builds), key=lambda log: log.stat().st_mtime)
    lines = logs[-1].read_text(errors="replace").splitlines()[-LOG_LINES:] if logs else ["its script left no log"]
    return "\n".join(f"    {line}" for line in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["render", "build", "stand-ins"])
    parser.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    pythons = '["3.11.*"]' if arguments.what == "stand-ins" else '["3.10.* *_cpython", "3.12.* *_cpython"]'
    variants = VariantConfig.from_yaml(f"python: {pythons}\n")
    recipe = Stage0Recipe.from_file(str(ROOT / "packaging/conda/recipe.yaml"))
    found = [re.search(r"package='([^']+)', version='([^']+)'", str(rendered)).groups() for rendered in recipe.render(variants)]
    print(found)
    if sorted(set(found)) != expected_packages():
        print(f"the recipe is not of {expected_packages()}\n0 passed, 1 failed, 0 skipped")
        return 1
    if arguments.what == "render":
        print("SKIPPED: the conda packages were rendered, not built (scripts/conda.sh build)\n1 passed, 0 failed, 1 skipped")
        return 0
    channel = CHANNEL
    if arguments.what == "stand-ins":
        channel = make_stand_ins(folder, VariantConfig())
    else:
        try:
            urllib.request.urlopen(urllib.request.Request(f"{CHANNEL}/noarch/repodata.json.zst", method="HEAD"), timeout=30).close()
        except (urllib.error.URLError, TimeoutError) as error:
            print(f"SKIPPED: the conda packages were rendered, not built: {CHANNEL} is out of reach ({error})\n"
                  "1 passed, 0 failed, 1 skipped")
            return 77
    passed = failed = 0
    for rendered in recipe.render(variants):
        name = re.search(r"package='([^']+)'", str(rendered)).group(1)
        try:
            result = rendered.run_build(ToolConfiguration(test_strategy="native"), output_dir=folder / "packages",
                                        channels=[channel])
        except Exception as error:  # each failure of rattler-build has a type of its own
            failed += 1
            print(f"{name} was not built, or a test of it failed: {error}\n{end_of_log(folder, name)}")
        else:
            passed += 1
            print(f"built and tested: {result.packages[0]}, {pathlib.Path(result.packages[0]).stat().st_size / 1e6:.1f} MB")
    print(f"{passed + 1} passed, {failed} failed, 0 skipped")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
