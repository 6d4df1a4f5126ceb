# Functions that install Debian packages, sourced by the other scripts.
#
# need_packages NAME … installs missing packages when it runs as root and apt exists. Otherwise it prints the missing
# packages and the command that installs them, and returns 1. Without dpkg it prints all packages and returns 0; then
# the build reports what is missing.
#
# want_packages NAME … is for packages that are useful but not necessary. When it runs as root and apt exists, it
# installs each missing package separately. It prints the packages that are still missing, and returns 0.
#
# compilers prints the number of compilers to run in parallel: one per processor, but not more than fit into the memory.

missing_packages() {
    command -v dpkg-query >/dev/null 2>&1 || return 0
    for package in "$@"; do
        case $(dpkg-query -W -f='${Status}' "$package" 2>/dev/null) in
        "install ok installed") ;;
        *) printf ' %s' "$package" ;;
        esac
    done
}

need_packages() {
    if ! command -v dpkg-query >/dev/null 2>&1; then
        echo "This is no Debian system. What is needed is called there: $*" >&2
        return 0
    fi
    missing=$(missing_packages "$@")
    [ -n "$missing" ] || return 0
    if can_install; then
        echo "Installing$missing"
        # shellcheck disable=SC2086  # a list of words
        if apt_update_once && apt_quietly install --yes --no-install-recommends $missing; then
            return 0
        fi
        echo "apt-get could not install all of it; the output above says why." >&2
    fi
    echo "Missing packages:$missing" >&2
    echo "Install them with: sudo apt-get install --no-install-recommends$missing" >&2
    return 1
}

want_packages() {
    command -v dpkg-query >/dev/null 2>&1 || return 0
    if can_install && [ -n "$(missing_packages "$@")" ] && apt_update_once; then
        for wanted in $(missing_packages "$@"); do
            echo "Installing $wanted"
            apt_quietly install --yes --no-install-recommends "$wanted" ||
                echo "apt-get could not install $wanted; the output above says why." >&2
        done
    fi
    missing=$(missing_packages "$@")
    [ -n "$missing" ] || return 0
    echo "Going on without:$missing" >&2
    echo "Install them with: sudo apt-get install --no-install-recommends$missing" >&2
}

# A compiler needs up to 1 GiB for a file of this project. Tests set `meminfo` to a file that replaces /proc/meminfo.
compilers() {
    processors=$(nproc 2>/dev/null) || processors=1
    gibibytes=$(awk '/^MemAvailable:/ { print int($2 / 1048576) }' "${meminfo:-/proc/meminfo}" 2>/dev/null) || gibibytes=
    if [ -n "$gibibytes" ] && [ "$gibibytes" -lt "$processors" ]; then
        processors=$gibibytes
        [ "$processors" -ge 1 ] || processors=1
    fi
    echo "$processors"
}

can_install() { [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null 2>&1; }

apt_updated=no
apt_update_once() {
    [ $apt_updated = no ] || return 0
    apt_quietly update && apt_updated=yes
}

# Runs apt-get. Prints the output of apt-get only when apt-get fails.
apt_quietly() {
    log=$(mktemp)
    if DEBIAN_FRONTEND=noninteractive apt-get -q "$@" >"$log" 2>&1 </dev/null; then
        rm -f "$log"
    else
        cat "$log" >&2
        rm -f "$log"
        return 1
    fi
}
