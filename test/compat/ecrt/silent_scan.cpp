// The line is silent for one second while the segment starts up, from some cycle on. The information about a slave is
// what was read of the slave, or an error, and never an empty record. Afterwards all drives reach OP, also with SYNC
// signals. When the last drive is disconnected permanently, the other drives reach OP. Ends with 0 when everything is
// as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

#include <margay/datagram.hpp>

#include <array>

namespace {

constexpr std::uint16_t kSlaves = 3;

constexpr unsigned kMost = 60'000;  // cycles until all drives are in OP with their SYNC signals

struct Counts {
    unsigned errors = 0;
    unsigned right = 0;
    unsigned empty = 0;
};

// The fault: the port of the first drive to the master is closed for one second, or the port to the last drive is
// closed permanently. Frames that are lost while the clocks are synchronised lead to a scan.
enum class Fault { silence, silence_with_clocks, drive_gone_with_clocks };

int run(unsigned begin, Fault fault, Counts& counts) {
    const bool clocks = fault != Fault::silence;
    const bool gone = fault == Fault::drive_gone_with_clocks;
    const unsigned present = gone ? kSlaves - 1 : kSlaves;
    struct Program {
        ec_master_t* master = ecrt_request_master(0);
        DatagramRequest close;
        ~Program() {
            close.cancel();
            ecrt_release_master(master);
        }
    };
    Program program;
    ec_master_t* const master = program.master;
    CHECK(master != nullptr);
    go_to(*master, Duration{0});
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    for (std::uint16_t n = 0; n < kSlaves; ++n) {
        ec_slave_config_t* const drive = configure_drive(master, n);
        CHECK(drive != nullptr && ecrt_slave_config_reg_pdo_entry(drive, 0x607A, 0, domain, nullptr) >= 0);
        if (clocks) CHECK(ecrt_slave_config_dc(drive, 0x300, 1'000'000, 500'000, 0, 0) == 0);
    }
    CHECK(ecrt_master_activate(master) == 0);
    std::array<std::byte, 2> closed{std::byte{0x03}, std::byte{0x03}};
    if (gone) closed = {std::byte{0x01}, std::byte{0x0C}};
    program.close.command = DatagramCommand::apwr;
    program.close.adp = gone ? 2 - kSlaves : 0;
    program.close.ado = 0x0100;
    program.close.data = closed;
    ec_master_state_t state{};
    for (unsigned n = 0; n < (clocks ? kMost : 3000) && (n < 3000 || state.al_states != EC_AL_STATE_OP); ++n) {
        if (n == begin) CHECK(submit(*master->bus->ctx, program.close).ok());
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        for (std::uint16_t slave = 0; slave < kSlaves; ++slave) {
            ec_slave_info_t info;
            if (ecrt_master_get_slave(master, slave, &info) != 0)
                ++counts.errors;
            else
                ++(info.vendor_id == kVendor && info.product_code == kDrive ? counts.right : counts.empty);
        }
        ecrt_master_state(master, &state);
        if (clocks) {
            ecrt_master_application_time(master, static_cast<std::uint64_t>(osal->now().time_since_epoch().count()));
            ecrt_master_sync_reference_clock(master);
            ecrt_master_sync_slave_clocks(master);
        }
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    CHECK(state.al_states == EC_AL_STATE_OP && state.slaves_responding == present);
    return 0;
}

}  // namespace

int main() {
    segment = "sim:drive,drive,drive";
    Counts counts;
    for (const Fault fault : {Fault::silence, Fault::silence_with_clocks, Fault::drive_gone_with_clocks})
        for (unsigned begin = 1; begin < 400; begin += 1 + begin / 8)
            if (run(begin, fault, counts) != 0) {
                std::printf("from cycle %u on, fault %d\n", begin, static_cast<int>(fault));
                return 1;
            }
    std::printf("%u errors, %u right answers, %u empty ones\n", counts.errors, counts.right, counts.empty);
    CHECK(counts.errors != 0 && counts.right != 0 && counts.empty == 0);
    return 0;
}
