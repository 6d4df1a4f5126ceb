// The first NIC is connected to the end of the ring, and the second NIC to its beginning. If a slave has a branch
// behind its port to the next slave, both copies of each frame reach slaves of the whole ring. Then only the ports of
// the slaves show which NIC is at the beginning.
#include "redundancy/ring_bus.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace margay {
namespace {

// A NIC whose cable can be moved to another slave.
class PluggedNic final : public Nic {
  public:
    explicit PluggedNic(Nic& nic) : at(&nic), own_(nic.source_mac()) {}
    Nic* at;

    SendStatus send(std::span<const std::byte> frame) noexcept override { return at->send(frame); }
    std::size_t receive(std::span<std::byte> into) noexcept override { return at->receive(into); }
    LinkState link_state() noexcept override { return at->link_state(); }
    MacAddress source_mac() const noexcept override { return own_; }
    Time next_arrival() const noexcept override { return at->next_arrival(); }

  private:
    MacAddress own_;
};

// A ring of four slaves. One slave has a branch of `deep` slaves at port 2, and its port 1 leads to the next slave.
struct SwappedRing : RingBus {
    std::vector<std::string> told;

    explicit SwappedRing(std::uint32_t parent, unsigned deep = 1) {
        for (unsigned n = 0; n < 4; ++n) (void)add_to_ring();
        close_ring();
        std::uint32_t above = add_behind(parent, 2);
        for (unsigned n = 1; n < deep; ++n) above = add_behind(above, 1);
        plug();
    }
    void swap() { std::swap(nics[0], nics[1]); }
    // The scan numbers the ring slaves from the beginning of the ring, then the branch, whatever NIC is there.
    void expect_order() {
        for (std::uint32_t n = 0; n < segment.size(); ++n) {
            EXPECT_EQ(segment.slave(n).station(), ctx->slave(n + 1U).station_address.value) << "device " << n + 1;
            EXPECT_EQ(ctx->slave(n + 1U).ring_position, n + 1U);
        }
    }
    bool was_told(const std::string& part) {
        for (auto& one : events()) told.push_back(one);
        return std::ranges::any_of(told, [&](const std::string& one) { return one.find(part) != std::string::npos; });
    }
    std::uint16_t number_of(std::uint32_t device) {
        for (const Slave& slave : ctx->slaves())
            if (slave.station_address.value == segment.slave(device).station()) return slave.number;
        return 0;
    }
    // The same device has the same number again.
    void lose_and_return(std::uint32_t device) {
        const std::uint16_t number = number_of(device);
        ASSERT_NE(number, 0U);
        segment.set_power(device, false, osal.now());
        (void)stale_cycles(300);
        EXPECT_EQ(ctx->slave(number).al.state, AlState::none);
        segment.set_power(device, true, osal.now());
        const bool all = until_all_in_op();
        ASSERT_TRUE(all && !was_told("unexpected")) << words(what_is_wrong(*ctx)) << "\n" << joined(told);
        EXPECT_EQ(number_of(device), number);
    }
};

constexpr const char* kSwapped = "the cables of the NICs are swapped";

TEST(SwappedCables, ABranchBehindTheWayOnHasItsNumberAndComesBack) {
    for (std::uint32_t parent = 0; parent < 4; ++parent) {
        for (const unsigned deep : {1U, 3U, 5U}) {
            SCOPED_TRACE("branch of " + std::to_string(deep) + " at slave " + std::to_string(parent + 1));
            SwappedRing bus(parent, deep);
            bus.swap();
            ASSERT_NO_FATAL_FAILURE(bus.start());
            EXPECT_FALSE(bus.ctx->errors().take()) << "of the topology";
            EXPECT_TRUE(bus.status().swapped);
            bus.expect_order();
            EXPECT_EQ(bus.ctx->slave(5).parent, parent + 1);
            EXPECT_EQ(bus.ctx->slave(5).parent_port, 2U);
            ASSERT_NO_FATAL_FAILURE(bus.run());
            EXPECT_EQ(bus.stale_cycles(20), 0U);
            for (std::uint32_t n = 0; n < bus.segment.size(); ++n) {
                SCOPED_TRACE("power of slave " + std::to_string(n + 1));
                ASSERT_NO_FATAL_FAILURE(bus.lose_and_return(n));
                bus.expect_order();
            }
            EXPECT_FALSE(bus.was_told("unexpected"));
        }
    }
}

TEST(SwappedCables, AreToldAtTheStart) {
    SwappedRing bus(1);
    bus.swap();
    ASSERT_NO_FATAL_FAILURE(bus.start());
    ASSERT_TRUE(config_map(*bus.ctx, bus.image).ok());
    ASSERT_TRUE(submit(*bus.ctx, bus.supervision).ok());
    ASSERT_TRUE(bus.until_all_in_op());
    EXPECT_TRUE(bus.was_told(kSwapped));
    SwappedRing right(1);
    ASSERT_NO_FATAL_FAILURE(right.start());
    EXPECT_FALSE(right.status().swapped);
    ASSERT_TRUE(config_map(*right.ctx, right.image).ok());
    ASSERT_TRUE(submit(*right.ctx, right.supervision).ok());
    ASSERT_TRUE(right.until_all_in_op());
    EXPECT_FALSE(right.was_told(kSwapped));
}

TEST(SwappedCables, EachCableOfARingWithABranchBreaksAndHeals) {
    for (std::uint32_t parent = 0; parent < 4; ++parent) {
        SwappedRing bus(parent);
        bus.swap();
        ASSERT_NO_FATAL_FAILURE(bus.start());
        ASSERT_NO_FATAL_FAILURE(bus.run());
        for (std::size_t n = 0; n < bus.ring_cables.size(); ++n) {
            SCOPED_TRACE("branch at slave " + std::to_string(parent + 1) + ", cable " + std::to_string(n));
            bus.cable(bus.ring_cables[n], false);
            EXPECT_EQ(bus.stale_cycles(50), 0U);
            EXPECT_TRUE(bus.status().swapped);
            bus.cable(bus.ring_cables[n], true);
            EXPECT_EQ(bus.stale_cycles(50), 0U);
            bus.expect_order();
        }
    }
}

// One cable is missing when the scan begins. One NIC reaches all slaves, from the beginning or from the end. From the
// end the frames pass the branches first, so the branches get the first numbers, swapped or not.
TEST(SwappedCables, AreFoundByOneNicAlone) {
    for (std::uint32_t parent = 0; parent < 4; ++parent) {
        for (const unsigned way : {0U, 1U, 2U, 3U}) {
            const bool at_end = way % 2 != 0;
            const bool swapped = way < 2;
            SCOPED_TRACE("branch at slave " + std::to_string(parent + 1) + ", way " + std::to_string(way));
            SwappedRing bus(parent, 2);
            if (swapped) bus.swap();
            bus.segment.set_master_cable(at_end ? 0 : 1, false);
            ASSERT_NO_FATAL_FAILURE(bus.start());
            EXPECT_FALSE(bus.ctx->errors().take()) << "of the topology";
            if (!at_end) bus.expect_order();
            ASSERT_TRUE(config_map(*bus.ctx, bus.image).ok());
            ASSERT_TRUE(submit(*bus.ctx, bus.supervision).ok());
            ASSERT_TRUE(bus.until_all_in_op());
            bus.segment.set_master_cable(at_end ? 0 : 1, true);
            (void)bus.stale_cycles(500);
            EXPECT_EQ(bus.status().swapped, swapped);
            EXPECT_EQ(bus.status().ring, RingState::whole);
            EXPECT_EQ(bus.was_told(kSwapped), swapped);
            for (std::uint32_t n = 0; n < bus.segment.size(); ++n) {
                SCOPED_TRACE("power of device " + std::to_string(n + 1));
                ASSERT_NO_FATAL_FAILURE(bus.lose_and_return(n));
            }
        }
    }
}

// The cables are exchanged while the machine is in OP.
TEST(SwappedCables, ExchangedInOperation) {
    for (std::uint32_t parent = 0; parent < 4; ++parent) {
        for (unsigned first = 0; first < 4; ++first) {
            SCOPED_TRACE("branch at slave " + std::to_string(parent + 1) + ", way " + std::to_string(first));
            SwappedRing bus(parent, 2);
            PluggedNic one(*bus.nics[0]);
            PluggedNic two(*bus.nics[1]);
            bus.ctx = std::make_unique<HostContext>(RingBus::limits());
            ASSERT_TRUE(init_redundant(*bus.ctx, one, two, bus.osal).ok());
            ASSERT_TRUE(config_init(*bus.ctx).ok());
            ASSERT_NO_FATAL_FAILURE(bus.run());
            const unsigned wait = first < 2 ? 200 : 0;  // or at once, between two cycles
            bus.segment.set_master_cable(first % 2, false);
            (void)bus.stale_cycles(wait);
            bus.segment.set_master_cable(1 - first % 2, false);
            (void)bus.stale_cycles(wait);
            std::swap(one.at, two.at);
            bus.segment.set_master_cable(first % 2, true);
            (void)bus.stale_cycles(wait);
            bus.segment.set_master_cable(1 - first % 2, true);
            ASSERT_TRUE(bus.until_all_in_op());
            EXPECT_EQ(bus.stale_cycles(20), 0U);
            for (std::uint32_t n = 0; n < bus.segment.size(); ++n) {
                SCOPED_TRACE("power of slave " + std::to_string(n + 1));
                ASSERT_NO_FATAL_FAILURE(bus.lose_and_return(n));
            }
            EXPECT_TRUE(bus.status().swapped);
            EXPECT_TRUE(bus.was_told(kSwapped));
        }
    }
}

}  // namespace
}  // namespace margay
