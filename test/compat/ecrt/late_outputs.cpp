// A configuration has PDOs only for the outputs of its slave. The slave also has inputs, and appears after activation:
// it attaches, and no other slave leaves OP. Ends with 0 when everything is as expected.
#include "virtual_time.hpp"

namespace {

constexpr ec_pdo_entry_info_t kEntries[] = {{0x6040, 0, 16}, {0x6060, 0, 8}, {0x607A, 0, 32}};
constexpr ec_pdo_info_t kPdos[] = {{0x1600, 3, kEntries}};
constexpr ec_sync_info_t kSyncs[] = {{2, EC_DIR_OUTPUT, 1, kPdos, EC_WD_ENABLE},
                                     {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}};

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ~Program() { ecrt_release_master(master); }
};

int run() {
    const Program program;
    ec_master_t* const master = program.master;
    CHECK(master != nullptr);
    go_to(*master, std::chrono::minutes(60) - std::chrono::seconds(3));
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    unsigned bit = 0;
    ec_slave_config_t* const input = ecrt_master_slave_config(master, 0, 0, 0x00004D47, 0x1008);
    CHECK(domain != nullptr && input != nullptr);
    CHECK(ecrt_slave_config_reg_pdo_entry(input, 0x6000, 1, domain, &bit) == 0);
    ec_slave_config_t* const drive = ecrt_master_slave_config(master, 0, 1, 0x00004D47, 0x5402);
    CHECK(drive != nullptr && ecrt_slave_config_pdos(drive, EC_END, kSyncs) == 0);
    const int mode = ecrt_slave_config_reg_pdo_entry(drive, 0x6060, 0, domain, nullptr);
    CHECK(mode == 3);
    ec_sdo_request_t* const shown = ecrt_slave_config_create_sdo_request(drive, 0x6061, 0, 1);
    ec_reg_request_t* const inputs = ecrt_slave_config_create_reg_request(drive, 8);
    CHECK(shown != nullptr && inputs != nullptr && ecrt_master_activate(master) == 0);
    EC_WRITE_S8(ecrt_domain_data(domain) + mode, 8);

    ec_domain_state_t state{};
    ec_slave_config_state_t of_slave{};
    ec_slave_config_state_t of_input{};
    const auto cycle = [&] {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_state(domain, &state);
        ecrt_slave_config_state(drive, &of_slave);
        ecrt_slave_config_state(input, &of_input);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    };
    for (int n = 0; n < 1000; ++n) cycle();
    CHECK(!of_slave.online && of_input.operational && state.wc_state == EC_WC_INCOMPLETE);
    for (int n = 0; n < 20000 && !of_slave.operational; ++n) {
        cycle();
        CHECK(of_input.operational && state.working_counter >= 1);
    }
    for (int n = 0; n < 50; ++n) cycle();
    CHECK(of_slave.operational && of_input.operational);
    CHECK(state.wc_state == EC_WC_COMPLETE && state.working_counter == 3);
    // The SyncManager of the inputs is enabled, with the length of the PDOs of the slave.
    ecrt_reg_request_read(inputs, 0x0818, 8);
    for (int n = 0; n < 1000 && ecrt_reg_request_state(inputs) == EC_REQUEST_BUSY; ++n) cycle();
    const uint8_t* const registers = ecrt_reg_request_data(inputs);
    CHECK(ecrt_reg_request_state(inputs) == EC_REQUEST_SUCCESS && EC_READ_U16(registers + 2) == 20);
    CHECK(EC_READ_BIT(registers + 6, 0) == 1);
    ecrt_sdo_request_read(shown);
    for (int n = 0; n < 1000 && ecrt_sdo_request_state(shown) == EC_REQUEST_BUSY; ++n) cycle();
    CHECK(ecrt_sdo_request_state(shown) == EC_REQUEST_SUCCESS && EC_READ_S8(ecrt_sdo_request_data(shown)) == 8);
    return 0;
}

// A configuration names no PDO. The image has no space for the slave, so the segment starts again.
int run_unnamed() {
    const Program program;
    ec_master_t* const master = program.master;
    CHECK(master != nullptr);
    go_to(*master, std::chrono::minutes(60) - std::chrono::seconds(3));
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const drive = ecrt_master_slave_config(master, 0, 1, 0x00004D47, 0x5402);
    CHECK(domain != nullptr && drive != nullptr && ecrt_master_activate(master) == 0);
    ec_slave_config_state_t state{};
    for (int n = 0; n < 20000 && !state.operational; ++n) {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_slave_config_state(drive, &state);
        CHECK(n > 1000 || !state.online);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    CHECK(state.online && state.operational && state.al_state == 8);
    return 0;
}

}  // namespace

int main() {
    segment = "sim:digital_in_8,drive@3600s";
    const int named = run();
    return named != 0 ? named : run_unnamed();
}
