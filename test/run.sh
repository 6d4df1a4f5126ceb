#!/bin/sh
# Builds everything and runs all tests. In build/, without sanitizers: the tests that measure optimised code, execute
# programs or need real time, and the tests of a whole segment. In build-sanitized/, under AddressSanitizer and
# UndefinedBehaviorSanitizer: all tests that can run there. In build-threads/, under ThreadSanitizer: the tests with
# threads. Stops at the first of these runs that fails. A test that fails runs once more when all others have ended,
# because other programs on the machine may delay a test for longer than the test waits. If the test passes then, the
# last lines name it. A report of a sanitizer always fails the run.
#
#   sh test/run.sh [--quick] [--no-skips] [-R REGEX | another of -E -L -LE -I -N -V -VV of ctest] [-- options of ctest …]
#
#   --quick      the tests run in build/ only. Left out: sanitizers, the benchmarks, and what builds the project again
#                (clang, fuzz harnesses, all build types, other processors, the package and its users)
#   --no-skips   a test that is skipped fails the run
#
# Tests that lack something (tshark, clang 16, a compiler for another processor, QEMU, Chromium, network namespaces) are
# skipped and print the reason. The last lines are the time of each step and ctest's summaries. After a failure the last
# lines show the failed tests.
set -eu
cd "$(dirname "$0")/.."
. samples/packages.sh

quick=no
skips=yes
lists=no
# ctest ignores words that it does not know. So a wrong word ends the script here.
left=$#
while [ $left -gt 0 ]; do
    word=$1
    shift
    left=$((left - 1))
    case $word in
    --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' test/run.sh && exit ;;
    --quick) quick=yes ;;
    --no-skips) skips=no ;;
    --)
        while [ $left -gt 0 ]; do
            word=$1
            shift
            set -- "$@" "$word"
            left=$((left - 1))
        done
        ;;
    -R | -E | -L | -LE | -I)
        value=-
        [ $left -eq 0 ] || value=$1
        case $value in -*)
            echo "test/run.sh: option '$word' needs a value" >&2
            exit 2
            ;;
        esac
        set -- "$@" "$word" "$value"
        shift
        left=$((left - 1))
        ;;
    -N) lists=yes && set -- "$@" "$word" ;;
    -V | -VV) set -- "$@" "$word" ;;
    *)
        echo "test/run.sh: unknown option '$word'; other options of ctest follow '--'" >&2
        exit 2
        ;;
    esac
done

needed='g++ make cmake ccache libgtest-dev libbenchmark-dev libpcap-dev libfmt-dev libcli11-dev nlohmann-json3-dev
        libtomlplusplus-dev libncurses-dev libpugixml-dev'
useful='binutils iproute2 libbpf-dev libxdp-dev valgrind tshark pkg-config gnuplot-nox chromium systemd ninja-build'
builders='clang-16 libclang-rt-16-dev lld-16 gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm
          gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf g++-s390x-linux-gnu qemu-user-static googletest dpkg-dev'
[ $quick = yes ] || useful="$useful $builders"
# shellcheck disable=SC2086  # lists of words
need_packages $needed || exit 1
# shellcheck disable=SC2086
want_packages $useful  # tests that need a missing package are skipped

# ccache otherwise runs the preprocessor before each compilation that is not in the cache.
export CCACHE_DEPEND=1

records=$(mktemp -d)
trap 'rm -rf "$records"' EXIT

# step NAME COMMAND …: runs the command and stores its name, its duration and its processor time in seconds.
step() {
    name=$1
    shift
    times >"$records/before"
    begin=$(date +%s)
    status=0
    "$@" || status=$?
    end=$(date +%s)
    times >"$records/after"
    awk -v name="$name" -v clock=$((end - begin)) '
        function seconds(text) { split(text, parts, /[ms]/); return parts[1] * 60 + parts[2] }
        FNR == 2 { before = after; after = seconds($1) + seconds($2) }  # the second line is about child processes
        END { printf "  %-28s %8d %18d\n", name, clock, after - before + 0.5 }
    ' "$records/before" "$records/after" >>"$records/steps"
    return $status
}

