// Measures how much more a cycle through ecrt.h costs than the same cycle through the native API: user instructions,
// counted by callgrind. Both loops use the same segment in the same state, with ten slaves in OP with outputs and
// inputs, in virtual time. So the difference is the cost of the facade alone.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/segment.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"

#include <unistd.h>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

namespace {

using namespace margay;

constexpr std::uint32_t kSlaves = 10;
constexpr unsigned kCycles = 1000;

// Permitted number of instructions more than the native cycle.
constexpr double kMost = 250;
constexpr std::uint32_t kSizes[] = {2, 8, 31};

// The source of the facade: slaves with this number of octets in each direction.
std::uint32_t octets = 8;

VirtualOsal* osal = nullptr;

// A description of the segment in a folder of its own.
std::string describe_segment() {
    const auto folder = std::filesystem::temp_directory_path() / ("margay-bench-ecrt-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    const auto image = io_image(octets * 8, octets * 8);
    std::ofstream(folder / "io.bin", std::ios::binary)
        .write(reinterpret_cast<const char*>(image.data()), static_cast<std::streamsize>(image.size()));
    std::ofstream(folder / "bench.toml") << "[[slave]]\ncount = " << kSlaves
                                         << "\nsii = \"io.bin\"\nchip = \"ip_core\"\n";
    return folder;
}

}  // namespace

namespace margay::compat::ecrt {

std::string bound_source(unsigned) { return "sim:bench"; }

hosted::OpenedSource open_segment(const std::string&) {
    const std::string folder = describe_segment();
    auto opened = hosted::open_source("sim:" + folder + "/bench.toml");
    std::filesystem::remove_all(folder);
    if (opened) osal = static_cast<VirtualOsal*>(&opened->osal());
    return opened;
}

}  // namespace margay::compat::ecrt

namespace {

struct Program {
    ec_master_t* master = nullptr;
    ec_domain_t* domain = nullptr;
    bool good = true;

    // Brings ten slaves to OP and exchanges their process data.
    bool start(bool split) {
        master = ecrt_request_master(0);
        if (master == nullptr) return false;
        domain = ecrt_master_create_domain(master);
        const auto bits = static_cast<std::uint8_t>(octets * 8);
        const ec_pdo_entry_info_t out[] = {{0x7000, 1, bits}};
        const ec_pdo_entry_info_t in[] = {{0x6000, 1, bits}};
        const ec_pdo_info_t pdos[] = {{0x1600, 1, out}, {0x1A00, 1, in}};
        const ec_sync_info_t syncs[] = {{0, EC_DIR_OUTPUT, 1, &pdos[0], EC_WD_DEFAULT},
                                        {1, EC_DIR_INPUT, 1, &pdos[1], EC_WD_DEFAULT},
                                        {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}};
        for (std::uint16_t n = 0; n < kSlaves; ++n) {
            ec_slave_config_t* config = ecrt_master_slave_config(master, 0, n, sim::kVendorId, IoDevice{}.product);
            if (config == nullptr || ecrt_slave_config_pdos(config, EC_END, syncs) != 0) return false;
            if (ecrt_slave_config_reg_pdo_entry(config, 0x7000, 1, domain, nullptr) < 0) return false;
            if (split) continue;
            if (ecrt_slave_config_reg_pdo_entry(config, 0x6000, 1, domain, nullptr) < 0) return false;
        }
        for (std::uint16_t n = 0; split && n < kSlaves; ++n)
            if (ecrt_slave_config_reg_pdo_entry(
                    ecrt_master_slave_config(master, 0, n, sim::kVendorId, IoDevice{}.product), 0x6000, 1, domain,
                    nullptr) < 0)
                return false;
        if (ecrt_master_activate(master) != 0) return false;
        for (int n = 0; n < 5000; ++n) {
            cycle();
            ec_master_state_t state;
            ecrt_master_state(master, &state);
            if (state.al_states == 8 && n > 100 && good) return true;
        }
        return false;
    }

    void cycle() {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ec_domain_state_t state;
        ecrt_domain_state(domain, &state);
        good = state.wc_state == EC_WC_COMPLETE;
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }

    void native_cycle() {
        Context& ctx = *master->bus->ctx;
        osal->advance(std::chrono::milliseconds(1));
        good = receive_processdata(ctx, Duration{0}).ok();
        poll(ctx, osal->now());
        (void)send_processdata(ctx, osal->now());
    }
};

}  // namespace

// Callgrind counts only inside this function.
extern "C" [[gnu::noinline]] bool measured_cycles(void* program, bool native);
bool measured_cycles(void* program, bool native) {
    auto& it = *static_cast<Program*>(program);
    bool all = true;
    for (unsigned n = 0; n < kCycles; ++n) {
        native ? it.native_cycle() : it.cycle();
        all &= it.good;
    }
    return all;
}

namespace {

int child(const std::string& work, std::uint32_t bytes) {
    octets = bytes;
    Program program;
    if (!program.start(work == "split")) {
        std::fprintf(stderr, "the slaves are not in OP\n");
        return 1;
    }
    return measured_cycles(&program, work == "native") ? 0 : 1;
}

// Instructions per cycle; negative after an error. Before activation a second thread polls without a pause, because
// time is virtual. Without `--fair-sched`, valgrind may delay the other thread for a long time.
double count(const std::string& self, const std::string& work, std::uint32_t bytes) {
    const std::string command =
        "valgrind --fair-sched=try --tool=callgrind --callgrind-out-file=/dev/null "
        "--toggle-collect=measured_cycles " +
        self + " " + work + " " + std::to_string(bytes) + " 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return -1;
    double collected = -1;
    char line[256];
    while (std::fgets(line, sizeof line, pipe) != nullptr)
        if (const char* at = std::strstr(line, "Collected : ")) collected = std::strtod(at + 12, nullptr);
    return pclose(pipe) == 0 ? collected / kCycles : -1;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc == 3) return child(argv[1], static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10)));
    if (std::system("valgrind --version >/dev/null 2>&1") != 0) {
        std::printf("no valgrind here: nothing was counted\n");
        return 77;
    }
    bool kept = true;
    for (const std::uint32_t bytes : kSizes) {
        const double native = count(argv[0], "native", bytes);
        for (const bool mixed : {true, false}) {
            const double facade = count(argv[0], mixed ? "mixed" : "split", bytes);
            std::printf("%u slaves, %u + %u octets, %s: %.0f instructions more than the native cycle, %.0f at most\n",
                        kSlaves, bytes, bytes,
                        mixed ? "outputs and inputs slave by slave" : "all outputs, then all inputs", facade - native,
                        kMost);
            kept &= native > 0 && facade > 0 && facade - native <= kMost;
        }
    }
    return kept ? 0 : 1;
}
