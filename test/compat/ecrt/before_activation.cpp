// Calls of the program's thread while a thread of the facade polls. Ends with 0 when everything is as expected.
#include "check.h"
#include "compat/ecrt/bus.hpp"

#include <margay/request.hpp>

#include <ecrt.h>
#include <array>
#include <cstdio>

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

int run(ec_master_t* master) {
    ec_slave_config_t* const drive = ecrt_master_slave_config(master, 0, 0, 0x00004D47, 0x5402);
    CHECK(drive != nullptr && !is_owner(*master));
    for (int n = 0; n < 50; ++n) {
        CHECK(ecrt_slave_config_create_voe_handler(drive, 16) != nullptr);
        CHECK(!is_owner(*master));
        CHECK(read_type(master) == 0);
    }
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
