// Calls of the program's thread while a thread of the facade polls. Ends with 0 when everything is as expected.
#include "compat/ecrt/bus.hpp"

#include <margay/request.hpp>

#include <check.h>
#include <ecrt.h>
#include <array>
#include <chrono>
#include <cstdio>
#include <thread>

using namespace margay;

namespace {

// Two threads that believe to own the context would poll at the same time.
bool is_owner(const ec_master_t& master) { return allow_waiting(*master.bus->ctx, true).ok(); }

int read_type(ec_master_t* master) {
    std::array<std::uint8_t, 4> type{};
    std::size_t size = 0;
    std::uint32_t abort_code = 0;
    CHECK(ecrt_master_sdo_upload(master, 0, 0x1000, 0, type.data(), type.size(), &size, &abort_code) == 0);
    CHECK(size == 4 && EC_READ_U16(type.data()) == 402);
    return 0;
}

// The scan that is asked for does not end what begins after it.
int read_after_reset(ec_master_t* master, ec_slave_config_t* drive) {
    ec_sdo_request_t* const object = ecrt_slave_config_create_sdo_request(drive, 0x1000, 0, 4);
    ec_reg_request_t* const registers = ecrt_slave_config_create_reg_request(drive, 2);
    for (int n = 0; n < 40; ++n) {
        CHECK(ecrt_master_reset(master) == 0);
        if (n % 2 == 0) {
            CHECK(read_type(master) == 0);
            continue;
        }
        CHECK(ecrt_sdo_request_read(object) == 0 && ecrt_reg_request_read(registers, 0x0130, 2) == 0);
        for (int ms = 0; ms < 5000; ++ms) {
            if (ecrt_sdo_request_state(object) != EC_REQUEST_BUSY &&
                ecrt_reg_request_state(registers) != EC_REQUEST_BUSY)
                break;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        CHECK(ecrt_sdo_request_state(object) == EC_REQUEST_SUCCESS);
        CHECK(ecrt_reg_request_state(registers) == EC_REQUEST_SUCCESS);
    }
    return 0;
}

int run(ec_master_t* master) {
    ec_slave_config_t* const drive = ecrt_master_slave_config(master, 0, 0, 0x00004D47, 0x5402);
    CHECK(drive != nullptr && !is_owner(*master));
    for (int n = 0; n < 50; ++n) {
        CHECK(ecrt_slave_config_create_voe_handler(drive, 16) != nullptr);
        CHECK(!is_owner(*master));
        CHECK(read_type(master) == 0);
    }
    CHECK(read_after_reset(master, drive) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(ecrt_master_deactivate(master) == 0);
    CHECK(!is_owner(*master));
    return read_type(master);
}

}  // namespace

int main() {
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(master != nullptr);
    const int result = run(master);
    ecrt_release_master(master);
    return result;
}
