# Fresh Debian systems to build and to install in, as root; sourced behind common.sh by scripts that set `work`. mmdebstrap
# makes one in 25 s, all packages fetched by one apt; debootstrap, which fetches them one by one, took 6 minutes.
# shellcheck shell=bash disable=SC2154  # root and work are the caller's
mirror=${STICTION_DEBIAN_MIRROR:-http://deb.debian.org/debian}
folders=()

# quiet LOG COMMAND ...: its output goes to a file, and on to the terminal where it fails.
quiet() {
  local log=$1
  shift
  "$@" > "$log" 2>&1 || { tail -n 40 "$log"; return 1; }
}

# can_make_systems: fails, with the reason, where there is no way to.
can_make_systems() {
  [ "$(id -u)" = 0 ] || { echo "that needs root"; return 1; }
  install_packages "mmdebstrap: nothing is done in a fresh system" > /dev/null
  command -v mmdebstrap > /dev/null || { echo "mmdebstrap is missing"; return 1; }
}

# make_system NAME SUITE PACKAGE ...: a fresh Debian in $work/NAME, unless it is there.
make_system() {
  local folder=$work/$1 suite=$2
  shift 2
  [ -e "$folder/complete" ] && return
  rm -rf "$folder"
  mmdebstrap --variant=minbase --include="$(IFS=,; echo "$*")" "$suite" "$folder" "$mirror" && touch "$folder/complete"
}

# in_system NAME COMMAND ...: there, with the source as /src, $work as /out, and each "FOLDER:PLACE" of the array `folders`.
# Its mounts are gone at the end. It trusts the certificates that this machine trusts.
in_system() {
  local folder=$work/$1 certificates=/etc/ssl/certs/ca-certificates.crt variables=()
  shift
  if [ -e "$certificates" ]; then
    mkdir -p "$folder/etc/ssl/certs"
    cp "$certificates" "$folder$certificates"
    variables=("PIP_CERT=$certificates" "SSL_CERT_FILE=$certificates")
  fi
  mkdir -p "$folder/src" "$folder/out" "$work/home"
  cp /etc/resolv.conf "$folder/etc/resolv.conf"
  # shellcheck disable=SC2016  # the inner shell's own
  FOLDERS="${folders[*]}" unshare --mount bash -c 'mount --bind "$2" "$1/src" && mount -o remount,bind,ro "$1/src" &&
    mount --bind "$3" "$1/out" && mount --rbind /dev "$1/dev" && mount -t proc proc "$1/proc" || exit
    for pair in $FOLDERS; do mkdir -p "$1${pair#*:}" && mount --bind "${pair%%:*}" "$1${pair#*:}" || exit; done
    folder=$1 && shift 3 && exec chroot "$folder" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/out/home \
      LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"' bash "$folder" "$root" "$work" "${variables[@]}" "$@"
}
