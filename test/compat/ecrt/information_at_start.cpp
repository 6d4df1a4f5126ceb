// The program requests the data of a slave for the first time in some cycle of the start-up. The answer is right or an
// error, and an error is not kept. Ends with 0 when everything is as expected.
#include "drives.hpp"

#include <check.h>
#include <cycle.h>
#include <ecrt.h>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <thread>

namespace {

constexpr std::uint16_t kPosition = 1;

struct Program {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain = nullptr;
    Program() = default;
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;
    ~Program() { ecrt_release_master(master); }

    int start() {
        domain = ecrt_master_create_domain(master);
        for (std::uint16_t n = 0; n < 3; ++n) {
            ec_slave_config_t* const drive = configure_drive(master, n);
            CHECK(drive != nullptr && ecrt_slave_config_reg_pdo_entry(drive, 0x607A, 0, domain, nullptr) >= 0);
        }
        return ecrt_master_activate(master);
    }
    void cycle() const {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
};

struct Answers {
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    ec_pdo_info_t pdo;
    ec_pdo_entry_info_t entry;
    std::array<int, 4> results;

    explicit Answers(ec_master_t* master)
        : results{{ecrt_master_get_slave(master, kPosition, &slave),
                   ecrt_master_get_sync_manager(master, kPosition, 3, &sync),
                   ecrt_master_get_pdo(master, kPosition, 3, 0, &pdo),
                   ecrt_master_get_pdo_entry(master, kPosition, 3, 0, 1, &entry)}} {}
    // The results are right: the PDO list is the list of the program.
    int are_right() const {
        for (const int result : results) CHECK(result == 0);
        CHECK(slave.vendor_id == kVendor && slave.product_code == kDrive);
        CHECK(sync.dir == EC_DIR_INPUT && sync.n_pdos == 1 && pdo.index == 0x1A00 && pdo.n_entries == 3);
        CHECK(entry.index == 0x6061 && entry.bit_length == 8);
        return 0;
    }
};

int ask_beside_the_cycle(unsigned begin, bool also_before) {
    Program program;
    CHECK(program.start() == 0);
    ec_sync_info_t sync;
    if (also_before) CHECK(ecrt_master_get_sync_manager(program.master, kPosition, 3, &sync) == -EIO);
    std::atomic<unsigned> cycles{0};
    std::atomic<bool> stop{false};
    std::thread cyclic([&] {
        while (!stop) {
            program.cycle();
            ++cycles;
        }
    });
    while (cycles < begin) next_cycle();
    const Answers answers(program.master);
    stop = true;
    cyclic.join();
    return answers.are_right();
}

// This thread cannot wait for the start-up: the first answers are errors, the later ones are right.
int ask_in_the_cycle() {
    Program program;
    CHECK(program.start() == 0);
    unsigned errors = 0;
    unsigned right = 0;
    for (unsigned n = 0; n < 5000 && right < 200; ++n) {
        program.cycle();
        const Answers answers(program.master);
        if (answers.results[1] != 0)
            ++errors;
        else if (answers.sync.n_pdos == 1 && answers.results[2] == 0 && answers.pdo.n_entries == 3)
            ++right;
    }
    std::printf("in the cycle: %u errors, %u right answers\n", errors, right);
    CHECK(errors > 0 && right == 200);
    return 0;
}

}  // namespace

int main() {
    if (ask_in_the_cycle() != 0) return 1;
    for (unsigned begin = 0; begin < 300; begin += 1 + begin / 4)
        if (ask_beside_the_cycle(begin, begin == 0) != 0) {
            std::printf("asked in cycle %u\n", begin);
            return 1;
        }
    return 0;
}
