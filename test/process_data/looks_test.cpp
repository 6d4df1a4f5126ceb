// The share of the acyclic traffic that the supervision needs while a slave is lost.
#include "process_data/plant.hpp"

#include <margay/registers.hpp>

#include <array>
#include <cstdint>
#include <initializer_list>

namespace margay {
namespace {

struct Busy : Plant {
    explicit Busy(std::uint16_t acyclic_bytes) {
        constexpr std::uint32_t kSlaves = 30;
        for (std::uint32_t n = 0; n < kSlaves; ++n) {
            const std::uint32_t made = make({});
            EXPECT_TRUE(n == 0 ? segment.connect_master({made, 0}) : segment.connect({made - 1, 1}, {made, 0}));
        }
        limits.slaves = kSlaves + 2;
        EXPECT_TRUE(bring_up({}).empty());
        ctx->group(0).config.acyclic_bytes = acyclic_bytes;
        run();
    }
    // Executes one register access after the other for a second with cycles of 1 ms. Returns the number of successful
    // accesses.
    int reads_in_a_second() {
        int done = 0;
        RegisterReadRequest read;
        std::array<std::byte, 2> type{};
        read.slave = 1;
        read.data = type;
        for (int n = 0; n < 1000; ++n) {
            const bool submitted = read.busy() || submit(*ctx, read).ok();
            EXPECT_TRUE(submitted);
            (void)cycle();
            done += read.state() == RequestState::success ? 1 : 0;
        }
        read.cancel();
        return done;
    }
};

TEST(Looks, LeaveMostOfTheAcyclicTrafficToOthersWhileASlaveIsLost) {
    for (const std::uint16_t acyclic_bytes : std::initializer_list<std::uint16_t>{60, 100, 1498}) {
        Busy plant(acyclic_bytes);
        const int before = plant.reads_in_a_second();
        plant.power(29, false);
        plant.cycles(20);
        EXPECT_EQ(plant.ctx->slave(30).al.state, AlState::none);
        const int after = plant.reads_in_a_second();
        EXPECT_GT(before, 100) << acyclic_bytes;
        EXPECT_GT(4 * after, 3 * before) << acyclic_bytes << " octets: " << after << " of " << before;
    }
}

}  // namespace
}  // namespace margay
