// The end of the line is disconnected. From the first cycle on, the working counter of the domain has the share of the
// other slaves, although the master needs some cycles to find the missing slaves. Virtual time. Ends with 0 when
// everything is as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

#include <margay/datagram.hpp>

#include <array>

namespace {

constexpr std::uint16_t kSlaves = 8;
constexpr std::uint16_t kLeft = 6;
constexpr unsigned kShare = 3;     // of one slave: outputs 2, inputs 1
constexpr unsigned kMost = 20000;  // cycles

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    ec_domain_state_t state{};
    ec_master_state_t of_master{};
    DatagramRequest close;

    ~Program() {
        close.cancel();
        ecrt_release_master(master);
    }
    int configure() {
        for (std::uint16_t n = 0; n < kSlaves; ++n) {
            ec_slave_config_t* const drive = configure_drive(master, n);
            CHECK(drive != nullptr && ecrt_slave_config_reg_pdo_entry(drive, 0x6040, 0, domain, nullptr) >= 0);
            CHECK(ecrt_slave_config_reg_pdo_entry(drive, 0x6041, 0, domain, nullptr) >= 0);
        }
        return ecrt_master_activate(master);
    }
    void cycle() {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_state(domain, &state);
        ecrt_master_state(master, &of_master);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    [[nodiscard]] bool is_complete() const {
        return state.wc_state == EC_WC_COMPLETE && state.working_counter == kSlaves * kShare &&
               of_master.al_states == EC_AL_STATE_OP;
    }
};

int run() {
    static Program program;
    go_to(*program.master, Duration{0});
    CHECK(program.configure() == 0);
    for (unsigned n = 0; n < kMost && !program.is_complete(); ++n) program.cycle();
    for (unsigned n = 0; n < 100; ++n) program.cycle();
    CHECK(program.is_complete());

    // The loop settings of the DL control register close the port to the next slave for one second.
    std::array<std::byte, 2> closed{std::byte{0x03}, std::byte{0x0C}};
    program.close.command = DatagramCommand::apwr;
    program.close.adp = static_cast<std::uint16_t>(1 - kLeft);
    program.close.ado = 0x0100;
    program.close.data = closed;
    CHECK(submit(*program.master->bus->ctx, program.close).ok());
    unsigned unknown = 0;  // cycles in which the missing slaves are not known
    unsigned known = 0;
    for (unsigned n = 0; n < 500; ++n) {
        program.cycle();
        if (program.is_complete()) continue;
        CHECK(program.state.wc_state == EC_WC_INCOMPLETE && program.state.working_counter == kLeft * kShare);
        ++(program.of_master.slaves_responding == kSlaves ? unknown : known);
    }
    std::printf("%u cycles until the missing slaves are known, %u with them\n", unknown, known);
    CHECK(unknown > 0 && known > 400);
    for (unsigned n = 0; n < kMost && !program.is_complete(); ++n) program.cycle();
    CHECK(program.is_complete());
    return 0;
}

}  // namespace

int main() {
    segment = "sim:drive,drive,drive,drive,drive,drive,drive,drive";
    return run();
}
