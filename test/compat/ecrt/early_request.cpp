// A request for a slave that has just appeared and is still in INIT: the request waits for PREOP, at most for its
// timeout, which begins when the request starts. Ends with 0 when everything is as expected.
#include "virtual_time.hpp"

namespace {

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    ec_slave_config_t* drive = ecrt_master_slave_config(master, 0, 1, 0x00004D47, 0x5402);
    ec_slave_config_state_t state{};
    ~Program() { ecrt_release_master(master); }

    void cycle() {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_slave_config_state(drive, &state);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    ec_sdo_request_t* request(std::uint32_t timeout_ms) const {
        ec_sdo_request_t* const made = ecrt_slave_config_create_sdo_request(drive, 0x1000, 0, 4);
        ecrt_sdo_request_timeout(made, timeout_ms);
        return made;
    }
};

int run() {
    Program program;
    go_to(*program.master, std::chrono::minutes(60) - std::chrono::seconds(3));
    ec_sdo_request_t* const patient = program.request(0);
    ec_sdo_request_t* const second = program.request(1000);
    ec_sdo_request_t* const hasty = program.request(20);
    CHECK(ecrt_master_activate(program.master) == 0);
    for (int n = 0; n < 1000; ++n) program.cycle();
    // The slave is absent.
    ecrt_sdo_request_read(patient);
    CHECK(!program.state.online && ecrt_sdo_request_state(patient) == EC_REQUEST_ERROR);
    for (int n = 0; n < 20000 && !program.state.online; ++n) program.cycle();
    CHECK(program.state.online && program.state.al_state == EC_AL_STATE_INIT);
    for (ec_sdo_request_t* const one : {patient, second, hasty}) ecrt_sdo_request_read(one);
    int hasty_for = 0;
    int unread = 0;
    while (program.state.al_state == EC_AL_STATE_INIT) {
        // The library still reads the SII of the slave, and does not report a slave without SyncManagers.
        ec_slave_info_t info;
        const int known = ecrt_master_get_slave(program.master, 1, &info);
        CHECK(known == -EAGAIN || (known == 0 && info.sync_count == 4 && info.name[0] != '\0'));
        if (known != 0) ++unread;
        for (ec_sdo_request_t* const one : {patient, second}) CHECK(ecrt_sdo_request_state(one) == EC_REQUEST_BUSY);
        if (ecrt_sdo_request_state(hasty) == EC_REQUEST_BUSY) ++hasty_for;
        program.cycle();
    }
    CHECK(unread > 0);
    CHECK(hasty_for >= 18 && hasty_for <= 22 && ecrt_sdo_request_state(hasty) == EC_REQUEST_ERROR);
    const auto any_busy = [&] {
        return ecrt_sdo_request_state(patient) == EC_REQUEST_BUSY || ecrt_sdo_request_state(second) == EC_REQUEST_BUSY;
    };
    for (int n = 0; n < 500 && any_busy(); ++n) program.cycle();
    for (ec_sdo_request_t* const one : {patient, second}) {
        CHECK(ecrt_sdo_request_state(one) == EC_REQUEST_SUCCESS);
        CHECK(EC_READ_U16(ecrt_sdo_request_data(one)) == 402);
    }
    return 0;
}

}  // namespace

int main() {
    segment = "sim:digital_in_8,drive@3600s";
    return run();
}
