#!/usr/bin/env bash
# Collects into .carry/ what a GPU machine without a network lacks: headers and libraries of the optional
# dependencies, from this machine's Debian packages. scripts/gpu_check.sh uses the folder where it is there.
# The folder is for travelling, not for committing: git is told to ignore it. Under 60 MB.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR source=common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

carry=$root/.carry
libraries=usr/lib/$(uname -m)-linux-gnu
packages=(libgtest-dev libgmock-dev librapidcheck-dev libbenchmark-dev libfmt-dev libcli11-dev nlohmann-json3-dev
  libeigen3-dev libhdf5-dev)
install_packages "${packages[@]/%/: not carried}"

rm -rf "$carry"
mkdir -p "$carry/$libraries" "$carry/hdf5/lib" "$carry/hdf5/include"

carry_library() {  # a shared library under its own name and under the name that programs ask for
  local file soname
  file=$(readlink -f "$1")
  soname=$(objdump -p "$file" | awk '$1 == "SONAME" {print $2}')
  cp "$file" "$carry/$libraries/"
  [ "$(basename "$file")" = "$soname" ] || ln -sf "$(basename "$file")" "$carry/$libraries/$soname"
}

for package in "${packages[@]}"; do
  have_package "$package" || continue
  while read -r file; do
    [ -f "$file" ] || continue
    case $file in
      */libhdf5*) ;;  # placed below, where FindHDF5 looks when it is told a root
      *.so) carry_library "$file"; cp -P "$file" "$carry/$libraries/" ;;
      /usr/include/hdf5/serial/*) cp "$file" "$carry/hdf5/include/" ;;
      /usr/include/hdf5/*) ;;
      /usr/include/* | /usr/lib/*.a | /usr/lib/*/cmake/* | /usr/share/cmake/* | /usr/share/eigen3/*)
        (cd / && cp --parents "${file#/}" "$carry/") ;;
    esac
  done < <(dpkg -L "$package")
done

hdf5=/usr/lib/$(uname -m)-linux-gnu/hdf5/serial/libhdf5.so
if [ -e "$hdf5" ]; then
  carry_library "$hdf5"
  ln -s "../../$libraries/$(basename "$(readlink -f "$hdf5")")" "$carry/hdf5/lib/libhdf5.so"
  # What HDF5 itself needs, except the C and C++ run time, which every machine has its own of.
  ldd "$hdf5" | awk '$3 ~ /^\// {print $3}' | grep -vE '/(libc|libm|libdl|librt|libpthread|libresolv|libstdc\+\+|libgcc_s)\.so' |
    while read -r file; do carry_library "$file"; done
fi

shared=${STICTION_SHARED_DIR:-$root/../shared}
if [ -d "$shared/data" ]; then
  mkdir -p "$carry/shared"
  cp -r "$shared/data" "$carry/shared/"
  [ ! -d "$shared/tools" ] || cp -r "$shared/tools" "$carry/shared/"
  chmod -R u+w "$carry/shared"
fi

exclude=$(git -C "$root" rev-parse --git-path info/exclude 2> /dev/null || true)
if [ -n "$exclude" ]; then
  case $exclude in /*) ;; *) exclude=$root/$exclude ;; esac
  mkdir -p "$(dirname "$exclude")"
  grep -qsx '/.carry/' "$exclude" || echo '/.carry/' >> "$exclude"
fi

size=$(du -sm "$carry" | cut -f1)
echo "$carry: $size MB"
[ "$size" -le 60 ] || { echo "pack_for_gpu.sh: more than 60 MB" >&2; exit 1; }
