// Each slave starts independently: a slave that answers no mail delays no other slave, and many domains start together.
// Virtual time counts the cycles. Arguments: segment, number of drives, number of domains, position of the mute drive
// or -1, the maximum number of cycles. Ends with 0 when everything is as expected.
#include "drives.hpp"
#include "virtual_time.hpp"

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace {

constexpr std::uint32_t kVelocity = 4000;  // the value that a drive gets is this plus its position

struct Program {
    std::size_t drives;
    std::size_t domain_count;
    std::size_t mute;  // `drives`: none
    ec_master_t* master = ecrt_request_master(0);
    std::vector<ec_domain_t*> domains{};
    std::vector<ec_slave_config_t*> configs{};
    std::vector<int> at{};
    std::int32_t value = 0;
    unsigned cycles = 0;

    ~Program() { ecrt_release_master(master); }

    int configure() {
        for (std::size_t n = 0; n < domain_count; ++n) domains.push_back(ecrt_master_create_domain(master));
        for (std::size_t n = 0; n < drives; ++n) {
            ec_domain_t* const domain = domains[n % domain_count];
            ec_slave_config_t* const config = configure_drive(master, static_cast<std::uint16_t>(n));
            configs.push_back(config);
            CHECK(config != nullptr && domain != nullptr);
            CHECK(ecrt_slave_config_sdo32(config, 0x6081, 0, kVelocity + static_cast<std::uint32_t>(n)) == 0);
            at.push_back(ecrt_slave_config_reg_pdo_entry(config, 0x607A, 0, domain, nullptr));
            CHECK(at.back() >= 0);
            CHECK(ecrt_slave_config_reg_pdo_entry(config, 0x6064, 0, domain, nullptr) >= 0);
        }
        return ecrt_master_activate(master);
    }

    void cycle() {
        ++cycles;
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        for (ec_domain_t* domain : domains) ecrt_domain_process(domain);
        ++value;
        for (std::size_t n = 0; n < drives; ++n)
            EC_WRITE_S32(ecrt_domain_data(domains[n % domain_count]) + at[n], value);
        for (ec_domain_t* domain : domains) ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }

    [[nodiscard]] bool is_operational(std::size_t n) const {
        ec_slave_config_state_t state;
        ecrt_slave_config_state(configs[n], &state);
        return state.operational != 0;
    }
    [[nodiscard]] bool all_others_are() const {
        for (std::size_t n = 0; n < drives; ++n)
            if (n != mute && !is_operational(n)) return false;
        return true;
    }
    [[nodiscard]] ec_domain_state_t state_of(std::size_t domain) const {
        ec_domain_state_t state;
        ecrt_domain_state(domains[domain], &state);
        return state;
    }
};

int run(Program& program, unsigned most) {
    CHECK(program.master != nullptr);
    go_to(*program.master, std::chrono::milliseconds(0));
    std::vector<ec_sdo_request_t*> shown;
    CHECK(program.configure() == 0);
    for (ec_slave_config_t* config : program.configs)
        shown.push_back(ecrt_slave_config_create_sdo_request(config, 0x6081, 0, 4));
    while (program.cycles < most && !program.all_others_are()) program.cycle();
    std::printf("%u cycles\n", program.cycles);
    CHECK(program.all_others_are());
    for (unsigned n = 0; n < 20; ++n) program.cycle();
    for (std::size_t n = 0; n < program.domain_count; ++n) {
        const bool has_mute = program.mute < program.drives && program.mute % program.domain_count == n;
        const bool alone = has_mute && program.drives <= program.domain_count;
        const ec_wc_state_t wanted = alone ? EC_WC_ZERO : has_mute ? EC_WC_INCOMPLETE : EC_WC_COMPLETE;
        CHECK(program.state_of(n).wc_state == wanted);
    }
    if (program.mute < program.drives) CHECK(!program.is_operational(program.mute));
    // The downloads were executed.
    for (std::size_t n = 0; n < program.drives; ++n) {
        if (n == program.mute) continue;
        ecrt_sdo_request_read(shown[n]);
        for (unsigned m = 0; m < 1000 && ecrt_sdo_request_state(shown[n]) == EC_REQUEST_BUSY; ++m) program.cycle();
        CHECK(ecrt_sdo_request_state(shown[n]) == EC_REQUEST_SUCCESS);
        CHECK(EC_READ_U32(ecrt_sdo_request_data(shown[n])) == kVelocity + n);
    }
    CHECK(program.all_others_are());
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 6) return 2;
    segment = argv[1];
    const auto number = [&](int n) { return static_cast<std::size_t>(std::strtol(argv[n], nullptr, 10)); };
    Program program{.drives = number(2), .domain_count = number(3), .mute = std::min(number(4), number(2))};
    return run(program, static_cast<unsigned>(number(5)));
}
