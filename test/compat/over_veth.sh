#!/bin/sh
# over_veth.sh VIRTUAL_SEGMENT SEGMENT PROGRAM [ARGUMENT …]: starts PROGRAM in a network namespace at one end of a veth
# pair, with the segment at the other end, in a namespace of its own. The interface of the program is ecat-m. The end of
# PROGRAM is the end of the test; 77: there are no network namespaces with a veth pair here. In the environment:
# FAR_OPTIONS, of virtual_segment, and FAR_ADDRESS, an address and the interface of virtual_segment that gets it.
virtual_segment=$1
segment=$2
shift 2
near=margay-compat-$$-m
far=margay-compat-$$-s
said=$(mktemp -d) || exit 1
server=

clean_up() {
    if [ -n "$server" ]; then
        kill "$server" 2>/dev/null
        wait "$server" 2>/dev/null
    fi
    for name in "$near" "$far"; do
        [ -e "/run/netns/$name" ] && ip netns del "$name"
    done
    rm -r "$said"
}
trap clean_up EXIT
trap 'exit 1' INT TERM HUP

if ! { ip netns add "$near" && ip netns add "$far" &&
    ip -n "$near" link add ecat-m type veth peer name ecat-s netns "$far" &&
    ip -n "$near" link set ecat-m up && ip -n "$far" link set ecat-s up; } >"$said/ip" 2>&1; then
    echo "skipped: no network namespaces with a veth pair here: $(cat "$said/ip")"
    exit 77
fi

ip netns exec "$far" "$virtual_segment" ecat-s "$segment" $FAR_OPTIONS >"$said/segment" 2>&1 &
server=$!
until grep -q serving "$said/segment"; do
    if ! kill -0 "$server" 2>/dev/null; then
        echo "virtual_segment has ended: $(cat "$said/segment")"
        exit 1
    fi
    sleep 0.05
done
if [ -n "$FAR_ADDRESS" ]; then
    ip -n "$far" address add "${FAR_ADDRESS%@*}" dev "${FAR_ADDRESS#*@}" || exit 1
fi

ip netns exec "$near" "$@"
code=$?
[ $code = 0 ] || cat "$said/segment"
exit $code
