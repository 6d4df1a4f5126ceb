#!/bin/sh
# bare_root.sh FOLDER PACKAGES: makes a small Debian 12 with systemd in FOLDER, for -D MARGAY_DEBIAN_ROOT=FOLDER, and
# installs the dependencies of the packages in the folder PACKAGES (build/nested/debian/packages). The script downloads
# about 100 MB. It needs root and debootstrap.
set -eu
folder=$1 packages=$2
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
depends=$(for package in "$packages"/*.deb; do dpkg-deb -f "$package" Depends; done | tr ',' '\n' | sed 's/([^)]*)//g; s/|.*//; s/ //g' |
    sort -u)
[ -n "$depends" ] || { echo "bare_root.sh: no packages in $packages" >&2; exit 1; }
[ -e "$folder/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$folder" "$mirror"
cp /etc/resolv.conf "$folder/etc/resolv.conf"
# shellcheck disable=SC2086  # words
unshare --mount sh -c 'mount -t proc proc "$0/proc" && DEBIAN_FRONTEND=noninteractive exec chroot "$0" sh -c "
    apt-get update && apt-get install -y --no-install-recommends systemd $*"' "$folder" $depends
