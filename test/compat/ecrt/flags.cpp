// Flags of configurations, and PDOs that may overlap. The time of the start-up and the datagrams show their effect, so
// the test links the objects of the facade. Its segment has virtual time and replaces the segment of the environment.
// Ends with 0 when everything is as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

namespace {

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = nullptr;
    ec_slave_config_t* drives[2] = {};
    int outputs[2] = {};
    int inputs[2] = {};

    ~Program() { ecrt_release_master(master); }

    int configure() {
        domain = ecrt_master_create_domain(master);
        CHECK(domain != nullptr);
        for (unsigned n = 0; n < 2; ++n) {
            drives[n] = configure_drive(master, static_cast<std::uint16_t>(n));
            CHECK(drives[n] != nullptr);
            outputs[n] = ecrt_slave_config_reg_pdo_entry(drives[n], 0x6060, 0, domain, nullptr);
            inputs[n] = ecrt_slave_config_reg_pdo_entry(drives[n], 0x6061, 0, domain, nullptr);
            CHECK(outputs[n] >= 0 && inputs[n] >= 0 && outputs[n] != inputs[n]);
        }
        return 0;
    }

    ec_wc_state_t cycle() {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ec_domain_state_t state;
        ecrt_domain_state(domain, &state);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        return state.wc_state;
    }

    // Milliseconds until both slaves are in OP; 0: the slaves do not reach OP.
    int start() {
        if (ecrt_master_activate(master) != 0) return 0;
        for (int n = 1; n < 20000; ++n) {
            const bool complete = cycle() == EC_WC_COMPLETE;
            ec_slave_config_state_t first, second;
            ecrt_slave_config_state(drives[0], &first);
            ecrt_slave_config_state(drives[1], &second);
            if (complete && first.operational && second.operational) return n;
        }
        return 0;
    }

    // Number of octets of logical memory in the datagrams of a cycle.
    std::uint32_t logical_octets() const {
        std::uint32_t all = 0;
        for (std::size_t n = 0;; ++n) {
            const PlannedDatagram datagram = process_datagram(*master->bus->ctx, n, 0);
            if (datagram.command == 0) return all;
            all += datagram.bytes;
        }
    }

    // Each drive returns the mode that is commanded.
    int modes_come_back() {
        for (unsigned n = 0; n < 2; ++n) EC_WRITE_U8(ecrt_domain_data(domain) + outputs[n], n == 0 ? 8 : 9);
        for (int n = 0; n < 50; ++n) CHECK(cycle() == EC_WC_COMPLETE);
        for (unsigned n = 0; n < 2; ++n) {
            CHECK(EC_READ_U8(ecrt_domain_data(domain) + outputs[n]) == (n == 0 ? 8 : 9));
            CHECK(EC_READ_U8(ecrt_domain_data(domain) + inputs[n]) == (n == 0 ? 8 : 9));
        }
        return 0;
    }
};

int run() {
    Program usual;
    CHECK(usual.master != nullptr && usual.configure() == 0);
    const int usual_ms = usual.start();
    const std::uint32_t usual_octets = usual.logical_octets();
    CHECK(usual_ms > 0 && usual_octets > 0 && usual.modes_come_back() == 0);
    CHECK(ecrt_slave_config_flag(usual.drives[0], "WaitBeforeSAFEOPms", 1) == -EBUSY);
    ecrt_slave_config_overlapping_pdos(usual.drives[0], 1);
    CHECK(ecrt_master_deactivate(usual.master) == 0);

    // The second slave needs time before SAFEOP. The last value of a flag is used.
    CHECK(usual.configure() == 0);
    CHECK(ecrt_slave_config_flag(usual.drives[1], nullptr, 1) == -EINVAL);
    CHECK(ecrt_slave_config_flag(usual.drives[1], "WaitBeforeSAFEOPms", -1) == -EINVAL);
    CHECK(ecrt_slave_config_flag(usual.drives[1], "WaitBeforeSAFEOPms", 9000) == 0);
    CHECK(ecrt_slave_config_flag(usual.drives[1], "WaitBeforeSAFEOPms", 700) == 0);
    CHECK(ecrt_slave_config_flag(usual.drives[1], "AssignToPdi", 1) == 0);
    CHECK(ecrt_slave_config_flag(usual.drives[1], "OfAnotherMaster", 7) == 0);
    const int later_ms = usual.start();
    std::printf("OP after %d ms, with the flag after %d ms\n", usual_ms, later_ms);
    CHECK(later_ms >= 700 && later_ms < 9000 && later_ms > usual_ms + 400);
    CHECK(usual.logical_octets() == usual_octets && usual.modes_come_back() == 0);
    CHECK(ecrt_master_deactivate(usual.master) == 0);

    // One slave alone does not change the frame.
    CHECK(usual.configure() == 0);
    ecrt_slave_config_overlapping_pdos(usual.drives[1], 1);
    CHECK(usual.start() > 0 && usual.logical_octets() == usual_octets && usual.modes_come_back() == 0);
    CHECK(ecrt_master_deactivate(usual.master) == 0);

    CHECK(usual.configure() == 0);
    for (ec_slave_config_t* drive : usual.drives) ecrt_slave_config_overlapping_pdos(drive, 1);
    CHECK(usual.start() > 0);
    std::printf("%u octets, with overlapping PDOs %u\n", usual_octets, usual.logical_octets());
    CHECK(usual.logical_octets() < usual_octets && usual.modes_come_back() == 0);
    ec_domain_state_t state;
    ecrt_domain_state(usual.domain, &state);
    CHECK(state.working_counter == 6);
    CHECK(ecrt_master_deactivate(usual.master) == 0);

    // The setting is valid for one activation.
    CHECK(usual.configure() == 0);
    CHECK(usual.start() > 0 && usual.logical_octets() == usual_octets);
    return 0;
}

}  // namespace

int main() {
    segment = "sim:drive,drive";
    return run();
}
