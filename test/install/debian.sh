#!/bin/sh
# debian.sh CHECK BUILD FOLDER SOURCE: the Debian packages of the build folder BUILD.
#
#   make      makes them in FOLDER/packages
#   contents  their fields, dependencies and files
#   dpkg      dpkg installs, verifies and purges them in a separate root folder
#   service   the unpacked programs: a simulated segment runs as a service, and ethercat finds it
#   program   a program is compiled with the unpacked headers and archives
set -eu
check=$1 build=$2 folder=$3 source=$4
packages=$folder/packages

fail() { echo "debian.sh: $*" >&2; exit 1; }
skip() { echo "SKIPPED: $*"; exit 0; }
need() { command -v "$1" >/dev/null 2>&1 || skip "there is no $1"; }
need dpkg-deb
[ -x "$build/bin/margayd" ] || skip "the programs are not built"
[ -f "$build/CPackConfig.cmake" ] || skip "this build installs nothing"

# unpack: both packages into $folder/$check/root
unpack() {
    rm -rf "${folder:?}/$check"
    mkdir -p "$folder/$check/root"
    for package in "$packages"/*.deb; do dpkg-deb -x "$package" "$folder/$check/root"; done
    root=$folder/$check/root
}

field() { dpkg-deb -f "$1" "$2"; }

case $check in
make)
    need cpack
    need dpkg-shlibdeps
    rm -rf "$packages" "$folder/work"
    mkdir -p "$folder"
    (cd "$build" && cpack -G DEB --config CPackConfig.cmake -B "$folder/work") >"$folder/cpack.log" 2>&1 ||
        { cat "$folder/cpack.log"; fail "cpack failed"; }
    mkdir -p "$packages"
    mv "$folder/work"/*.deb "$packages"/
    rm -rf "$folder/work"
    ;;

contents)
    architecture=$(dpkg --print-architecture)
    tools=$(echo "$packages"/margay_*_"$architecture".deb)
    dev=$(echo "$packages"/libmargay-dev_*_"$architecture".deb)
    [ -f "$tools" ] && [ -f "$dev" ] || fail "packages: $(ls "$packages")"
    [ "$(field "$tools" Package) $(field "$dev" Package)" = 'margay libmargay-dev' ] || fail "names"
    for package in "$tools" "$dev"; do
        field "$package" Version | grep -Eq '^[0-9]+\.[0-9]+\.[0-9]+-1$' || fail "version of $package"
        # Each dependency is a package of this system's distribution.
        for name in $(field "$package" Depends | sed 's/([^)]*)//g; s/[,|]/ /g'); do
            dpkg-query -W "$name" >/dev/null 2>&1 || apt-cache show "$name" >/dev/null 2>&1 ||
                fail "$package depends on $name, which does not exist"
        done
        dpkg-deb -c "$package" >"$folder/list"
        ! grep -v ' root/root ' "$folder/list" || fail "files of other owners in $package"
        ! grep -Ev '^[dl]|^-rwxr-xr-x|^-rw-r--r--' "$folder/list" || fail "permissions in $package"
        ! grep -Ev ' \./(usr/.*)?$' "$folder/list" || fail "files outside of /usr in $package"
    done
    for name in libc6 libstdc++6 libpcap0.8 libpugixml1v5 adduser; do
        field "$tools" Depends | grep -qF "$name" || fail "margay does not depend on $name: $(field "$tools" Depends)"
    done
    field "$dev" Depends | grep -q 'libpcap-dev, libpugixml-dev' || fail "libmargay-dev: $(field "$dev" Depends)"
    ! field "$tools" Depends | grep -q -- '-dev' || fail "margay depends on a -dev package"
    unpack
    for file in bin/ethercat bin/margayd bin/slaveinfo lib/systemd/system/margayd.service lib/sysusers.d/margay.conf \
        share/bash-completion/completions/ethercat share/bash-completion/completions/margayd share/man/man1/ethercat.1 \
        share/man/man8/margayd.8 share/margay/segments/drives.toml share/doc/margay/copyright \
        share/doc/libmargay-dev/copyright share/doc/margay/examples/demo.toml include/margay/margay.hpp \
        include/margay/parts/oshw/nic.hpp lib/libmargay.a lib/libmargay_attach.a lib/cmake/margay/margay-config.cmake \
        lib/pkgconfig/margay.pc; do
        [ -f "$root/usr/$file" ] || fail "there is no /usr/$file"
    done
    # Each library that a pkg-config file names is in the package, or in a package that it depends on.
    needed=$(field "$dev" Depends | sed 's/([^)]*)//g; s/[ ,|]/\n/g' | grep .)
    needed="$needed
$(echo "$needed" | xargs dpkg-query -W -f '${Depends}\n' 2>/dev/null | sed 's/([^)]*)//g; s/[ ,|]/\n/g')"
    for name in $(sed -n 's/^Libs[^:]*://p' "$root"/usr/lib/pkgconfig/*.pc | tr ' ' '\n' | sed -n 's/^-l//p' | sort -u); do
        case $name in stdc++ | m | pthread) continue ;; esac  # of the compiler and the C library
        [ -z "$(find "$root/usr/lib" -name "lib$name.*")" ] || continue
        owner=$(dpkg -S "*/lib$name.so" | sed -n '1s/:.*//p')
        [ -n "$owner" ] || fail "no package has the library $name"
        echo "$needed" | grep -qx "$owner" ||
            fail "libmargay-dev does not depend on $owner: $(field "$dev" Depends)"
    done
    dpkg-deb -c "$tools" | grep -Eq 'include/|\.a$' && fail "headers or archives in margay"
    dpkg-deb -c "$dev" | grep -q ' \./usr/bin/' && fail "programs in libmargay-dev"
    grep -q '^ExecStart=/usr/bin/margayd$' "$root/usr/lib/systemd/system/margayd.service" || fail "the path in the unit"
    # No text file contains the path of the build folder.
    ! grep -rIl "$build" "$root" || fail "files with the path of the build"
    readelf -S "$root/usr/bin/margayd" | grep -q '\.debug_info' && fail "margayd is not stripped"
    for script in postinst prerm postrm; do
        dpkg-deb --ctrl-tarfile "$tools" | tar -xO "./$script" | sh -n || fail "$script is no script"
    done
    ;;

dpkg)
    [ "$(id -u)" = 0 ] || skip "only root can install"
    root=$folder/dpkg
    rm -rf "$root"
    mkdir -p "$root/var/lib/dpkg/info" "$root/var/lib/dpkg/updates" "$root/var/lib/dpkg/triggers"
    : >"$root/var/lib/dpkg/status"
    into="dpkg --root=$root --force-script-chrootless --force-depends"
    $into -i "$packages"/*.deb >"$folder/dpkg.log" 2>&1 || { cat "$folder/dpkg.log"; fail "dpkg -i failed"; }
    [ "$(dpkg-query --admindir="$root/var/lib/dpkg" -W -f '${Status}\n' margay libmargay-dev | sort -u)" = 'install ok installed' ] ||
        fail "not installed"
    verified=$(dpkg --root="$root" -V margay libmargay-dev)
    [ -z "$verified" ] || fail "dpkg -V: $verified"
    [ -x "$root/usr/bin/margayd" ] || fail "no margayd"
    $into -P margay libmargay-dev >>"$folder/dpkg.log" 2>&1 || { cat "$folder/dpkg.log"; fail "dpkg -P failed"; }
    [ -z "$(find "$root" -path "$root/var" -prune -o -type f -print)" ] || fail "files are left: $(find "$root" -type f)"
    rm -rf "$root"
    ;;

service)
    unshare --mount --propagation private sh -c 'mount -t tmpfs none /run' 2>/dev/null || skip "no mount namespaces here"
    unpack
    cat >"$folder/$check/run.sh" <<'EOF'
set -e
root=$1
mount -t tmpfs none /run
mkdir /run/etc
cp -a /etc/. /run/etc/
mount --bind /run/etc /etc
mount -t tmpfs none /run
rm -rf /etc/margay
mkdir /etc/margay
cp "$root/usr/share/doc/margay/examples/demo.toml" /etc/margay/
unset MARGAY_MASTER0
"$root/usr/bin/margayd" 2>/run/log & pid=$!
n=0
until grep -q 'demo: all is right: 5 slaves in OP' /run/log; do
    sleep 0.05
    n=$((n + 1))
    [ $n -lt 1200 ] || { cat /run/log; kill -9 $pid; exit 1; }
done
"$root/usr/bin/ethercat" slaves
"$root/usr/bin/ethercat" states PREOP -p 2
"$root/usr/bin/ethercat" reg_read -p 1 -t uint16 0x10
kill $pid
wait $pid
echo "ended $?"
# A ready-made segment of the package.
"$root/usr/bin/slaveinfo" sim:drives >/run/slaves
head -n 1 /run/slaves
EOF
    out=$(unshare --mount --propagation private sh "$folder/$check/run.sh" "$root") || fail "the service: $out"
    echo "$out"
    echo "$out" | grep -q '^0  0:0  OP  +  EtherCAT coupler$' || fail "ethercat does not see the segment"
    echo "$out" | grep -q '^ended 0$' || fail "margayd has not ended well"
    echo "$out" | grep -q '^8 slaves found' || fail "no ready-made segments"
    ;;

program)
    need c++
    need pkg-config
    unpack
    export PKG_CONFIG_PATH="$root/usr/lib/pkgconfig"
    # shellcheck disable=SC2046  # words
    c++ -std=c++20 "$source/consumer_linux.cpp" $(pkg-config --cflags --libs margay margay-linux) -o "$folder/$check/consumer"
    "$folder/$check/consumer"
    ;;

*) fail "what is '$check'?" ;;
esac
[ "$check" = make ] || [ ! -d "${folder:?}/$check" ] || rm -rf "${folder:?}/$check"
