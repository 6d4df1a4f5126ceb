// A device gets another position because another device is connected before it. From then on the device gets no outputs
// of its old position. Virtual time shows each cycle. Ends with 0 when everything is as expected.
#include "virtual_time.hpp"

#include <margay/datagram.hpp>

#include <array>

namespace {

constexpr std::uint32_t kVendor = 0x00004D47;
constexpr std::uint32_t kDigOut8 = 0x2008;
constexpr std::uint16_t kAlias = 22;  // of the device that is connected from the beginning
constexpr unsigned kMost = 20000;     // cycles

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    std::array<ec_slave_config_t*, 2> configs{};
    std::array<int, 2> at{};
    ec_domain_state_t state{};
    std::uint8_t value = 0x80;  // of both outputs; changes with each cycle
    DatagramRequest look;       // at the outputs of the device
    std::array<std::byte, 1> outputs{};

    ~Program() {
        look.cancel();
        ecrt_release_master(master);
    }

    int configure() {
        std::array<ec_pdo_entry_info_t, 8> entries{};
        std::array<ec_pdo_info_t, 8> pdos{};
        for (unsigned n = 0; n < 8; ++n) {
            entries[n] = {static_cast<std::uint16_t>(0x7000 + 16 * n), 1, 1};
            pdos[n] = {static_cast<std::uint16_t>(0x1600 + n), 1, &entries[n]};
        }
        const std::array<ec_sync_info_t, 2> syncs{
            {{0, EC_DIR_OUTPUT, 8, pdos.data(), EC_WD_DEFAULT}, {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}}};
        for (unsigned n = 0; n < 2; ++n) {
            configs[n] = ecrt_master_slave_config(master, 0, static_cast<std::uint16_t>(2 + 2 * n), kVendor, kDigOut8);
            unsigned bit = 0;
            CHECK(ecrt_slave_config_pdos(configs[n], EC_END, syncs.data()) == 0);
            at[n] = ecrt_slave_config_reg_pdo_entry(configs[n], 0x7000, 1, domain, &bit);
            CHECK(at[n] >= 0);
        }
        return ecrt_master_activate(master);
    }

    void cycle() {
        osal->advance(std::chrono::milliseconds(1));
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_state(domain, &state);
        value = static_cast<std::uint8_t>(0x80U | (value + 1U));
        for (const int place : at) EC_WRITE_U8(ecrt_domain_data(domain) + place, value);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }

    [[nodiscard]] bool operational(unsigned n) const {
        ec_slave_config_state_t of_slave;
        ecrt_slave_config_state(configs[n], &of_slave);
        return of_slave.operational != 0;
    }

    [[nodiscard]] const Slave* device() const {
        for (const Slave& slave : master->bus->ctx->slaves())
            if (slave.alias == kAlias && slave.ring_position != 0) return &slave;
        return nullptr;
    }

    // The outputs of the device; -1: the device does not answer.
    int read_outputs() {
        look.command = DatagramCommand::fprd;
        look.adp = device() != nullptr ? device()->station_address.value : std::uint16_t{0};
        look.ado = 0x0F00;
        look.data = outputs;
        if (!submit(*master->bus->ctx, look)) return -1;
        for (unsigned n = 0; n < 5 && look.busy(); ++n) cycle();
        return look.state() == RequestState::success && look.wkc == 1 ? std::to_integer<int>(outputs[0]) : -1;
    }
};

int run() {
    Program program;
    CHECK(program.master != nullptr && program.domain != nullptr);
    go_to(*program.master, std::chrono::minutes(60) - std::chrono::seconds(3));
    CHECK(program.configure() == 0);
    for (unsigned n = 0; n < kMost && !program.operational(0); ++n) program.cycle();
    for (unsigned n = 0; n < 50; ++n) program.cycle();
    CHECK(program.operational(0) && program.device() != nullptr && program.device()->ring_position == 3);
    CHECK(program.state.working_counter == 1);
    // The device has one of the last values, so it gets the outputs of its configuration.
    const int before = program.read_outputs();
    CHECK(before >= 0x80 && ((program.value - before) & 0x7F) < 10);

    for (unsigned n = 0; n < kMost && program.device()->ring_position == 3; ++n) program.cycle();
    CHECK(program.device()->ring_position == 5);
    const std::uint8_t last = program.value;
    for (unsigned n = 0; n < 20; ++n) program.cycle();
    CHECK(program.state.wc_state == EC_WC_ZERO && program.state.working_counter == 0);
    const int after = program.read_outputs();
    CHECK(after >= 0 && (after == 0 || ((last - after) & 0x7F) < 5));
    // Cycles until the segment has started again.
    unsigned waited = 0;
    while (waited < kMost && !(program.operational(1) && program.state.wc_state == EC_WC_COMPLETE)) {
        program.cycle();
        ++waited;
    }
    std::printf("complete again after %u cycles\n", waited);
    CHECK(waited > 100 && waited < kMost && program.operational(0));
    for (unsigned n = 0; n < 50; ++n) program.cycle();
    CHECK(program.device() != nullptr && program.device()->number == 5);
    const int again = program.read_outputs();
    CHECK(again >= 0x80 && ((program.value - again) & 0x7F) < 10);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return 2;
    segment = argv[1];
    return run();
}
