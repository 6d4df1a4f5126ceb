#!/bin/sh
# unit.sh PREFIX FOLDER: checks the unit margayd.service of the installation in PREFIX with the tools of systemd.
set -eu
prefix=$1 folder=$2
unit=$prefix/lib/systemd/system/margayd.service
fail() { echo "unit.sh: $*" >&2; exit 1; }
[ -f "$unit" ] || fail "$unit is not installed"
grep -q "^ExecStart=$prefix/bin/margayd\$" "$unit" || fail "the path of the program in the unit: $(grep ExecStart "$unit")"
command -v systemd-analyze >/dev/null 2>&1 || { echo "SKIPPED: there is no systemd-analyze"; exit 0; }
rm -rf "$folder"
mkdir -p "$folder"
said=$(systemd-analyze verify --man=no --recursive-errors=no "$unit" 2>&1) || fail "systemd-analyze verify: $said"
[ -z "$said" ] || fail "systemd-analyze verify: $said"
# systemd-analyze reports a wrong unit, so the check works.
sed 's/^Type=notify/Type=nonsense/; s/^ExecStart=.*/ExecStart=nowhere/' "$unit" >"$folder/margayd.service"
said=$(systemd-analyze verify --man=no "$folder/margayd.service" 2>&1) && [ -z "$said" ] && fail "a wrong unit is accepted"
# The unit has exactly these capabilities. Its exposure level is at most 3.5 (0: the unit may do nothing, 10:
# everything).
[ "$(sed -n 's/^CapabilityBoundingSet=//p' "$unit")" = 'CAP_NET_RAW CAP_NET_ADMIN CAP_CHOWN' ] || fail "capabilities"
said=$(systemd-analyze security --offline=true --threshold=35 --no-pager "$unit" 2>&1) || fail "exposure: $said"
echo "$said" | tail -n 1
if command -v systemd-sysusers >/dev/null 2>&1; then
    mkdir -p "$folder/root/etc"
    systemd-sysusers --root="$folder/root" "$prefix/lib/sysusers.d/margay.conf" || fail "sysusers.d"
    grep -q '^margay:' "$folder/root/etc/passwd" || fail "no user margay"
    grep -q '^margay:' "$folder/root/etc/group" || fail "no group margay"
fi
rm -rf "$folder"
