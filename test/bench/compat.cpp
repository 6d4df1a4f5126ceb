// Measures how much more a cycle through the interface of another master costs than the same cycle by the functions of
// the library: user instructions, counted by callgrind, of the functions that send and receive process data. Both
// cycles use the same simulated segment in virtual time, so the cost of the simulation is the same in both and is not
// part of the difference.
#include "source/source.hpp"

#include <ethercat.h>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

using namespace margay;

constexpr const char* kSegment = "sim:coupler";
constexpr int kFew = 500;
constexpr int kMany = 1500;
// Permitted number of instructions more than the cycle of the library.
constexpr long kMost = 100;
constexpr int kSkipped = 77;

alignas(8) char image[4096];

// The variants of a program: the datagrams of its cycle, and the functions that it calls.
enum class Functions : std::uint8_t { of_library, of_all_groups, of_a_group, with_context };
struct Way {
    const char* name;
    Functions functions;
    bool split;  // LRD and LWR in place of LRW
};
constexpr std::array kWays{
    Way{"library", Functions::of_library, false},   Way{"library-split", Functions::of_library, true},
    Way{"all", Functions::of_all_groups, false},    Way{"all-split", Functions::of_all_groups, true},
    Way{"group", Functions::of_a_group, false},     Way{"group-split", Functions::of_a_group, true},
    Way{"context", Functions::with_context, false}, Way{"context-split", Functions::with_context, true},
};

int run_native(int cycles, bool split) {
    auto source = hosted::open_source(kSegment);
    if (!source) return 1;
    HostContext ctx;
    if (!init(ctx, source->nic(), source->osal())) return 1;
    ctx.group(0).config.packing = Packing::bits;
    ctx.group(0).config.acyclic_bytes = 0;
    ctx.group(0).config.block_lrw = split;
    if (!config_init(ctx)) return 1;
    // The cycle of the interface also carries the time of the first clock.
    for (const Slave& slave : ctx.slaves())
        if (slave.dl.dc && ctx.group(0).config.dc_reference == 0) ctx.group(0).config.dc_reference = slave.number;
    if (!config_map(ctx, std::as_writable_bytes(std::span(image)))) return 1;
    std::uint32_t sum = 0;
    for (int n = 0; n < cycles; ++n) {
        if (!send_processdata(ctx)) return 1;
        const auto wkc = receive_processdata(ctx, std::chrono::microseconds(EC_TIMEOUTRET));
        if (!wkc) return 1;
        sum += *wkc;
    }
    return sum == static_cast<std::uint32_t>(cycles) * ctx.group(0).expected_wkc ? 0 : 1;
}

template <Functions functions>
int cycle() {
    if constexpr (functions == Functions::of_a_group) {
        ec_send_processdata_group(0);
        return ec_receive_processdata_group(0, EC_TIMEOUTRET);
    } else if constexpr (functions == Functions::with_context) {
        ecx_send_processdata(&ecx_context);
        return ecx_receive_processdata(&ecx_context, EC_TIMEOUTRET);
    } else {
        ec_send_processdata();
        return ec_receive_processdata(EC_TIMEOUTRET);
    }
}

template <Functions functions>
int run_cycles(int cycles) {
    const int expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    int wrong = 0;
    for (int n = 0; n < cycles; ++n) wrong += cycle<functions>() == expected ? 0 : 1;
    return wrong;
}

int run_facade(int cycles, const Way& way) {
    setenv("MARGAY_SIM_TIME", "virtual", 1);
    if (ec_init(kSegment) <= 0 || ec_config_init(FALSE) <= 0) return 1;
    ec_group[0].blockLRW = way.split ? 1 : 0;
    ec_config_map(image);
    int wrong = 0;
    if (way.functions == Functions::of_a_group)
        wrong = run_cycles<Functions::of_a_group>(cycles);
    else if (way.functions == Functions::with_context)
        wrong = run_cycles<Functions::with_context>(cycles);
    else
        wrong = run_cycles<Functions::of_all_groups>(cycles);
    ec_close();
    return wrong == 0 ? 0 : 1;
}

int run(const std::string& name, int cycles) {
    for (const Way& way : kWays) {
        if (name != way.name) continue;
        return way.functions == Functions::of_library ? run_native(cycles, way.split) : run_facade(cycles, way);
    }
    return 1;
}

// Instructions of the whole program; negative: valgrind is missing, or the program failed.
long instructions(const std::string& self, const char* mode, int cycles) {
    const std::string command = "valgrind --tool=callgrind --callgrind-out-file=/dev/null " + self + " " + mode + " " +
                                std::to_string(cycles) + " 2>&1";
    FILE* const pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return -1;
    long total = -1;
    char line[512];
    while (std::fgets(line, sizeof(line), pipe) != nullptr)
        if (const char* const at = std::strstr(line, "Collected : ")) total = std::atol(at + 12);
    return pclose(pipe) == 0 ? total : -1;
}

long per_cycle(const std::string& self, const char* mode) {
    const long few = instructions(self, mode, kFew);
    const long many = instructions(self, mode, kMany);
    return few < 0 || many < 0 ? -1 : (many - few) / (kMany - kFew);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc == 3) return run(argv[1], std::atoi(argv[2]));
    if (std::system("valgrind --version > /dev/null 2>&1") != 0) {
        std::puts("skipped: no valgrind");
        return kSkipped;
    }
    bool right = true;
    std::array<long, 2> native{};
    for (const Way& way : kWays) {
        const long cost = per_cycle(argv[0], way.name);
        if (cost < 0) return 1;
        long& library = native[way.split ? 1 : 0];
        if (way.functions == Functions::of_library) {
            library = cost;
            std::printf("%-13s: %ld instructions of the library and of the simulation\n", way.name, cost);
            continue;
        }
        right = right && cost - library <= kMost;
        std::printf("%-13s: %ld more (at most %ld)\n", way.name, cost - library, kMost);
    }
    return right ? 0 : 1;
}
