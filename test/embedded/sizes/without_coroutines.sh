#!/bin/sh
# Measures the cost of the coroutines themselves on a Cortex-M4. The script compiles sources twice, as they are and as
# blocking functions (`co_return` becomes `return`; `co_await` calls the function, or waits for the reply by one call).
# Only the sizes of the blocking functions are of interest: the functions could not be cancelled, and could not serve
# another slave meanwhile.
#
#   sh test/embedded/sizes/without_coroutines.sh BUILD [SOURCE …]
#
# BUILD is the folder of a build, which has generated headers. By default the script compiles all sources with sequences
# except those of src/api, in about 2 minutes. A source that cannot be compiled as blocking functions is left out and
# named.
set -eu
cd "$(dirname "$0")/../../.."
tree=$PWD
headers=$(realpath "$1")/include
shift
[ $# -gt 0 ] || set -- src/network/*.cpp src/station/*.cpp src/mailbox/*.cpp
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
cp -r src include "$copy"

cat >"$copy/blocking.hpp" <<'END'
#pragma once
#include <margay/task.hpp>
namespace margay {
template <class T = Result<>>
using Blocking = T;
void wait_for(void* awaited);
// The error ends the function.
#define REQUIRED(...)                          \
    ({                                         \
        auto awaited_ = Wait{}->*(__VA_ARGS__); \
        if (!awaited_) return awaited_.error(); \
        *awaited_;                             \
    })
#define COMPLETED(...) (void)(__VA_ARGS__)
struct Wait {
    template <class Awaited>
    [[gnu::always_inline]] decltype(auto) operator->*(Awaited&& awaited) const {
        if constexpr (requires { awaited.await_resume(); }) {
            if (!awaited.await_ready()) {
                if constexpr (requires { { awaited.await_suspend({}) } -> std::same_as<bool>; }) {
                    if (awaited.await_suspend({})) wait_for(&awaited);
                } else {
                    awaited.await_suspend({});
                    wait_for(&awaited);
                }
            }
            return awaited.await_resume();
        } else if constexpr (requires { awaited.operator co_await(); }) {
            return *this->*awaited.operator co_await();
        } else {
            return static_cast<std::remove_cvref_t<Awaited>>(awaited);
        }
    }
};
}
END
find "$copy/src" -name '*.?pp' ! -path '*/util/task.*' ! -path '*/sim/*' ! -path '*/subdevice/*' \
    -exec grep -lE 'Task<|co_(await|return)' {} + |
    xargs sed -i -e "s/\bco_await required(/REQUIRED(/g; s/\bco_await completion(/COMPLETED(/g" \
        -e "s/\bTask</Blocking</g; s/\bco_return\b/return/g; s/\bco_await /Wait{}->*/g" \
        -e "1i #include \"$copy/blocking.hpp\""

# size FOLDER SOURCE: prints the octets of code and constants, or nothing when the source cannot be compiled.
size() {
    (cd "$1" && arm-none-eabi-g++ -std=c++20 -Os -DNDEBUG -mcpu=cortex-m4 -mthumb -ffunction-sections -fno-exceptions \
        -fno-rtti -fno-unwind-tables -fno-asynchronous-unwind-tables -fno-jump-tables -w -Iinclude -Isrc \
        -I"$tree" -I"$headers" -c "$2" -o "$copy/object.o" 2>"$copy/errors") || return 0
    arm-none-eabi-size -A -d "$copy/object.o" | awk '/^\.(text|rodata)/ { octets += $2 } END { print octets }'
}

printf '%-32s %10s %9s %10s %10s\n' source sequences co_await coroutines blocking
for source in "$@"; do
    waits=$(grep -c co_await "$source" || true)
    [ "$waits" -gt 0 ] || continue
    blocking=$(size "$copy" "$source")
    if [ -z "$blocking" ]; then  # the source uses handles of coroutines
        echo "left out: $source, with $waits co_await" >&2
        continue
    fi
    coroutines=$(size "$tree" "$source")
    sequences=$(arm-none-eabi-nm "$copy/object.o" | grep -c '\.actor')
    printf '%-32s %10d %9d %10d %10d\n' "$source" "$sequences" "$waits" "$coroutines" "$blocking"
done | awk '{ print; sequences += $2; waits += $3; coroutines += $4; blocking += $5 }
    END { printf "%-32s %10d %9d %10d %10d\n", "all", sequences, waits, coroutines, blocking
          if (!sequences) exit 1
          printf "of the coroutines alone: %d octets, %d %%, %d for each sequence\n", coroutines - blocking,
              100 * (coroutines - blocking) / coroutines, (coroutines - blocking) / sequences }'
