#!/bin/sh
# Builds everything and runs all tests: plain in build/, then under AddressSanitizer and UndefinedBehaviorSanitizer in
# build-sanitized/, and the tests with threads under ThreadSanitizer in build-threads/. Stops at the first that fails.
#
#   sh test/run.sh [--quick] [ctest arguments …]      --quick leaves the sanitizers out
#
# Tests that lack something (tshark, clang 16, an ARM compiler, network namespaces) are skipped and say so.
set -eu
cd "$(dirname "$0")/.."
. samples/packages.sh

quick=no
if [ "${1:-}" = --quick ]; then
    quick=yes
    shift
fi

needed='g++ make cmake ccache libgtest-dev libbenchmark-dev libpcap-dev libfmt-dev libcli11-dev nlohmann-json3-dev
        libtomlplusplus-dev libncurses-dev'
useful='binutils iproute2 libbpf-dev valgrind tshark clang-16 libclang-rt-16-dev gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib'
# shellcheck disable=SC2086  # lists of words
need_packages $needed || exit 1
# shellcheck disable=SC2086
want_packages $useful  # tests that need one that is still missing are skipped

# run FOLDER CMAKE_ARGUMENT … -- CTEST_ARGUMENT …
run() {
    folder=$1
    shift
    settings=
    while [ "$1" != -- ]; do
        settings="$settings $1"
        shift
    done
    shift
    # shellcheck disable=SC2086  # a list of words
    cmake -S . -B "$folder" -DMARGAY_TESTS=ON -DMARGAY_SAMPLES=ON $settings
    cmake --build "$folder" --parallel "$(compilers)"
    ctest --test-dir "$folder" --parallel "$(nproc)" --output-on-failure "$@"
}

run build -- "$@"
if [ $quick = no ]; then
    export UBSAN_OPTIONS=print_stacktrace=1
    run build-sanitized -DMARGAY_SANITIZE=address -DCMAKE_BUILD_TYPE=Debug -- "$@"
    export TSAN_OPTIONS=halt_on_error=1
    run build-threads -DMARGAY_SANITIZE=thread -DMARGAY_SAMPLES=OFF -DCMAKE_BUILD_TYPE=Debug -- -L threads "$@"
fi
