// A C++ program that builds its configuration from classes, SyncManager by SyncManager, and addresses slaves by alias.
// The slave with the alias 16 is the third slave. The slave with the alias 99 appears later, at any position. Ends with
// 0 when all slaves exchange the mapped data.
#include <cycle.h>

#include <ecrt.h>

#include <cerrno>
#include <cstdint>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t kVendor = 0x00004D47;

void must(int result, const std::string& what) {
    if (result < 0) throw std::runtime_error(what + ": " + std::to_string(result));
}

struct Release {
    void operator()(ec_master_t* master) const { ecrt_release_master(master); }
};

class Drive {
  public:
    Drive(ec_master_t* master, std::uint16_t alias, std::uint16_t position)
        : config_(ecrt_master_slave_config(master, alias, position, kVendor, 0x5402)) {
        if (config_ == nullptr) throw std::runtime_error("no configuration");
        must(ecrt_slave_config_sync_manager(config_, 2, EC_DIR_OUTPUT, EC_WD_ENABLE), "SM2");
        must(ecrt_slave_config_sync_manager(config_, 3, EC_DIR_INPUT, EC_WD_DISABLE), "SM3");
        map(2, 0x1600, {{0x6040, 0, 16}, {0x60FF, 0, 32}});
        map(3, 0x1A00, {{0x6041, 0, 16}, {0x606C, 0, 32}, {0x6077, 0, 16}});
        ecrt_slave_config_watchdog(config_, 2498, 2000);
        must(ecrt_slave_config_state_timeout(config_, EC_AL_STATE_PREOP, EC_AL_STATE_SAFEOP, 9000), "timeout");
        const std::uint8_t profile[] = {0x2C, 0x01, 0, 0};
        must(ecrt_slave_config_sdo(config_, 0x6083, 0, profile, sizeof profile), "SDO");
        request_ = ecrt_slave_config_create_reg_request(config_, 8);
    }

    void put_into(ec_domain_t* domain) {
        control_ = ecrt_slave_config_reg_pdo_entry(config_, 0x6040, 0, domain, nullptr);
        must(control_, "control word");
        status_ = ecrt_slave_config_reg_pdo_entry_pos(config_, 3, 0, 0, domain, nullptr);
        must(status_, "status word");
        if (ecrt_slave_config_reg_pdo_entry(config_, 0x6077, 0, domain, nullptr) != status_ + 6)
            throw std::runtime_error("torque is not behind the velocity");
        if (ecrt_slave_config_reg_pdo_entry_pos(config_, 3, 0, 3, domain, nullptr) != -ENOENT)
            throw std::runtime_error("there is no fourth entry");
    }

    bool operational() const {
        ec_slave_config_state_t state;
        ecrt_slave_config_state(config_, &state);
        return state.online && state.operational;
    }
    std::uint16_t status(const std::uint8_t* data) const { return EC_READ_U16(data + status_); }
    void control(std::uint8_t* data, std::uint16_t word) const { EC_WRITE_U16(data + control_, word); }
    ec_reg_request_t* request() const { return request_; }

  private:
    void map(std::uint8_t sync, std::uint16_t pdo, const std::vector<ec_pdo_entry_info_t>& entries) {
        ecrt_slave_config_pdo_assign_clear(config_, sync);
        must(ecrt_slave_config_pdo_assign_add(config_, sync, pdo), "assignment");
        ecrt_slave_config_pdo_mapping_clear(config_, pdo);
        for (const auto& entry : entries)
            must(ecrt_slave_config_pdo_mapping_add(config_, pdo, entry.index, entry.subindex, entry.bit_length),
                 "mapping");
    }

    ec_slave_config_t* config_;
    ec_reg_request_t* request_ = nullptr;
    int control_ = 0;
    int status_ = 0;
};

void cycle(ec_master_t* master, ec_domain_t* domain, const std::vector<Drive>& drives, std::uint8_t* data) {
    next_cycle();
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    for (const auto& drive : drives) drive.control(data, 0x06);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

int run() {
    std::unique_ptr<ec_master_t, Release> master(ecrt_request_master(0));
    if (!master) return 1;
    ec_domain_t* domain = ecrt_master_create_domain(master.get());
    std::vector<Drive> drives;
    drives.emplace_back(master.get(), 0, 0);
    drives.emplace_back(master.get(), 16, 0);
    drives.emplace_back(master.get(), 16, 1);  // the slave behind it
    drives.emplace_back(master.get(), 99, 0);  // later
    for (auto& drive : drives) drive.put_into(domain);
    if (ecrt_domain_size(domain) != 4 * 14) return 2;
    must(ecrt_master_activate(master.get()), "activation");
    std::uint8_t* data = ecrt_domain_data(domain);
    unsigned good = 0;
    for (unsigned n = 0; n < 30000 && good < 100; ++n) {
        cycle(master.get(), domain, drives, data);
        bool all = true;
        for (const auto& drive : drives) all = all && drive.operational() && (drive.status(data) & 0x6F) == 0x21;
        good = count_right(good, all);
    }
    for (const auto& drive : drives)
        std::cout << drive.operational() << " 0x" << std::hex << drive.status(data) << '\n';
    if (good < 100) return 3;
    // The watchdog of the configuration: ESC registers 0x0400 and 0x0420.
    ec_reg_request_t* const request = drives[1].request();
    for (const auto& expected : {std::make_pair(0x0400, 2498), std::make_pair(0x0420, 2000)}) {
        ecrt_reg_request_read(request, static_cast<std::uint16_t>(expected.first), 2);
        for (unsigned n = 0; n < 5000 && ecrt_reg_request_state(request) == EC_REQUEST_BUSY; ++n)
            cycle(master.get(), domain, drives, data);
        if (ecrt_reg_request_state(request) != EC_REQUEST_SUCCESS) return 4;
        if (EC_READ_U16(ecrt_reg_request_data(request)) != expected.second) return 5;
    }
    return 0;
}

}  // namespace

int main() {
    try {
        return run();
    } catch (const std::exception& error) {
        std::cerr << error.what() << '\n';
        return 9;
    }
}
