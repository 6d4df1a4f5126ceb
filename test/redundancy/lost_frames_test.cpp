// Frames get lost in a broken ring. Each lost copy may cost the slaves of its part the outputs of one cycle. But no
// slave that is sound leaves OP, is regarded as lost, or misses the outputs of many cycles. A NIC whose copies never
// come back is found as fast as without lost frames.
#include "redundancy/ring_bus.hpp"

#include <algorithm>
#include <set>

namespace margay {
namespace {

constexpr std::uint16_t kAlStatus = 0x0130;

// What the devices of the simulated segment have seen, whatever the master believes.
struct Sound {
    explicit Sound(RingBus& b) : bus(b), missed(b.segment.size()), longest(b.segment.size()) {}

    RingBus& bus;
    std::vector<unsigned> missed;   // cycles without new outputs, up to now
    std::vector<unsigned> longest;  // the longest row of such cycles
    unsigned out_of_op = 0;         // cycles and slaves
    std::string told;               // events, without those of the ring itself

    void cycles(unsigned count) {
        for (unsigned n = 0; n < count; ++n) {
            (void)bus.cycle();
            for (std::uint32_t at = 0; at < missed.size(); ++at) look_at(at);
            for (const auto& text : bus.events())
                if (text.find("redundancy") == std::string::npos) told += text + "\n";
        }
    }
    void look_at(std::uint32_t at) {
        const auto outputs = bus.io(at + 1)->outputs();
        const bool fresh = outputs.size() >= 2 && outputs[0] == static_cast<std::byte>(bus.counter);
        missed[at] = fresh ? 0 : missed[at] + 1;
        longest[at] = std::max(longest[at], missed[at]);
        out_of_op += bus.segment.slave(at).registers().get<std::uint16_t>(kAlStatus) != 8 ? 1 : 0;
    }
    void expect_no_harm() const {
        EXPECT_LE(*std::ranges::max_element(longest), 5U);
        EXPECT_EQ(out_of_op, 0U);
        EXPECT_EQ(told, "");
    }
};

// Does not accept some of its frames.
struct BusyNic final : ForwardingNic {
    unsigned each = 0;  // of so many frames, the first `row`; 0: none
    unsigned row = 1;
    unsigned count = 0;

