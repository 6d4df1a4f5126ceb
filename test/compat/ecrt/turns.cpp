// Threads read objects continuously while another thread activates the master, cycles, and deactivates the master. Each
// transfer succeeds. The slaves are always present, and the states show this. Then a thread resets the master. Ends
// with 0 when everything is as expected.
#include <check.h>
#include <cycle.h>

#include <ecrt.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

namespace {

constexpr unsigned kDrives = 3;
constexpr std::uint32_t kVendor = 0x00004D47;
constexpr std::uint32_t kDrive = 0x5402;

int read_vendor(ec_master_t* master, std::uint16_t position) {
    std::uint8_t vendor[4] = {};
    std::size_t size = 0;
    std::uint32_t abort_code = 1;
    const int result = ecrt_master_sdo_upload(master, position, 0x1018, 1, vendor, sizeof vendor, &size, &abort_code);
    if (result == 0) return size == 4 && EC_READ_U32(vendor) == kVendor ? 0 : -1;
    return abort_code == 0 ? result : -1;
}

class Readers {
  public:
    explicit Readers(ec_master_t* master) {
        for (unsigned n = 0; n < 4; ++n)
            threads_.emplace_back([this, master, n] { read(master, static_cast<std::uint16_t>(n % kDrives)); });
    }
    ~Readers() { stop(); }
    void stop() {
        stop_ = true;
        for (auto& thread : threads_) thread.join();
        threads_.clear();
    }
    unsigned good() const { return good_; }
    unsigned bad() const { return bad_; }

  private:
    void read(ec_master_t* master, std::uint16_t position) {
        while (!stop_) {
            ++(read_vendor(master, position) == 0 ? good_ : bad_);
            std::this_thread::sleep_for(std::chrono::microseconds(500));
        }
    }
    std::atomic<bool> stop_{false};
    std::atomic<unsigned> good_{0};
    std::atomic<unsigned> bad_{0};
    std::vector<std::thread> threads_;
};

int look(ec_master_t* master, ec_slave_config_t* config) {
    ec_master_state_t all;
    ec_slave_config_state_t one;
    ecrt_master_state(master, &all);
    ecrt_slave_config_state(config, &one);
    CHECK(all.slaves_responding == kDrives && all.al_states != 0);
    CHECK(one.online && one.al_state != 0);
    return 0;
}

// Cycles of 5 ms: the scan of the start-up takes longer than the library keeps the states.
int run(ec_master_t* master) {
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const config = ecrt_master_slave_config(master, 0, 1, kVendor, kDrive);
    CHECK(domain != nullptr && config != nullptr);
    CHECK(ecrt_slave_config_reg_pdo_entry(config, 0x6041, 0, domain, nullptr) >= 0);
    CHECK(look(master, config) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    for (unsigned n = 0; n < 150; ++n) {
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        CHECK(look(master, config) == 0);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        for (unsigned m = 0; m < 5; ++m) next_cycle();
    }
    CHECK(ecrt_master_deactivate(master) == 0);
    return 0;
}

// A thread that resets the master continuously does not disturb activation and deactivation.
int run_beside_resets(ec_master_t* master) {
    std::atomic<bool> stop{false};
    std::thread other([&] {
        while (!stop) ecrt_master_reset(master);
    });
    int activated = 0;
    int deactivated = 0;
    for (unsigned round = 0; round < 2 && activated == 0 && deactivated == 0; ++round) {
        CHECK(ecrt_master_create_domain(master) != nullptr);
        CHECK(ecrt_master_slave_config(master, 0, 1, kVendor, kDrive) != nullptr);
        activated = ecrt_master_activate(master);
        for (unsigned n = 0; activated == 0 && n < 100; ++n) {
            ecrt_master_receive(master);
            ecrt_master_send(master);
            next_cycle();
        }
        if (activated == 0) deactivated = ecrt_master_deactivate(master);
    }
    stop = true;
    other.join();
    CHECK(activated == 0 && deactivated == 0);
    return 0;
}

}  // namespace

int main() {
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(master != nullptr);
    {
        Readers readers(master);
        for (unsigned round = 0; round < 5; ++round) {
            for (unsigned ms = 0; ms < 100 + round; ++ms) next_cycle();
            CHECK(run(master) == 0);
        }
        readers.stop();
        std::printf("%u objects were read, %u were not\n", readers.good(), readers.bad());
        CHECK(readers.good() > 20 && readers.bad() == 0);
    }
    CHECK(run_beside_resets(master) == 0);
    // The call ends also without cycles.
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(read_vendor(master, 0) == -EIO);
    for (unsigned ms = 0; ms < 500; ++ms) {
        ecrt_master_receive(master);
        ecrt_master_send(master);
        next_cycle();
    }
    int result = 0;
    std::thread other([&] {
        ec_sync_info_t sync;
        result = ecrt_master_get_sync_manager(master, 2, 3, &sync);
    });
    other.join();
    CHECK(result == -EIO);
    ecrt_release_master(master);
    std::printf("all was read, and without a cycle there was an end\n");
    return 0;
}
