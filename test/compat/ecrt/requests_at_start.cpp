// Requests that begin in any cycle of the start-up succeed. The passage of their slave through INIT ends none of them.
// Virtual time, cycles of several lengths. Ends with 0 when everything is as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

#include <array>

namespace {

constexpr std::uint16_t kDrives = 3;

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    std::array<ec_slave_config_t*, kDrives> configs{};
    std::array<ec_sdo_request_t*, kDrives> objects{};
    std::array<ec_reg_request_t*, kDrives> registers{};
    ~Program() { ecrt_release_master(master); }

    int configure() {
        for (std::uint16_t n = 0; n < kDrives; ++n) {
            configs[n] = configure_drive(master, n);
            CHECK(configs[n] != nullptr);
            CHECK(ecrt_slave_config_sdo32(configs[n], 0x6081, 0, 4000) == 0);
            CHECK(ecrt_slave_config_reg_pdo_entry(configs[n], 0x607A, 0, domain, nullptr) >= 0);
            objects[n] = ecrt_slave_config_create_sdo_request(configs[n], 0x1000, 0, 4);
            registers[n] = ecrt_slave_config_create_reg_request(configs[n], 2);
        }
        return ecrt_master_activate(master);
    }

    void cycle(Duration length) {
        osal->advance(length);
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    [[nodiscard]] unsigned count(ec_request_state_t state) const {
        unsigned sum = 0;
        for (ec_sdo_request_t* one : objects) sum += ecrt_sdo_request_state(one) == state ? 1U : 0U;
        for (ec_reg_request_t* one : registers) sum += ecrt_reg_request_state(one) == state ? 1U : 0U;
        return sum;
    }
};

// The requests begin in this cycle. They proceed also when the program does not ask for their states.
int run(unsigned begin, Duration length, bool asks) {
    Program program;
    go_to(*program.master, Duration{0});
    CHECK(program.configure() == 0);
    for (unsigned n = 0; n < begin; ++n) program.cycle(length);
    for (ec_sdo_request_t* one : program.objects) CHECK(ecrt_sdo_request_read(one) == 0);
    for (ec_reg_request_t* one : program.registers) CHECK(ecrt_reg_request_read(one, 0x0130, 2) == 0);
    for (unsigned n = 0; n < 600 && !asks; ++n) program.cycle(length);
    for (unsigned n = 0; n < 2000 && asks && program.count(EC_REQUEST_BUSY) != 0; ++n) program.cycle(length);
    CHECK(program.count(EC_REQUEST_SUCCESS) == 2 * kDrives);
    for (ec_sdo_request_t* one : program.objects) CHECK(EC_READ_U16(ecrt_sdo_request_data(one)) == 402);
    return 0;
}

}  // namespace

int main() {
    segment = "sim:drive,drive,drive";
    for (const int length_us : {250, 1000, 10000})
        for (unsigned begin = 0; begin < 240; ++begin)
            if (run(begin, std::chrono::microseconds(length_us), length_us != 1000 || begin % 4 != 0) != 0) {
                std::printf("requests of cycle %u, cycles of %d us\n", begin, length_us);
                return 1;
            }
    return 0;
}
