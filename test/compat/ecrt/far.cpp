// Configurations at positions that no slave can have stay offline, and do not disturb other configurations. Virtual
// time. Ends with 0 when everything is as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

#include <vector>

namespace {

struct Address {
    std::uint16_t alias;
    std::uint16_t position;
    bool possible = false;  // its slave appears
};

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    ec_domain_t* far_domain = ecrt_master_create_domain(master);
    ec_slave_config_t* drive = configure_drive(master, 0);
    std::vector<ec_slave_config_t*> others{};
    ~Program() { ecrt_release_master(master); }

    int configure(const std::vector<Address>& addresses) {
        CHECK(drive != nullptr && ecrt_slave_config_reg_pdo_entry(drive, 0x607A, 0, domain, nullptr) >= 0);
        for (const Address& at : addresses) {
            ec_slave_config_t* const config = ecrt_master_slave_config(master, at.alias, at.position, kVendor, kDrive);
            CHECK(config != nullptr && ecrt_slave_config_pdos(config, EC_END, kSyncs) == 0);
            CHECK(ecrt_slave_config_reg_pdo_entry(config, 0x607A, 0, far_domain, nullptr) >= 0);
            others.push_back(config);
        }
        return ecrt_master_activate(master);
    }

    void cycle() const {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_process(far_domain);
        ecrt_domain_queue(domain);
        ecrt_domain_queue(far_domain);
        ecrt_master_send(master);
    }
    static bool is_operational(ec_slave_config_t* config) {
        ec_slave_config_state_t state;
        ecrt_slave_config_state(config, &state);
        return state.online && state.operational;
    }
};

int run(const std::vector<Address>& addresses) {
    Program program;
    go_to(*program.master, Duration{0});
    CHECK(program.configure(addresses) == 0);
    for (unsigned n = 0; n < 1000 && !Program::is_operational(program.drive); ++n) program.cycle();
    CHECK(Program::is_operational(program.drive));
    for (unsigned n = 0; n < 20000; ++n) program.cycle();
    ec_domain_state_t state;
    ecrt_domain_state(program.domain, &state);
    CHECK(Program::is_operational(program.drive) && state.wc_state == EC_WC_COMPLETE);
    for (std::size_t n = 0; n < addresses.size(); ++n)
        CHECK(Program::is_operational(program.others[n]) == addresses[n].possible);
    return 0;
}

}  // namespace

int main() {
    segment = "sim:drive,drive#7@3600s";
    const std::vector<std::vector<Address>> all = {
        {{0, 511}},
        {{0, 512}},
        {{0, 60000}, {0, 65535}},
        {{7, 60000}, {9, 65535}},
        {{7, 0}, {7, 600}},
        {{0, 500}, {7, 0}, {7, 50}},
        {{0, 509}, {7, 0}, {8, 0}, {9, 0}},
        {{0, 511}, {7, 0}},
    };
    for (const auto& addresses : all)
        if (run(addresses) != 0) {
            std::printf("configuration %u:%u\n", addresses.front().alias, addresses.front().position);
            return 1;
        }
    segment = "sim:drive,drive#7@3s";
    return run({{7, 0, true}, {7, 600}});
}
