// Measures what a cycle through the interface of another master costs more than the same cycle by the functions of the
// library: user instructions by callgrind, of ec_send_processdata() and ec_receive_processdata(). Both cycles run on
// the same simulated segment in virtual time, so the simulation costs the same in both and falls out of the difference.
#include "source/source.hpp"

#include <ethercat.h>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

using namespace margay;

constexpr const char* kSegment = "sim:coupler";
constexpr int kFew = 1000;
constexpr int kMany = 3000;
// Instructions more than the cycle of the library.
constexpr long kMost = 100;
constexpr int kSkipped = 77;

alignas(8) char image[4096];

int run_native(int cycles) {
    auto source = hosted::open_source(kSegment);
    if (!source) return 1;
    HostContext ctx;
    if (!init(ctx, source->nic(), source->osal())) return 1;
    ctx.group(0).config.packing = Packing::bits;
    ctx.group(0).config.acyclic_bytes = 0;
    if (!config_init(ctx)) return 1;
    // The cycle of the interface carries the time of the first clock.
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

int run_facade(int cycles) {
    setenv("MARGAY_SIM_TIME", "virtual", 1);
    if (ec_init(kSegment) <= 0 || ec_config_init(FALSE) <= 0) return 1;
    ec_config_map(image);
    const int expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    int wrong = 0;
    for (int n = 0; n < cycles; ++n) {
        ec_send_processdata();
        wrong += ec_receive_processdata(EC_TIMEOUTRET) == expected ? 0 : 1;
    }
    ec_close();
    return wrong == 0 ? 0 : 1;
}

// Instructions of the whole program; negative: no valgrind, or the program failed.
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
    if (argc == 3)
        return std::strcmp(argv[1], "native") == 0 ? run_native(std::atoi(argv[2])) : run_facade(std::atoi(argv[2]));
    if (std::system("valgrind --version > /dev/null 2>&1") != 0) {
        std::puts("skipped: no valgrind");
        return kSkipped;
    }
    const long native = per_cycle(argv[0], "native");
    const long facade = per_cycle(argv[0], "facade");
    if (native < 0 || facade < 0) return 1;
    std::printf(
        "a cycle of the library and of the simulation: %ld instructions; by SOEM 1.4: %ld, %ld more (at most %ld)\n",
        native, facade, facade - native, kMost);
    return facade - native <= kMost ? 0 : 1;
}
