// Threads register entries or read PDOs while another thread activates, and threads configure the same slaves. The
// master reads the PDOs of the slaves, which takes some time. Ends with 0 when everything is as expected.
#include <check.h>
#include <cycle.h>

#include <ecrt.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace {

constexpr unsigned kDrives = 6;
constexpr std::uint32_t kVendor = 0x00004D47;
constexpr std::uint32_t kDrive = 0x5402;
constexpr std::uint16_t kStatusword = 0x6041;
constexpr std::uint16_t kControlword = 0x6040;

using Results = std::array<int, kDrives>;

void wait_ms(unsigned ms) {
    for (unsigned n = 0; n < ms; ++n) next_cycle();
}

void exchange(ec_master_t* master, ec_domain_t* domain) {
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    next_cycle();
}

// An entry that is registered while another thread activates is in the domain at activation, or refused.
int register_at_activation(ec_master_t* master, unsigned delay_ms) {
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    std::array<ec_slave_config_t*, kDrives> configs{};
    for (std::uint16_t n = 0; n < kDrives; ++n) {
        configs[n] = ecrt_master_slave_config(master, 0, n, kVendor, kDrive);
        CHECK(configs[n] != nullptr);
    }
    Results offsets{};
    std::thread other([&] {
        for (unsigned n = 0; n < kDrives; ++n)
            offsets[n] = ecrt_slave_config_reg_pdo_entry(configs[n], kStatusword, 0, domain, nullptr);
    });
    wait_ms(delay_ms);
    const int activated = ecrt_master_activate(master);
    const std::size_t size = ecrt_domain_size(domain);
    other.join();
    CHECK(activated == 0 && ecrt_domain_size(domain) == size);
    for (const int offset : offsets)
        CHECK(offset == -EBUSY || (offset >= 0 && static_cast<std::size_t>(offset) + 2 <= size));
    for (unsigned n = 0; n < 100; ++n) exchange(master, domain);
    CHECK(ecrt_master_deactivate(master) == 0);
    return 0;
}

// PDOs are read while another thread activates.
int read_at_activation(ec_master_t* master, ec_master_t* reader, unsigned delay_ms) {
    constexpr std::uint8_t kOutputs = 2;
    static ec_pdo_entry_info_t entry = {kControlword, 0, 16};
    static ec_pdo_info_t pdo = {0x1600, 1, &entry};
    static const ec_sync_info_t syncs[] = {{kOutputs, EC_DIR_OUTPUT, 1, &pdo, EC_WD_ENABLE},
                                           {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}};
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    for (std::uint16_t n = 0; n < kDrives; ++n) {
        ec_slave_config_t* const config = ecrt_master_slave_config(master, 0, n, kVendor, kDrive);
        CHECK(config != nullptr && ecrt_slave_config_pdos(config, EC_END, syncs) == 0);
        CHECK(ecrt_slave_config_reg_pdo_entry(config, kControlword, 0, domain, nullptr) >= 0);
    }
    Results results{};
    std::atomic<bool> over{false};
    std::thread other([&] {
        for (std::uint16_t n = 0; n < kDrives; ++n) {
            ec_sync_info_t sync;
            results[n] = ecrt_master_get_sync_manager(reader, n, kOutputs, &sync);
        }
        over = true;
    });
    wait_ms(delay_ms);
    const int activated = ecrt_master_activate(master);
    while (!over) exchange(master, domain);
    other.join();
    CHECK(activated == 0 && results == Results{});
    CHECK(ecrt_master_deactivate(master) == 0);
    return 0;
}

// In operation, a slave has the PDOs that the program has set, also when other PDOs were read before.
int read_in_operation(ec_master_t* master, ec_master_t* reader) {
    constexpr std::uint8_t kInputs = 3;
    static ec_pdo_entry_info_t entries[] = {{0x6064, 0, 32}, {kStatusword, 0, 16}};
    static ec_pdo_info_t pdo = {0x1A00, 2, entries};
    static const ec_sync_info_t syncs[] = {{kInputs, EC_DIR_INPUT, 1, &pdo, EC_WD_DISABLE},
                                           {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}};
    ec_pdo_info_t known = {};
    CHECK(ecrt_master_get_pdo(reader, 0, kInputs, 0, &known) == 0);
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const config = ecrt_master_slave_config(master, 0, 0, kVendor, kDrive);
    CHECK(config != nullptr && ecrt_slave_config_pdos(config, EC_END, syncs) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(config, kStatusword, 0, domain, nullptr) == 4);
    CHECK(ecrt_master_activate(master) == 0);
    ec_slave_config_state_t state = {};
    for (unsigned n = 0; n < 5000 && !state.operational; ++n) {
        exchange(master, domain);
        ecrt_slave_config_state(config, &state);
    }
    std::atomic<bool> over{false};
    ec_pdo_entry_info_t first = {};
    std::thread other([&] {
        if (ecrt_master_get_pdo(reader, 0, kInputs, 0, &known) == 0)
            ecrt_master_get_pdo_entry(reader, 0, kInputs, 0, 0, &first);
        over = true;
    });
    while (!over) exchange(master, domain);
    other.join();
    CHECK(state.operational && known.n_entries == 2 && first.index == 0x6064);
    CHECK(ecrt_master_deactivate(master) == 0);
    return 0;
}

