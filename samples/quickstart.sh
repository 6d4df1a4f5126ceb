#!/bin/sh
# First steps in a fresh checkout: installs the packages that the build needs (on Debian, as root), builds the programs
# of the first steps into build/, and runs slaveinfo on a simulated segment. `cmake --build build` builds the rest.
set -eu
cd "$(dirname "$0")/.."
. samples/packages.sh

case ${1-} in
'') ;;
--help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' samples/quickstart.sh && exit ;;
*) echo "samples/quickstart.sh: unknown option '$1'" >&2 && exit 2 ;;
esac

need_packages g++ make ninja-build cmake ccache libpcap-dev libfmt-dev libcli11-dev nlohmann-json3-dev libtomlplusplus-dev \
    libncurses-dev libpugixml-dev || exit 1

# A configured build folder keeps its settings. A folder with only a cache comes from a failed attempt: the cache would keep the
# compiler and the flags of that attempt, so it is removed.
if [ ! -e build/Makefile ] && [ ! -e build/build.ninja ]; then
    rm -rf build/CMakeCache.txt build/CMakeFiles
    # With Ninja the sources of one target do not wait for another target.
    generator=
    if command -v ninja >/dev/null 2>&1; then generator='-G Ninja'; fi
    # shellcheck disable=SC2086  # a list of words
    cmake -S . -B build $generator -DMARGAY_TESTS=OFF -DMARGAY_UNITY=ON -DMARGAY_BUILD_ONCE=ON -DMARGAY_TEST_LINES=OFF
fi
begin=$(date +%s)
cmake --build build --parallel "$(compilers)" --target slaveinfo simple_io segment_monitor eepromtool
echo "The build took $(($(date +%s) - begin)) s."

echo
echo '$ build/bin/slaveinfo sim:demo'
build/bin/slaveinfo sim:demo

cat <<'END'

That was a simulated segment. What to try next:
  build/bin/slaveinfo sim:demo --json                 the same for programs
  build/bin/slaveinfo sim:demo --record /tmp/demo.pcap  keep every frame, for Wireshark or for
  build/bin/slaveinfo pcap:/tmp/demo.pcap             … looking at it again without a segment
  build/bin/slaveinfo                                 which interfaces and simulated segments there are
  build/bin/simple_io sim:demo                        to OP, exchanges process data (outputs stay 0)
  build/bin/segment_monitor sim:demo                  a live view; q ends it
  build/bin/eepromtool sim:demo 2 dump                what is in the EEPROM of the second slave
  sudo build/bin/slaveinfo eth0                       real slaves, on the interface that they are connected to
  cmake --build build --parallel 2                    all other programs (samples/README.md), for example
  build/bin/segment_report sim:tree -o /tmp/report.html  … a page for a browser
  sh test/run.sh --quick                              the tests, without sanitizers
END