    using ForwardingNic::ForwardingNic;
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        return each != 0 && ++count % each < row ? SendStatus::busy : nic_.send(frame);
    }
};

TEST(RingLostFrames, ACopyThatIsNotAcceptedForOnceLosesNoSlave) {
    for (const unsigned which : {0U, 1U})
        for (const unsigned each : {23U, 97U}) {
            SCOPED_TRACE("NIC " + std::to_string(which) + ", one frame of " + std::to_string(each));
            RingBus bus;
            bus.build_line(8);
            bus.plug();
            BusyNic busy(*bus.nics[which]);
            bus.ctx = std::make_unique<HostContext>(RingBus::limits());
            Nic& first = which == 0 ? static_cast<Nic&>(busy) : *bus.nics[0];
            Nic& second = which == 1 ? static_cast<Nic&>(busy) : *bus.nics[1];
            ASSERT_TRUE(init_redundant(*bus.ctx, first, second, bus.osal).ok());
            ASSERT_TRUE(config_init(*bus.ctx).ok());
            bus.run();
            bus.cable(bus.ring_cables[4], false);
            (void)bus.stale_cycles(50);
            (void)bus.events();
            Sound sound(bus);
            busy.each = each;
            sound.cycles(5000);
            sound.expect_no_harm();
        }
}

TEST(RingLostFrames, ACopyOfTheHeadThatIsNotAcceptedDoesNotChangeTheCounts) {
    RingBus bus;
    bus.build_line(8);
    bus.plug();
    BusyNic busy(*bus.nics[0]);
    bus.ctx = std::make_unique<HostContext>(RingBus::limits());
    ASSERT_TRUE(init_redundant(*bus.ctx, busy, *bus.nics[1], bus.osal).ok());
    ASSERT_TRUE(config_init(*bus.ctx).ok());
    bus.run();
    busy.each = 7;
    busy.row = 2;  // the other NIC is the first to send the second of these frames
    for (unsigned n = 0; n < 500; ++n) {
        (void)bus.stale_cycles(1);
        ASSERT_EQ(redundancy(*bus.ctx).cables[0].slaves, 8) << n;
        ASSERT_EQ(redundancy(*bus.ctx).ring, RingState::whole) << n;
    }
}

// The ring breaks, and the NIC at its beginning does not accept the same frame. The reply from behind the break is not
// the reply of all slaves.
TEST(RingLostFrames, ACopyThatIsNotAcceptedAtTheMomentOfABreakLosesNoSlave) {
    RingBus bus;
    bus.build_line(8);
    bus.start();
    bus.run();
    Sound sound(bus);
    for (unsigned n = 0; n < 300; ++n) {
        bus.cable(bus.ring_cables[4], false);
        bus.nics[0]->refused = 2;  // after the first refusal, the other NIC sends first
        sound.cycles(20 + n % 7);
        bus.cable(bus.ring_cables[4], true);
        sound.cycles(30);
    }
    sound.expect_no_harm();
}

TEST(RingLostFrames, NoSoundSlaveMissesItsOutputs) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed)
        for (const std::size_t broken : {1U, 7U, 13U}) {
            SCOPED_TRACE("seed " + std::to_string(seed) + ", ring cable " + std::to_string(broken));
            RingBus bus;
            bus.build_tree();
            bus.start();
            bus.run();
            bus.cable(bus.ring_cables[broken], false);
            (void)bus.stale_cycles(50);
            (void)bus.events();
            Sound sound(bus);
            bus.segment.set_noise({.lost = 0.05, .seed = seed});
            sound.cycles(5000);
            sound.expect_no_harm();
        }
}

TEST(RingLostFrames, EveryCableBreaksAndHeals) {
    for (const std::uint64_t seed : {5U, 6U}) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        RingBus bus;
        bus.build_tree();
        bus.start();
        bus.run();
        Sound sound(bus);
        bus.segment.set_noise({.lost = 0.05, .seed = seed});
        for (const auto& end : bus.ring_cables)
            for (const bool intact : {false, true}) {
                bus.cable(end, intact);
                sound.cycles(150);
            }
        sound.expect_no_harm();
    }
}

// A NIC that accepts only some frames in each cycle, like one with few descriptors.
class NarrowNic final : public ForwardingNic {
  public:
    NarrowNic(Nic& nic, Osal& osal) : ForwardingNic(nic), osal_(osal) {}
    unsigned most = 100;          // frames at the same time
    unsigned probes = 0;          // frames that begin with a NOP
    std::set<std::byte> indices;  // of these frames

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (std::exchange(at_, osal_.now()) != osal_.now()) count_ = 0;
        if (count_ >= most) return SendStatus::busy;
        ++count_;
        if (frame[wire::kFramePrefixBytes] == static_cast<std::byte>(wire::Command::NOP)) {
            ++probes;
            indices.insert(frame[wire::kFramePrefixBytes + 1]);
        }
        return nic_.send(frame);
    }

  private:
    Osal& osal_;
    Time at_ = kNever;
    unsigned count_ = 0;
};

