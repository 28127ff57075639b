#!/usr/bin/env bash
# Builds the documentation's site from docs/, the other pages, the Python package and the public headers. It fails on a
# link that leads nowhere, and on a public name of Python, C++ or C without a comment. Open build-site/index.html.
#
#   scripts/site.sh [FOLDER]                      default: build-site
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
site=${1:-$root/build-site}

say "site: packages"
install_packages "python3: no site" "python3-venv: no site" "git: no site" "doxygen: no site"
make_venv "$root/tools/requirements-site.txt"
if ! "$python" -c 'import mkdocs, mkdocstrings, material' 2> /dev/null; then
  note "PyPI did not deliver MkDocs: the site is NOT built"
  exit 77
fi
if ! command -v doxygen > /dev/null; then
  note "there is no doxygen, which reads the headers: the site is NOT built"
  exit 77
fi
say "site: pages"
"$python" "$root/tools/build_site.py" "$site" --stage "$root/build-site-pages"