// The same for a PDO list that an object of the configuration writes.
int read_what_was_configured(ec_master_t* master, ec_master_t* reader) {
    ec_sync_info_t known = {};
    CHECK(ecrt_master_get_sync_manager(reader, 1, 2, &known) == 0 && known.n_pdos == 1);
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const config = ecrt_master_slave_config(master, 0, 1, kVendor, kDrive);
    CHECK(config != nullptr && ecrt_slave_config_sdo8(config, 0x1C12, 0, 0) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    std::atomic<bool> over{false};
    std::thread other([&] {
        if (ecrt_master_get_sync_manager(reader, 1, 2, &known) != 0) known.n_pdos = 9;
        over = true;
    });
    while (!over) exchange(master, domain);
    other.join();
    CHECK(known.n_pdos == 0);
    CHECK(ecrt_master_deactivate(master) == 0);
    return 0;
}

// The same for a PDO list that a request writes.
int read_what_was_written(ec_master_t* master, ec_master_t* reader) {
    ec_slave_config_t* const config = ecrt_master_slave_config(master, 0, 2, kVendor, kDrive);
    CHECK(config != nullptr);
    ec_sdo_request_t* const request = ecrt_slave_config_create_sdo_request(config, 0x1C12, 0, 1);
    CHECK(request != nullptr);
    ec_sync_info_t known = {};
    CHECK(ecrt_master_get_sync_manager(reader, 2, 2, &known) == 0 && known.n_pdos == 1);
    for (const std::uint8_t pdos : {std::uint8_t{0}, std::uint8_t{1}}) {
        EC_WRITE_U8(ecrt_sdo_request_data(request), pdos);
        CHECK(ecrt_sdo_request_write(request) == 0);
        for (unsigned n = 0; n < 5000 && ecrt_sdo_request_state(request) == EC_REQUEST_BUSY; ++n) next_cycle();
        CHECK(ecrt_sdo_request_state(request) == EC_REQUEST_SUCCESS);
        CHECK(ecrt_master_get_sync_manager(reader, 2, 2, &known) == 0 && known.n_pdos == pdos);
    }
    return 0;
}

// Two threads, each with a domain of its own, register entries of the same slaves.
int register_in_two_threads(ec_master_t* master) {
    struct Side {
        ec_domain_t* domain;
        std::uint16_t entry;
        int result;
    };
    std::array<Side, 2> sides{
        {{ecrt_master_create_domain(master), kControlword, 1}, {ecrt_master_create_domain(master), kStatusword, 1}}};
    std::array<std::thread, 2> threads;
    for (unsigned n = 0; n < threads.size(); ++n)
        threads[n] = std::thread([&sides, n] {
            Side& side = sides[n];
            ec_pdo_entry_reg_t list[kDrives + 1] = {};
            for (std::uint16_t position = 0; position < kDrives; ++position)
                list[position] = {0, position, kVendor, kDrive, side.entry, 0, nullptr, nullptr};
            side.result = ecrt_domain_reg_pdo_entry_list(side.domain, list);
        });
    for (auto& thread : threads) thread.join();
    for (const Side& side : sides) CHECK(side.result == 0 && ecrt_domain_size(side.domain) > 0);
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(ecrt_master_deactivate(master) == 0);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    const int scene = argc > 1 ? std::atoi(argv[1]) : 0;
    ec_master_t* const reader = ecrt_open_master(0);
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(reader != nullptr && master != nullptr);
    for (const unsigned delay_ms : {5U, 15U, 30U}) {
        wait_ms(200);
        if (scene == 0) CHECK(register_at_activation(master, delay_ms) == 0);
        if (scene == 1) CHECK(read_at_activation(master, reader, delay_ms) == 0);
        if (scene == 2) CHECK(register_in_two_threads(master) == 0);
    }
    if (scene == 3) CHECK(read_in_operation(master, reader) == 0);
    if (scene == 4) CHECK(read_what_was_configured(master, reader) == 0);
    if (scene == 5) CHECK(read_what_was_written(master, reader) == 0);
    ecrt_release_master(master);
    ecrt_release_master(reader);
    return 0;
}