// In a broken ring, the replies of one NIC never arrive. The slaves of its part are lost, and the slaves of the other
// part have fresh inputs again soon. A NIC that accepts no probe is silent after eight copies.
TEST(RingLostFrames, ANicThatIsSilentIsFound) {
    for (const unsigned which : {0U, 1U})
        for (const unsigned most : {100U, 4U, 2U}) {
            SCOPED_TRACE("NIC " + std::to_string(which) + ", frames at the same time " + std::to_string(most));
            RingBus bus;
            bus.build_line(6);
            bus.plug();
            NarrowNic narrow(*bus.nics[which], bus.osal);
            bus.ctx = std::make_unique<HostContext>(RingBus::limits());
            Nic& first = which == 0 ? static_cast<Nic&>(narrow) : *bus.nics[0];
            Nic& second = which == 1 ? static_cast<Nic&>(narrow) : *bus.nics[1];
            ASSERT_TRUE(init_redundant(*bus.ctx, first, second, bus.osal).ok());
            ASSERT_TRUE(config_init(*bus.ctx).ok());
            bus.run();
            bus.cable(bus.ring_cables[3], false);
            (void)bus.stale_cycles(20);
            EXPECT_EQ(narrow.probes, 0U);
            narrow.most = most;
            bus.nics[which]->deaf = true;
            const std::uint16_t other = which == 0 ? 6 : 1;
            unsigned cycles = 0;
            while (cycles < 100 && (cycles < 3 || !inputs_fresh(*bus.ctx, other))) {
                (void)bus.cycle();
                ++cycles;
            }
            EXPECT_LE(cycles, most == 100 ? 12U : 20U);
            EXPECT_EQ(bus.ctx->slave(which == 0 ? 1 : 6).al.state, AlState::none);
            (void)bus.stale_cycles(300);
            EXPECT_LE(narrow.probes, 8U) << "no probes by a silent NIC";
            EXPECT_EQ(narrow.indices.size(), narrow.probes) << "each has another index";
            narrow.most = 100;
            bus.nics[which]->deaf = false;
            EXPECT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
            EXPECT_EQ(bus.stale_cycles(20), 0U);
        }
}

// Accepts all frames, and sends none of them: one direction of its cable is broken.
struct MuteNic final : ForwardingNic {
    bool mute = false;

    using ForwardingNic::ForwardingNic;
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        return mute ? SendStatus::sent : nic_.send(frame);
    }
};

// The copies of the first NIC cross the ring and come back at the second one. A branch that only the copies of the
// second NIC reach is lost.
TEST(RingLostFrames, ANicThatSendsNothingCostsOnlyItsBranches) {
    for (const bool branch : {false, true}) {
        SCOPED_TRACE(branch);
        RingBus bus;
        bus.build_line(6);
        if (branch) (void)bus.add_behind(2, 2);
        bus.plug();
        MuteNic second(*bus.nics[1]);
        bus.ctx = std::make_unique<HostContext>(RingBus::limits());
        ASSERT_TRUE(init_redundant(*bus.ctx, *bus.nics[0], second, bus.osal).ok());
        ASSERT_TRUE(config_init(*bus.ctx).ok());
        bus.run();
        second.mute = true;
        unsigned stale = 0;
        for (unsigned n = 0; n < 300; ++n) {
            (void)bus.cycle();
            for (std::uint16_t slave = 1; slave <= 6; ++slave)
                if (!inputs_fresh(*bus.ctx, slave)) {
                    ++stale;
                    break;
                }
        }
        EXPECT_LE(stale, branch ? 20U : 0U);
        EXPECT_TRUE(!branch || bus.ctx->slave(7).al.state == AlState::none);
        // The other direction breaks too, and this one alone is repaired.
        bus.nics[1]->deaf = true;
        for (unsigned n = 0; n < 100; ++n) (void)bus.cycle();
        bus.nics[1]->deaf = false;
        for (unsigned n = 0; n < 100; ++n) (void)bus.cycle();
        stale = 0;
        for (unsigned n = 0; n < 100; ++n) {
            (void)bus.cycle();
            for (std::uint16_t slave = 1; slave <= 6; ++slave) stale += inputs_fresh(*bus.ctx, slave) ? 0 : 1;
        }
        EXPECT_EQ(stale, 0U);
        second.mute = false;
        EXPECT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
        EXPECT_EQ(bus.stale_cycles(20), 0U);
    }
}

