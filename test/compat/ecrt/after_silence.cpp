// A segment of many slaves is silent until the watchdogs of the slaves have expired. When the segment answers again, no
// slave is shown as operational because of its earlier state: reading the states of so many slaves needs several
// cycles. Ends with 0 when everything is as expected.
#include "virtual_time.hpp"

#include <margay/datagram.hpp>

#include <array>

namespace {

constexpr unsigned kSlaves = 250;
constexpr unsigned kMost = 20000;  // cycles

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    std::array<ec_slave_config_t*, kSlaves> drives{};
    ec_master_state_t state{};
    DatagramRequest close;  // closes the port of the first slave to the master

    ~Program() {
        close.cancel();
        ecrt_release_master(master);
    }

    int configure() {
        for (unsigned n = 0; n < kSlaves; ++n) {
            drives[n] = ecrt_master_slave_config(master, 0, static_cast<std::uint16_t>(n), 0x00004D47, 0x5402);
            CHECK(ecrt_slave_config_reg_pdo_entry(drives[n], 0x6040, 0, domain, nullptr) >= 0);
        }
        return ecrt_master_activate(master);
    }
    void cycle() {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_master_state(master, &state);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    [[nodiscard]] unsigned operational() const {
        unsigned count = 0;
        for (const ec_slave_config_t* const drive : drives) {
            ec_slave_config_state_t of_drive;
            ecrt_slave_config_state(drive, &of_drive);
            if (of_drive.operational) ++count;
        }
        return count;
    }
};

int run() {
    static Program program;
    go_to(*program.master, std::chrono::seconds(1));
    CHECK(program.configure() == 0);
    for (unsigned n = 0; n < kMost && program.operational() != kSlaves; ++n) program.cycle();
    for (unsigned n = 0; n < 100; ++n) program.cycle();
    CHECK(program.operational() == kSlaves && program.state.al_states == EC_AL_STATE_OP);

    // The loop settings of the DL control register, for one second.
    std::array<std::byte, 2> closed{std::byte{0x03}, std::byte{0x03}};
    program.close.command = DatagramCommand::apwr;
    program.close.ado = 0x0100;
    program.close.data = closed;
    CHECK(submit(*program.master->bus->ctx, program.close).ok());
    unsigned silent = 0;
    for (unsigned n = 0; n < kMost && program.state.slaves_responding != 0; ++n) program.cycle();
    for (; silent < kMost && program.state.slaves_responding == 0; ++silent) program.cycle();
    const unsigned first = program.operational();
    std::printf("after %u silent cycles %u slaves respond, %u are operational\n", silent,
                program.state.slaves_responding, first);
    CHECK(silent > 500 && silent < kMost && program.state.slaves_responding == kSlaves && first == 0);
    for (unsigned n = 0; n < kMost && program.operational() != kSlaves; ++n) program.cycle();
    CHECK(program.operational() == kSlaves);
    return 0;
}

}  // namespace

int main() {
    for (unsigned n = 0; n < kSlaves; ++n) segment += n == 0 ? "sim:drive" : ",drive";
    return run();
}
