#!/bin/sh
# systemd.sh PACKAGES FOLDER ROOT: installs the Debian packages of the folder PACKAGES where systemd is process 1, and
# checks the service there with a simulated segment: start, capabilities, journal, reload, restart, end, purge.
#
# systemd runs in namespaces and a control group of its own, without network, on a copy of ROOT in memory: `/` for the
# files of this machine, or the folder of a Debian 12. Nothing outside of the copy is changed. FOLDER is for temporary
# files.
set -eu
packages=$1 folder=$2 source=$3
work=$folder/systemd-$$
pid=
group=

fail() {
    echo "systemd.sh: $*" >&2
    [ -z "$pid" ] || inside journalctl --no-pager -o short-monotonic -n 60 >&2 || true
    exit 1
}
skip() { echo "SKIPPED: $*"; exit 0; }

# inside COMMAND …: executes the command as root in the namespaces of systemd.
inside() { nsenter -t "$pid" -m -u -i -n -p -C -r -w env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C "$@"; }

finish() {
    # When process 1 of a PID namespace ends, the kernel ends all other processes of the namespace.
    [ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || true
    [ -z "${outer:-}" ] || wait "$outer" 2>/dev/null || true
    n=0
    while [ -n "$group" ] && [ -d "$group" ] && [ $n -lt 100 ]; do
        find "$group" -depth -type d -exec rmdir {} + 2>/dev/null || sleep 0.05
        n=$((n + 1))
    done
    rm -rf "$work"
}
trap finish EXIT
trap 'exit 1' INT TERM

# until_true SECONDS TEXT COMMAND …: repeats the command until it succeeds.
until_true() {
    tries=$(($1 * 10)) text=$2
    shift 2
    until "$@" >/dev/null 2>&1; do
        sleep 0.1
        tries=$((tries - 1))
        [ $tries -gt 0 ] || fail "$text"
    done
}
journal() { inside journalctl --no-pager -u margayd -o cat "$@"; }
told() { journal | grep -qF "$1"; }
property() { inside systemctl show margayd -P "$1"; }

# ------------------------------------------------------------------ what is needed

[ -n "$source" ] || skip "there is no bare Debian: make one by test/install/bare_root.sh, and name it in MARGAY_DEBIAN_ROOT"
[ "$(id -u)" = 0 ] || skip "only root can start another systemd"
for command in unshare nsenter pivot_root findmnt; do
    command -v $command >/dev/null 2>&1 || skip "there is no $command"
done
[ -x "$source/lib/systemd/systemd" ] && [ -x "$source/usr/bin/journalctl" ] || skip "there is no systemd in $source"
for package in "$packages"/margay_*.deb "$packages"/libmargay-dev_*.deb; do
    [ -f "$package" ] || skip "the packages were not made: there is no $package"
done
groups=$(findmnt -n -t cgroup2 -o TARGET | head -n 1)
[ -n "$groups" ] || skip "there is no cgroup2 file system"
mkdir "$groups/margay-test-$$" 2>/dev/null || skip "no control group of its own: $groups is read-only"
group=$groups/margay-test-$$
mkdir -p "$work/memory"

# ------------------------------------------------------------------ systemd as process 1

cat >"$work/start.sh" <<'END'
set -e
work=$1 source=$2 packages=$3
mount -t tmpfs none "$work/memory"
cd "$work/memory"
mkdir upper work root
mount -t overlay overlay -o "lowerdir=$source,upperdir=upper,workdir=work" root
cd root
mkdir -p proc run tmp sys dev mnt
mount -t proc proc proc
mount -t tmpfs none run
mount -t tmpfs none tmp
mount -t sysfs sysfs sys
mount -t cgroup2 cgroup2 sys/fs/cgroup
mount -t tmpfs none dev
for device in null zero full random urandom tty; do
    : >dev/$device
    mount --bind /dev/$device dev/$device
done
mkdir dev/shm dev/pts margay-packages
cp "$packages"/*.deb margay-packages/
# The copy has no enabled units, no masters in /etc/margay and no journal of this machine.
rm -rf etc/systemd/system/* etc/margay var/log/journal
printf 'margay-test\n' >etc/hostname
: >etc/machine-id
pivot_root . mnt
exec chroot . sh -c 'umount -l /mnt && exec env -i container=margay-test /lib/systemd/systemd --unit=multi-user.target' </dev/null
END
# This script stays in its control group. Only the new process joins the new control group.
sh -c 'echo $$ >"$0/cgroup.procs" && exec unshare --mount --propagation private --pid --fork --kill-child --cgroup --uts --ipc --net \
    sh "$1/start.sh" "$1" "$2" "$3"' "$group" "$work" "$source" "$packages" >"$work/log" 2>&1 &
outer=$!
n=0
while [ -z "$pid" ]; do
    kill -0 $outer 2>/dev/null || skip "systemd cannot be started here: $(tail -n 1 "$work/log")"
    for each in $(cat "$group/cgroup.procs" "$group/init.scope/cgroup.procs" 2>/dev/null); do
        [ "$(cat "/proc/$each/comm" 2>/dev/null)" = systemd ] && pid=$each
    done
    sleep 0.1
    n=$((n + 1))
    [ $n -lt 300 ] || skip "systemd was not started within 30 s: $(tail -n 1 "$work/log")"
done
n=0
until inside systemctl is-active multi-user.target >/dev/null 2>&1; do
    sleep 0.1
    n=$((n + 1))
    [ $n -lt 600 ] || skip "systemd has not reached multi-user.target within 60 s"
done
echo "systemd $(inside systemctl --version | sed -n '1s/systemd //p') is process 1"

# ------------------------------------------------------------------ installation

inside sh -c 'dpkg -i /margay-packages/*.deb' >"$work/dpkg" 2>&1 || { cat "$work/dpkg" >&2; fail "dpkg -i"; }
inside getent passwd margay >/dev/null || fail "no user margay"
[ "$(property LoadState) $(property ActiveState)" = 'loaded inactive' ] || fail "after the installation: $(property ActiveState)"
inside sh -c 'cp /usr/share/doc/margay/examples/demo.toml /etc/margay/ && systemctl enable --now margayd' 2>/dev/null ||
    fail "systemctl enable --now"
[ "$(property ActiveState) $(property SubState)" = 'active running' ] || fail "the service is $(property ActiveState)"
inside systemctl is-enabled margayd >/dev/null || fail "not enabled"
until_true 60 "the segment is not in OP" told 'demo: all is right: 5 slaves in OP'
inside ethercat slaves >"$work/slaves" || fail "ethercat slaves"
grep -q '^0  0:0  OP  +  EtherCAT coupler$' "$work/slaves" || fail "ethercat slaves: $(cat "$work/slaves")"
[ "$(inside ethercat reg_read -p 1 -t uint16 0x10)" = '0x1002 4098' ] || fail "ethercat reg_read"
echo "installed; five slaves in OP"

# ------------------------------------------------------------------ rights

main=$(property MainPID)
status() { inside sed -n "s/^$1:[[:space:]]*//p" "/proc/$main/status"; }
# CAP_CHOWN (0), CAP_NET_ADMIN (12) and CAP_NET_RAW (13), in each set.
for set in CapInh CapPrm CapEff CapBnd CapAmb; do
    [ "$(status $set)" = 0000000000003001 ] || fail "$set is $(status $set)"
done
[ "$(status NoNewPrivs)" = 1 ] || fail "NoNewPrivs"
[ "$(status Seccomp)" = 2 ] || fail "no filter of system calls"
user=$(inside id -u margay)
[ "$(status Uid | awk '{ print $1 $2 $3 $4 }')" = "$user$user$user$user" ] || fail "the process runs as $(status Uid)"
# The restrictions of the unit are effective in the namespaces of the service.
seen() { inside nsenter -t "$main" -m -r -w sh -c "$1"; }
seen 'touch /usr/margay-was-here' 2>/dev/null && fail "/usr is writable for the service"
socket=$(inside stat -c '%U %G %a' /run/margay/demo.sock)
[ "$socket" = 'margay margay 660' ] || fail "the socket: $socket"
echo "CAP_CHOWN, CAP_NET_ADMIN and CAP_NET_RAW, and no other capability"

# ------------------------------------------------------------------ journal

inside journalctl --no-pager -u margayd -o json --output-fields=PRIORITY,MESSAGE,SYSLOG_IDENTIFIER,_COMM >"$work/journal"
line=$(grep -F 'demo: all is right: 5 slaves in OP' "$work/journal" | head -n 1)
for part in '"PRIORITY":"5"' '"SYSLOG_IDENTIFIER":"margayd"' '"_COMM":"margayd"'; do
    echo "$line" | tr -d ' ' | grep -qF "$part" || fail "$part is not in the journal: $line"
done
journal | grep -q '^<' && fail "a priority is part of a text: $(journal | grep '^<')"
[ "$(inside systemctl show margayd -P StatusText)" != '' ] || fail "no status line"

# ------------------------------------------------------------------ reload

configure() { inside sh -c "cat >/etc/margay/demo.toml" <"$work/configuration"; }
printf 'source = "sim:demo"\ncycle_us = 2000\n' >"$work/configuration"
configure
inside systemctl reload margayd || fail "systemctl reload"
until_true 60 "the changed master was not started again" sh -c "nsenter -t $pid -a journalctl --no-pager -u margayd -o cat |
    grep -cF 'demo: all is right: 5 slaves in OP' | grep -qx 2"
[ "$(property MainPID)" = "$main" ] || fail "a reload has started another process"
# systemctl refuses a configuration with an error, and the service continues.
printf 'source = "sim:demo"\ncycle_us = "often"\n' >"$work/configuration"
configure
inside systemctl reload margayd 2>/dev/null && fail "a wrong configuration is reloaded"
until_true 10 "the journal does not name the error" told "/etc/margay/demo.toml: line 2: 'cycle_us' must be an integer"
[ "$(property ActiveState) $(property MainPID)" = "active $main" ] || fail "a wrong configuration has ended the service"
inside ethercat slaves >/dev/null 2>&1 || fail "ethercat after a wrong configuration"
echo "reload: a change, and an error that is refused"

# ------------------------------------------------------------------ a crash, the end, a start that fails

printf 'source = "sim:demo"\n' >"$work/configuration"
configure
inside sh -c "kill -9 $main"
until_true 60 "it was not started again after a crash" sh -c "nsenter -t $pid -a systemctl show margayd -P NRestarts | grep -qx 1"
until_true 60 "it does not run after a crash" inside systemctl is-active margayd
until_true 60 "no segment after a crash" inside ethercat slaves
main=$(property MainPID)
inside systemctl stop margayd || fail "systemctl stop"
[ "$(property Result) $(property ExecMainStatus)" = 'success 0' ] || fail "the end: $(property Result) $(property ExecMainStatus)"
inside test ! -e /run/margay || fail "/run/margay is left"
printf 'source = "sim:nothing"\nwrong = 1\n' >"$work/configuration"
configure
inside systemctl start margayd 2>/dev/null && fail "a wrong configuration is started"
[ "$(property ActiveState) $(property ExecMainStatus)" = 'failed 2' ] || fail "a wrong configuration: $(property ActiveState) $(property ExecMainStatus)"
sleep 3 # longer than RestartSec
[ "$(property ActiveState)" = failed ] || fail "a wrong configuration is tried again"
echo "restarted after a crash; ended with 0; a wrong configuration is not tried again"

# ------------------------------------------------------------------ removal

printf 'source = "sim:demo"\n' >"$work/configuration"
configure
inside systemctl start margayd || fail "start after a failure"
inside sh -c 'dpkg -P margay libmargay-dev' >"$work/dpkg" 2>&1 || { cat "$work/dpkg" >&2; fail "dpkg -P"; }
[ "$(property LoadState)" = not-found ] || fail "the unit is left: $(property LoadState)"
inside sh -c '! grep -qx margayd /proc/[0-9]*/comm && [ ! -e /usr/bin/margayd ]' || fail "margayd is left"
inside test -f /etc/margay/demo.toml || fail "the user's configuration is gone"
echo "purged"
