// A scan before activation takes longer than 3 s. A call that needs the PDOs of a slave waits for the scan. When the
// PDOs of a slave could not be read, no error says "not mapped". Ends with 0 when everything is as expected.
#include "compat/ecrt/bus.hpp"

#include <check.h>
#include <ecrt.h>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <thread>

namespace {

constexpr std::uint32_t kVendor = 0x00004D47;
constexpr std::uint32_t kDrive = 0x5402;
constexpr auto kLong = std::chrono::milliseconds(4000);

// A drive with a PDO for its inputs, but without a list of the entries of this PDO.
ec_slave_config_t* configure(ec_master_t* master, std::uint16_t position) {
    ec_slave_config_t* const drive = ecrt_master_slave_config(master, 0, position, kVendor, kDrive);
    const bool assigned = drive != nullptr && ecrt_slave_config_pdo_assign_clear(drive, 3) == 0 &&
                          ecrt_slave_config_pdo_assign_add(drive, 3, 0x1A00) == 0;
    return assigned ? drive : nullptr;
}

// A scan that is held for some seconds.
class LongScan {
  public:
    explicit LongScan(ec_master_t* master) : bus_(*master->bus) {
        ecrt_master_reset(master);
        thread_ = std::thread([this] {
            while (!held_) bus_.as_owner([this] { hold(); });
        });
    }
    ~LongScan() { thread_.join(); }
    LongScan(const LongScan&) = delete;
    LongScan& operator=(const LongScan&) = delete;
    [[nodiscard]] bool held() const { return held_; }

  private:
    void hold() {
        held_ = bus_.search.scanning;
        if (held_) std::this_thread::sleep_for(kLong);
    }
    margay::compat::ecrt::Bus& bus_;
    std::atomic<bool> held_{false};
    std::thread thread_;
};

int run(ec_master_t* master) {
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const drive = configure(master, 0);
    ec_slave_config_t* const missing = configure(master, 5);
    CHECK(domain != nullptr && drive != nullptr && missing != nullptr);
    {
        const LongScan scan(master);
        while (!scan.held()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const auto begin = std::chrono::steady_clock::now();
        CHECK(ecrt_slave_config_reg_pdo_entry(drive, 0x6041, 0, domain, nullptr) == 0);
        CHECK(std::chrono::steady_clock::now() - begin > std::chrono::seconds(3));
    }
    CHECK(ecrt_slave_config_reg_pdo_entry(drive, 0x1234, 5, domain, nullptr) == -ENOENT);
    CHECK(ecrt_slave_config_reg_pdo_entry(missing, 0x6041, 0, domain, nullptr) == -ENOENT);
    CHECK(ecrt_slave_config_reg_pdo_entry_pos(missing, 3, 0, 0, domain, nullptr) == -ENOENT);
    CHECK(ecrt_slave_config_pdo_mapping_clear(missing, 0x1A05) == -ENOENT);
    // The entry is in a list of the program, but the size of its SyncManager is not known.
    CHECK(ecrt_slave_config_pdo_assign_add(missing, 3, 0x1A01) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_clear(missing, 0x1A01) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_add(missing, 0x1A01, 0x6061, 0, 8) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(missing, 0x6061, 0, domain, nullptr) == -ENOENT);
    return 0;
}

}  // namespace

int main() {
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(master != nullptr);
    const int result = run(master);
    ecrt_release_master(master);
    if (result == 0) std::fputs("everything was said\n", stderr);
    return result;
}
