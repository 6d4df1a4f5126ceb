// Equal slaves in a ring with two NICs that boot at different times. No slave is driven as another slave.
#include "redundancy/ring_bus.hpp"

#include <bit>

namespace margay {
namespace {

// A ring of equal slaves. `off` and `late` are sets of slaves: bit 0 is slave 1.
struct EqualRing : testing::Test {
    enum class Serials { none, own, equal };

    std::unique_ptr<RingBus> bus;
    unsigned wrong = 0;  // cycles in which a device had the outputs of another slave

    void build(unsigned slaves, bool serials) {
        bus = std::make_unique<RingBus>();
        for (unsigned n = 0; n < slaves; ++n) {
            auto device = RingBus::io_device();
            if (serials) device.sii[0x1C] = static_cast<std::byte>(100 + n);
            (void)bus->add_to_ring(std::move(device));
        }
        bus->close_ring();
        bus->start();
        bus->run();
        wrong = 0;
    }
    // A ring of three slaves, and a fourth slave behind port 3 or 2 of one of them. Frames of the whole ring pass the
    // fourth slave directly behind that slave, or as the last slave.
    void build_with_branch(unsigned parent, std::uint8_t port, Serials serials) {
        bus = std::make_unique<RingBus>();
        const auto device = [&] {
            auto one = RingBus::io_device();
            if (serials == Serials::own) one.sii[0x1C] = static_cast<std::byte>(100 + bus->segment.size());
            if (serials == Serials::equal) one.sii[0x1C] = std::byte{1};
            return one;
        };
        std::uint32_t above = 0;
        for (unsigned n = 0; n < 3; ++n) {
            const std::uint32_t at = bus->add_to_ring(device());
            if (n != parent) continue;
            above = at;
            if (port == 3) (void)bus->add_behind(above, port, device());
        }
        if (port == 2) (void)bus->add_behind(above, port, device());
        bus->close_ring();
        bus->start();
        bus->run();
        wrong = 0;
    }
    void power(unsigned which, bool on) {
        for (std::uint32_t n = 0; n < bus->segment.size(); ++n)
            if ((which >> n & 1U) != 0) bus->segment.set_power(n, on, bus->osal.now());
    }
    void drive(unsigned cycles) {
        while (cycles-- > 0) {
            (void)bus->cycle();
            for (std::size_t n = 1; n <= bus->segment.size(); ++n) {
                const auto outputs = bus->io(n)->outputs();
                if (outputs.size() < 2 || outputs[1] == std::byte{0}) continue;
                wrong += outputs[1] != static_cast<std::byte>(0x80 + n) ? 1U : 0U;
            }
        }
    }
    void lose_and_return(unsigned off, unsigned late) {
        power(off, false);
        drive(100);
        power(off & ~late, true);
        drive(1200);
        EXPECT_EQ(wrong, 0U);
        power(late, true);
        for (unsigned n = 0; n < 40 && !bus->all_in_op(); ++n) drive(100);
        drive(10);
        EXPECT_TRUE(bus->all_in_op()) << bus->joined(bus->events());
        EXPECT_EQ(wrong, 0U);
        EXPECT_EQ(bus->stale_cycles(5), 0U);
    }
};

// Every set of slaves loses its power, and every subset of it boots later than the rest.
TEST_F(EqualRing, WhoeverBootsLaterEverybodyIsItself) {
    constexpr unsigned kInRing = 3;
    for (unsigned off = 1; off < 1U << kInRing; ++off)
        for (unsigned late = (off - 1) & off; late != 0; late = (late - 1) & off) {
            SCOPED_TRACE("off " + std::to_string(off) + ", late " + std::to_string(late));
            build(kInRing, false);
            lose_and_return(off, late);
            if (HasFailure()) return;
        }
}

// Frames pass a branch behind port 2 after the rest of a whole ring, and before the break of a broken ring. The order
// of the slaves does not identify the slave, but its place does.
TEST_F(EqualRing, ASlaveOfABranchIsItselfInABrokenRingToo) {
    for (const Serials serials : {Serials::none, Serials::own, Serials::equal})
        for (const auto& [parent, port] : {std::pair{0U, 2}, {1U, 2}, {0U, 3}}) {
            const unsigned branch = 1U << (port == 2 ? 3 : parent + 1);
            for (unsigned off = 1; off < 15; ++off)
                for (unsigned late = (off - 1) & off; late != 0; late = (late - 1) & off) {
                    if ((off & branch) == 0 || (serials != Serials::none && std::popcount(off) > 2)) continue;
                    SCOPED_TRACE("serials " + std::to_string(static_cast<int>(serials)) + ", port " +
                                 std::to_string(port) + " of slave " + std::to_string(parent + 1) + ", off " +
                                 std::to_string(off) + ", late " + std::to_string(late));
                    build_with_branch(parent, static_cast<std::uint8_t>(port), serials);
                    lose_and_return(off, late);
                    if (HasFailure()) return;
                }
        }
}

TEST_F(EqualRing, InALongerRingAndWithSerialNumbersToo) {
    for (const bool serials : {false, true})
        for (const auto& [off, late] :
             {std::pair{31U, 4U}, {31U, 1U}, {31U, 14U}, {6U, 2U}, {14U, 4U}, {24U, 8U}, {31U, 5U}}) {
            SCOPED_TRACE("off " + std::to_string(off) + ", late " + std::to_string(late));
            build(5, serials);
            lose_and_return(off, late);
        }
}

// The slaves lose their power one after the other and come back, then two slaves at a time. The information about a
// broken ring stays right.
TEST_F(EqualRing, ManyTimesInOneRing) {
    build(6, false);
    for (const auto& [off, late] : {std::pair{63U, 4U}, {6U, 2U}, {48U, 16U}, {63U, 30U}, {12U, 4U}, {63U, 1U}}) {
        SCOPED_TRACE("off " + std::to_string(off) + ", late " + std::to_string(late));
        lose_and_return(off, late);
    }
}

// The last slave is removed for a repair and bridged. When all slaves have lost their power, the slave at the second
// NIC may be this slave.
TEST_F(EqualRing, ABridgedLastSlaveIsNotGuessed) {
    build(5, false);
    bus->segment.disconnect({4, 0});
    bus->segment.disconnect({4, 1});
    drive(300);
    ASSERT_TRUE(bus->segment.connect_master({3, 1}, 1));
    bus->segment.reconsider();
    drive(1500);
    EXPECT_EQ(bus->status().ring, RingState::whole);
    power(15, false);
    drive(100);
    power(11, true);  // slave 3 is late
    drive(2000);
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(bus->ctx->slave(1).al.state, AlState::op);
    EXPECT_EQ(bus->ctx->slave(2).al.state, AlState::op);
    EXPECT_EQ(bus->ctx->slave(4).al.state, AlState::none);
    EXPECT_NE(bus->joined(bus->events()).find("may be slave 4 or slave 5"), std::string::npos);
    power(4, true);
    drive(3000);
    EXPECT_EQ(wrong, 0U);
    for (const std::size_t n : {1U, 2U, 3U, 4U}) EXPECT_EQ(bus->ctx->slave(n).al.state, AlState::op) << n;
}

// Slave 1 is back and closes the ring while a search reads the identity of the slave at the branch. The places of the
// search stay the places of the broken ring.
TEST_F(EqualRing, TheRingIsClosedDuringASearch) {
    for (unsigned apart = 0; apart <= 24; ++apart) {
        SCOPED_TRACE(std::to_string(apart) + " cycles apart");
        build_with_branch(1, 2, Serials::none);
        power(1, false);
        drive(300);
        power(8, false);
        drive(300);
        power(8, true);
        drive(apart);
        power(1, true);
        for (unsigned n = 0; n < 10 && !bus->all_in_op(); ++n) drive(100);
        EXPECT_TRUE(bus->all_in_op()) << bus->joined(bus->events());
        EXPECT_EQ(wrong, 0U);
    }
}

// Within a millisecond one slave comes and another slave leaves, so the number of answering slaves does not change.
TEST_F(EqualRing, ABreakThatMovesIsNoticed) {
    build(6, false);
    power(4, false);
    drive(500);
    ASSERT_EQ(bus->ctx->slave(3).al.state, AlState::none);
    power(4, true);
    power(16, false);
    drive(20);
    EXPECT_EQ(bus->ctx->slave(5).al.state, AlState::none);
    drive(1000);
    EXPECT_EQ(bus->ctx->slave(3).al.state, AlState::op);
    EXPECT_EQ(wrong, 0U);
}

}  // namespace
}  // namespace margay
