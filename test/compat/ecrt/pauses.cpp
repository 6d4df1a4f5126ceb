// The process stops for a moment repeatedly while a program that has not activated the master reads objects, and the
// line loses frames. Then the master does not know whether the slaves are the same, and brings them to PREOP again. A
// transfer in progress may fail. Transfers that begin meanwhile wait until their slave has passed INIT, and succeed.
// Ends with 0 when everything is as expected.
#include "compat/ecrt/bus.hpp"

#include <check.h>
#include <ecrt.h>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>

namespace {

constexpr unsigned kPauses = 12;
constexpr std::uint16_t kDrives = 3;

// The polling thread cannot poll while another thread uses the context.
class Pauses {
  public:
    explicit Pauses(margay::compat::ecrt::Bus& bus) : thread_([this, &bus] { pause(bus); }) {}
    ~Pauses() { thread_.join(); }
    Pauses(const Pauses&) = delete;
    Pauses& operator=(const Pauses&) = delete;
    [[nodiscard]] bool over() const { return over_; }

  private:
    void pause(margay::compat::ecrt::Bus& bus) {
        for (unsigned n = 0; n < kPauses; ++n) {
            std::this_thread::sleep_for(std::chrono::milliseconds(20 + 7 * n));
            bus.as_owner([] { std::this_thread::sleep_for(std::chrono::milliseconds(300)); });
        }
        over_ = true;
    }
    std::atomic<bool> over_{false};
    std::thread thread_;
};

bool upload(ec_master_t* master, std::uint16_t position) {
    std::array<std::uint8_t, 4> type{};
    std::size_t size = 0;
    std::uint32_t abort_code = 0;
    return ecrt_master_sdo_upload(master, position, 0x1000, 0, type.data(), type.size(), &size, &abort_code) == 0;
}

bool read(ec_sdo_request_t* object) {
    if (ecrt_sdo_request_read(object) != 0) return false;
    while (ecrt_sdo_request_state(object) == EC_REQUEST_BUSY) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return ecrt_sdo_request_state(object) == EC_REQUEST_SUCCESS;
}

struct Counts {
    unsigned good = 0;
    unsigned bad = 0;
    unsigned in_a_row = 0;  // current number of bad ones in succession
    unsigned most_in_a_row = 0;
    void add(bool result) {
        ++(result ? good : bad);
        in_a_row = result ? 0 : in_a_row + 1;
        most_in_a_row = std::max(most_in_a_row, in_a_row);
    }
};

int run(ec_master_t* master) {
    std::array<ec_sdo_request_t*, kDrives> objects{};
    for (std::uint16_t n = 0; n < kDrives; ++n) {
        ec_slave_config_t* const drive = ecrt_master_slave_config(master, 0, n, 0x00004D47, 0x5402);
        CHECK(drive != nullptr);
        objects[n] = ecrt_slave_config_create_sdo_request(drive, 0x1000, 0, 4);
        CHECK(objects[n] != nullptr);
    }
    Counts all;
    {
        const Pauses pauses(*master->bus);
        for (std::uint16_t n = 0; !pauses.over(); n = static_cast<std::uint16_t>((n + 1) % kDrives)) {
            all.add(upload(master, n));
            all.add(read(objects[n]));
        }
    }
    std::printf("%u good, %u bad, %u in a row\n", all.good, all.bad, all.most_in_a_row);
    CHECK(all.good > kPauses && all.bad <= kPauses);  // one transfer is in progress at each pause
    CHECK(all.most_in_a_row <= 2);
    return 0;
}

}  // namespace

int main() {
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(master != nullptr);
    const int result = run(master);
    ecrt_release_master(master);
    return result;
}
