# Sourced by the scripts: need_packages NAME … sees to it that these Debian packages are there.
#
# With root and apt it installs what is missing. Elsewhere it names what is missing, says how to install it and returns
# 1. Where there is no dpkg to ask it names all of them and leaves it to the build to find out.

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
    if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null 2>&1; then
        echo "Installing$missing"
        # shellcheck disable=SC2086  # a list of words
        if apt_quietly update && apt_quietly install --yes --no-install-recommends $missing; then
            return 0
        fi
        echo "apt-get could not install all of it; the output above says why." >&2
    fi
    echo "Missing packages:$missing" >&2
    echo "Install them with: sudo apt-get install --no-install-recommends$missing" >&2
    return 1
}

# Says nothing unless it fails.
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
