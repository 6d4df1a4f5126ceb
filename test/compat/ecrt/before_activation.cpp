// Calls of the program's thread while a thread of the facade polls. Ends with 0 when everything is as expected.
#include "compat/ecrt/bus.hpp"

#include <margay/request.hpp>

#include <check.h>
#include <ecrt.h>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

using namespace margay;

namespace {

// A second thread that is also accepted as the owner of the context would poll at the same time.
bool is_owner(const ec_master_t& master) { return allow_waiting(*master.bus->ctx, true).ok(); }

int read_type(ec_master_t* master) {
    std::array<std::uint8_t, 4> type{};
    std::size_t size = 0;
    std::uint32_t abort_code = 0;
    CHECK(ecrt_master_sdo_upload(master, 0, 0x1000, 0, type.data(), type.size(), &size, &abort_code) == 0);
    CHECK(size == 4 && EC_READ_U16(type.data()) == 402);
    return 0;
}

// The requested scan does not end a request that begins after it.
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

struct Answers {
    ec_sync_info_t sync{};
    ec_pdo_info_t pdo{};
    ec_pdo_entry_info_t entry{};
    std::array<int, 3> results{};

    Answers(ec_master_t* master, std::uint16_t position)
        : results{ecrt_master_get_sync_manager(master, position, 3, &sync),
                  ecrt_master_get_pdo(master, position, 3, 0, &pdo),
                  ecrt_master_get_pdo_entry(master, position, 3, 0, 1, &entry)} {}
    [[nodiscard]] bool all_are(int result) const { return results == std::array{result, result, result}; }
};

// The program writes other PDOs between two readings.
int read_pdos(ec_master_t* master, std::uint16_t position) {
    const Answers before(master, position);
    CHECK(before.all_are(0) && before.sync.n_pdos == 1 && before.pdo.n_entries == 8 && before.entry.index == 0x6064);
    const std::array<std::uint8_t, 1> none{};
    CHECK(ecrt_master_sdo_download(master, position, 0x1C13, 0, none.data(), 1, nullptr) == 0);
    const Answers after(master, position);
    CHECK(after.results[0] == 0 && after.sync.n_pdos == 0 && after.results[1] == -ENOENT);
    return 0;
}

// A slave that answers no mail is not reported as a slave without PDOs.
int read_mute(ec_master_t* master, std::uint16_t mute) {
    CHECK(Answers(master, mute).all_are(-EIO));
    CHECK(read_pdos(master, static_cast<std::uint16_t>(mute + 1)) == 0);
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
    CHECK(read_pdos(master, 1) == 0);
    // The request is in progress at the activation.
    ec_sdo_request_t* const object = ecrt_slave_config_create_sdo_request(drive, 0x1000, 0, 4);
    CHECK(ecrt_sdo_request_read(object) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(ecrt_sdo_request_state(object) == EC_REQUEST_SUCCESS);
    CHECK(ecrt_master_deactivate(master) == 0);
    CHECK(!is_owner(*master));
    return read_type(master);
}

}  // namespace

// Argument: the position of a drive that answers no mail.
int main(int argc, char** argv) {
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(master != nullptr);
    const int result = argc > 1 ? read_mute(master, static_cast<std::uint16_t>(std::atoi(argv[1]))) : run(master);
    ecrt_release_master(master);
    return result;
}