// A branch is reached only by the copies of the second NIC. When its cable breaks between both copies of a frame, this
// NIC does not send its copy, and the other copy crosses the ring without the branch. No slave is lost.
TEST(RingLostFrames, ASlaveThatOnlyTheUnsentCopyReachesIsNotLost) {
    RingBus bus;
    bus.build_line(6);
    (void)bus.add_behind(2, 2);
    bus.plug();
    bus.start();
    bus.run();
    // The supervision reads the states of the slaves again and again, because they are not all the same.
    for (const std::uint16_t number : {std::uint16_t{1}, std::uint16_t{7}})
        ASSERT_TRUE(set_target(*bus.ctx, number, AlState::preop).ok());
    for (unsigned n = 0; n < 100; ++n) (void)bus.cycle();
    (void)bus.events();
    for (std::uint64_t frame = 0; frame < 240; ++frame) {
        const std::uint64_t at = bus.frames + frame;
        bus.on_frame = [&, at](std::uint64_t now) {
            if (now == at) bus.cable(bus.ring_cables.back(), false);
        };
        for (unsigned n = 0; n < 300; ++n) (void)bus.cycle();
        bus.on_frame = nullptr;
        bus.cable(bus.ring_cables.back(), true);
        for (unsigned n = 0; n < 100; ++n) (void)bus.cycle();
        const auto events = bus.events();
        for (const std::string& event : events)
            EXPECT_EQ(event.find(": lost"), std::string::npos) << frame << ": " << event;
    }
}

// The cable of one NIC breaks and is repaired, and the NIC reports a link all the time. A branch is reached only by the
// copies of the second NIC. When the first copy crosses the repaired ring, the copy of the silent NIC is awaited.
TEST(RingLostFrames, TheFirstCycleAfterTheRepairOfASilentNicIsComplete) {
    for (const unsigned which : {0U, 1U}) {
        SCOPED_TRACE("NIC " + std::to_string(which));
        RingBus bus;
        bus.build_line(6);
        (void)bus.add_behind(2, 2);
        bus.plug();
        bus.nics[which]->tells_link = false;
        bus.start();
        bus.run();
        const auto cable = which == 0 ? bus.ring_cables.front() : bus.ring_cables.back();
        bus.cable(cable, false);
        for (unsigned n = 0; n < 40; ++n) (void)bus.cycle();
        EXPECT_EQ(bus.status().ring, RingState::broken);
        bus.cable(cable, true);
        for (unsigned n = 0; n < 40; ++n) {
            (void)bus.cycle();
            EXPECT_TRUE(bus.wkc.ok()) << "cycle " << n << " after the repair: " << bus.words(bus.wkc.error());
        }
        EXPECT_EQ(bus.status().ring, RingState::whole);
        for (const Slave& slave : bus.ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::op) << slave.number;
    }
}

// The replies of both NICs or of one NIC are missing for a while, so the library compares the identities of the slaves.
// Meanwhile the replies of one NIC are missing again. Its slaves get each frame: they keep their outputs, and none of
// them is started again.
TEST(RingLostFrames, RepliesOfOnePartAreMissingWhileSlavesAreCompared) {
    for (const unsigned which : {0U, 1U})
        for (const unsigned both : {0U, 35U, 70U})  // cycles without any reply
            for (unsigned between = 3; between < 12; ++between) {
                SCOPED_TRACE("NIC " + std::to_string(which) + ", " + std::to_string(both) + " cycles, and " +
                             std::to_string(between) + " cycles later");
                RingBus bus;
                bus.build_line(8);
                bus.start();
                bus.run();
                bus.cable(bus.ring_cables[4], false);
                (void)bus.stale_cycles(50);
                Sound sound(bus);
                bus.nics[which]->deaf = true;
                bus.nics[1 - which]->deaf = both != 0;
                sound.cycles(both == 0 ? 70 : both);
                bus.nics[0]->deaf = bus.nics[1]->deaf = false;
                sound.cycles(between);
                bus.nics[which]->deaf = true;
                sound.cycles(12);
                bus.nics[which]->deaf = false;
                sound.cycles(700);
                EXPECT_EQ(*std::ranges::max_element(sound.longest), 0U);
                EXPECT_EQ(sound.out_of_op, 0U);
                EXPECT_EQ(sound.told.find("INIT"), std::string::npos) << sound.told;
                EXPECT_TRUE(bus.all_in_op());
            }
}

}  // namespace
}  // namespace margay