# failures: prints the failed tests of ctest's log with the beginning of their output.
failures() {
    awk '
        /^ *[0-9]+\/[0-9]+ Test +#/ { failed = /\*\*\*/ && !/\*\*\*Skipped/; left = 40 }
        /^ +Start +[0-9]+: / { failed = 0 }
        failed && !/^\[ RUN |^\[ +OK |^\[-+\]|^$/ && left-- > 0
    ' "$records/log"
}

# failed_alone FOLDER: runs the failed tests again, one at a time. Succeeds if all of them pass now.
failed_alone() {
    if grep -q 'ERROR: [A-Z][a-z]*Sanitizer:\|WARNING: ThreadSanitizer:\|: runtime error: \|\*\*\*Exception' "$records/log"; then return 1; fi
    failures
    ctest --test-dir "$1" --rerun-failed --output-on-failure --output-log "$records/alone" || return 1
    sed -n 's|^ *[0-9]*/[0-9]* Test *#[0-9]*: \([^ ]*\) .* Passed .*|'"$1"': \1 failed among others and passed alone|p' \
        "$records/alone" >>"$records/summaries"
}

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
    # A folder that has only a cache comes from a failed attempt. The cache would keep the compiler and the flags of
    # that attempt. With Ninja the sources of one target do not wait for another target. A folder that was configured
    # for make stays with make.
    if [ ! -e "$folder/Makefile" ] && [ ! -e "$folder/build.ninja" ]; then
        rm -rf "$folder/CMakeCache.txt" "$folder/CMakeFiles"
        ! command -v ninja >/dev/null 2>&1 || settings="-G Ninja $settings"
    fi
    # shellcheck disable=SC2086  # a list of words
    step "$folder: configure" cmake -S . -B "$folder" -DMARGAY_TESTS=ON -DMARGAY_SAMPLES=ON -DMARGAY_TEST_LINES=OFF \
        -DMARGAY_TEST_PROCESSORS=3 -DMARGAY_BUILD_ONCE=ON -DMARGAY_WERROR=ON $settings
    step "$folder: build" cmake --build "$folder" --parallel "$(compilers)"
    : >"$records/log"
    # A test that computes counts as three, so that no more of these tests run than there are processors. A test that
    # waits counts as one.
    step "$folder: tests" ctest --test-dir "$folder" --parallel $((3 * $(nproc))) --output-on-failure \
        --output-log "$records/log" "$@" || failed_alone "$folder" || { echo "Failed in $folder:"; failures; exit 1; } >&2
    sed -n "s|^[0-9]*% tests passed.*|$folder: &|p" "$records/log" >>"$records/summaries"
    # ctest names the entries that it skipped. If an entry contains many tests, the output names the skipped tests.
    grep '(Skipped)$' "$records/log" >"$records/skipped" || true
    case $settings in *TEST_SHARDS=[1-9]*)
        sed -n 's|^\[  SKIPPED \] \([^ ]*\.[^ ]*\)$|  \1 (Skipped)|p' "$folder/Testing/Temporary/LastTest.log" \
            2>/dev/null | sort -u >"$records/skipped"
        sed "1i $folder, tests that did not run:" "$records/skipped"
        ;;
    esac
    if [ $skips = no ] && [ -s "$records/skipped" ]; then
        echo "Skipped, and --no-skips was given:" >&2
        cat "$records/skipped" >&2
        exit 1
    fi
}

if [ $quick = yes ]; then
    run build -DMARGAY_UNITY=ON -DMARGAY_TEST_PROGRAMS=all -DMARGAY_TEST_BUILDS=OFF -- "$@"
else
    # A sanitized program takes long to start, so each program is four entries of ctest. With arguments, which can
    # select single tests, each test is an entry.
    shards=4
    [ $# -eq 0 ] || shards=0
    # clang compiles sanitized code in less time than GCC. This build then also proves that clang's Debug has no
    # warning. LLVM's linker links a sanitized program in a third of the time.
    compiler=
    nested_clang=ON
    echo 'int main() {}' >"$records/program.cpp"
    if clang++-16 -fsanitize=address,undefined -o "$records/program" "$records/program.cpp" 2>/dev/null; then
        compiler='-DCMAKE_CXX_COMPILER=clang++-16 -DCMAKE_C_COMPILER=clang-16'
        nested_clang=OFF
        if clang++-16 -fuse-ld=lld -fsanitize=address,undefined -o "$records/program" "$records/program.cpp" 2>/dev/null; then
            compiler="$compiler -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld"
        fi
        # A build folder cannot change its compiler.
        if [ -e build-sanitized/CMakeCache.txt ] && ! grep -q '^CMAKE_CXX_COMPILER:.*clang' build-sanitized/CMakeCache.txt; then
            rm -rf build-sanitized
        fi
    fi
    # Each source of the core is compiled alone, because tests install the archives of this build.
    run build -DMARGAY_UNITY=tests -DMARGAY_TEST_PROGRAMS=unsanitized -DMARGAY_TEST_BUILDS=ON -DMARGAY_NESTED_CLANG=$nested_clang -- "$@"
    export UBSAN_OPTIONS=print_stacktrace=1
    # shellcheck disable=SC2086  # a list of words
    run build-sanitized -DMARGAY_UNITY=ON -DMARGAY_SANITIZE=address -DCMAKE_BUILD_TYPE=Debug -DMARGAY_TEST_SHARDS=$shards $compiler \
        -- "$@"
    export TSAN_OPTIONS=halt_on_error=1
    run build-threads -DMARGAY_UNITY=ON -DMARGAY_SANITIZE=thread -DMARGAY_SAMPLES=OFF -DMARGAY_COMPAT=OFF -DCMAKE_BUILD_TYPE=Debug \
        -DMARGAY_TEST_SHARDS=$shards -- -L threads "$@"
fi

echo
echo '  step                          seconds  processor seconds'
cat "$records/steps"
if [ ! -s "$records/summaries" ] && [ $lists = no ]; then
    echo "test/run.sh: no test was run" >&2
    exit 1
fi
cat "$records/summaries"
