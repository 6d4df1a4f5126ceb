// The arena memory of the protocol sequences. A larger coroutine frame costs every user memory for every slave.
// Therefore this test fixes the sizes, and a change of a size must be deliberate. Sizes are the sizes of the arena's
// blocks (64 octets and doublings).
#include "engine/scripted_nic.hpp"
#include "network/configure.hpp"
#include "network/groups.hpp"
#include "network/network.hpp"
#include "network/pdo_sii.hpp"
#include "network/pdos.hpp"
#include "network/preop.hpp"
#include "network/scan.hpp"
#include "network/startup.hpp"
#include "network/states.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"
#include "station/sii_contents.hpp"

#include <gtest/gtest.h>

namespace margay {
namespace {

class FrameSizes : public testing::Test {
  protected:
    ScriptedNic nic;
    std::vector<Slave> slaves = std::vector<Slave>(1);
    std::vector<SlaveMarks> marks = std::vector<SlaveMarks>(1);
    std::vector<FrameSlot> slots = std::vector<FrameSlot>(4);
    std::vector<std::byte> memory = std::vector<std::byte>(Arena::memory_for(32 * 1024));
    Network network{nic, {slaves, marks}, slots, memory, 1};

    // The arena memory that a new task occupies.
    template <class T>
    void expect(const char* name, std::size_t bytes, Task<T> task) {
        EXPECT_TRUE(static_cast<bool>(task));
        EXPECT_EQ(network.arena().used_bytes(), bytes) << name;
        TaskAccess::end(task);
        EXPECT_EQ(network.arena().used_bytes(), 0U) << name;
    }
};

TEST_F(FrameSizes, OfEachSequence) {
#if defined(__SANITIZE_ADDRESS__) || !defined(__OPTIMIZE__)
    GTEST_SKIP() << "sizes are those of an optimized build";
#endif
    network.count = 1;
    Slave& slave = slaves[0];
    const Station station = network.station(slave);
    std::byte word[2]{};

    expect("change_al_state", 512, change_al_state(station, AlState::preop, false, std::chrono::seconds(1)));
    expect("sii_write", 512, sii_write(station, 4, word));
    expect("sii_assign", 512, sii_assign(station, false));
    expect("read_sii_contents", 512, read_sii_contents(station, slave));
    expect("scan", 512, scan(network));
    expect("count_slaves", 512, count_slaves(network));
    expect("reset_slaves", 512, reset_slaves(network));
    expect("bring_to_preop", 1024, bring_to_preop(network, slave));
    expect("read_states", 256, read_states(network));
    expect("write_states", 512, write_states(network, 0, AlState::safeop));
    expect("wait_for_state", 512, wait_for_state(network, 0, AlState::safeop, kNever));
    FoundSms found{};
    expect("find_sms_by_sii", 512, find_sms_by_sii(station, slave, found));
    expect("discover_pdos", 512, discover_pdos(network, slave));
    expect("change_state", 256, change_state(network, slave, AlState::preop, kNever));
    expect("run_commands", 256, run_commands(network, slave, Transition::init_to_preop, Moment::before));
    expect("map_group", 256, map_group(network, 0, {}));
}

}  // namespace
}  // namespace margay
