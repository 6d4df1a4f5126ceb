// A slave whose PDOs cannot be read stays in PREOP, and the segment does not start again for this slave, because a
// restart would change nothing. The slave answers no mail (it is present at activation, or appears later), or it does
// not have the PDO that the program assigns. The other drive reaches OP once and stays in OP. Ends with 0 when
// everything is as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

#include <string_view>

namespace {

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ~Program() { ecrt_release_master(master); }
};

// `assigned`: a PDO for a SyncManager of the second drive; 0: the program names no PDO. `restarts`: how often the
// segment may start again, because the library does not read the PDOs of the slave before.
int run(std::uint8_t sync, std::uint16_t assigned, bool late, unsigned restarts) {
    const Program program;
    ec_master_t* const master = program.master;
    CHECK(master != nullptr);
    go_to(*master, late ? std::chrono::minutes(60) - std::chrono::seconds(3) : Duration{0});
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const drive = configure_drive(master, 0);
    ec_slave_config_t* const other = ecrt_master_slave_config(master, 0, 1, kVendor, kDrive);
    CHECK(domain != nullptr && drive != nullptr && other != nullptr);
    CHECK(ecrt_slave_config_reg_pdo_entry(drive, 0x6041, 0, domain, nullptr) >= 0);
    if (assigned != 0) {
        const ec_pdo_info_t pdo = sync == 2 ? ec_pdo_info_t{assigned, 0, nullptr} : kPdos[1];
        const ec_sync_info_t syncs[] = {{sync, sync == 2 ? EC_DIR_OUTPUT : EC_DIR_INPUT, 1, &pdo, EC_WD_DEFAULT},
                                        {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}};
        CHECK(ecrt_slave_config_pdos(other, EC_END, syncs) == 0);
    }
    CHECK(ecrt_master_activate(master) == 0);
    ec_slave_config_state_t of_drive{};
    ec_slave_config_state_t of_other{};
    unsigned rises = 0;
    bool was_online = false;
    for (int n = 0; n < 40000; ++n) {
        const bool before = of_drive.operational;
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_slave_config_state(drive, &of_drive);
        ecrt_slave_config_state(other, &of_other);
        if (of_drive.operational && !before) ++rises;
        was_online |= of_other.online;
        CHECK(!of_other.operational);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    std::printf("the first drive has come to OP %u times; the other one has AL state %u\n", rises, of_other.al_state);
    CHECK(was_online && of_drive.operational && rises >= 1 && rises <= 1 + restarts &&
          of_other.al_state == EC_AL_STATE_PREOP);
    return 0;
}

}  // namespace

int main(int, char** argv) {
    segment = argv[1];
    const std::string_view scene = argv[2];
    if (scene == "mute") return run(0, 0, false, 0);
    if (scene == "late") return run(0, 0, true, 0);
    if (scene == "late_inputs") return run(3, 0x1A00, true, 1);
    return run(2, 0x1655, false, 0);  // the drive has no such PDO
}
