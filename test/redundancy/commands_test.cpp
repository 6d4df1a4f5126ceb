// Each command in a broken ring: the merged reply equals the reply of the unbroken line, wherever the ring is broken.
#include "link/redundancy.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace margay {
namespace {

using wire::Command;
using wire::DatagramAddress;

constexpr unsigned kSlaves = 6;

struct Got {
    std::vector<std::byte> data;
    std::uint16_t wkc = 0;
    friend bool operator==(const Got&, const Got&) = default;
};

std::ostream& operator<<(std::ostream& out, const Got& got) {
    out << "wkc " << got.wkc << " data";
    for (const std::byte octet : got.data) out << ' ' << std::to_integer<unsigned>(octet);
    return out;
}

struct Sent {
    Command command;
    DatagramAddress address;
    std::vector<std::byte> data;
};

std::vector<std::byte> octets(std::initializer_list<unsigned> values) {
    std::vector<std::byte> all;
    for (const unsigned value : values) all.push_back(static_cast<std::byte>(value));
    return all;
}

// A NIC that sends. While it is deaf, its replies never arrive, because one direction of its cable is broken.
class DeafNic final : public Nic {
  public:
    explicit DeafNic(Nic& nic) : nic_(nic) {}
    bool deaf = false;
    bool busy = false;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        return busy ? SendStatus::busy : nic_.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        std::size_t length = nic_.receive(into);
        while (deaf && length != 0) length = nic_.receive(into);
        return length;
    }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }

  private:
    Nic& nic_;
};

// Slaves with station addresses 0x1001 … and the value 0x10 + n in 0x0F80. One octet of each slave is mapped from
// 0x10000 on for reading, and the same octets are mapped for writing to 0x0F90.
struct Rig {
    VirtualOsal osal;
    sim::Segment segment;
    std::unique_ptr<SimulatedNic> wires[2];
    std::unique_ptr<DeafNic> nics[2];
    std::vector<FramePair> pairs = std::vector<FramePair>(4);
    std::unique_ptr<Redundancy> ring;
    std::uint8_t index = 0;

    // `broken`: the cable before this slave is broken; above kSlaves: no cable.
    explicit Rig(unsigned broken, bool two = true) {
        for (unsigned n = 0; n < kSlaves; ++n) {
            auto device = sim::device_from_sii(io_image(16, 16));
            device.chip = sim::junction();
            (void)segment.add(std::move(device).assemble());
            EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        }
        EXPECT_TRUE(segment.connect_master({kSlaves - 1, 1}, 1));
        segment.power_up(osal.now());
        for (unsigned n = 0; n < 2; ++n) {
            SimulatedNic::Options options;
            options.master_port = n;
            options.round_trip = std::chrono::microseconds(n == 0 ? 100 : 70);  // the second NIC answers first
            wires[n] = std::make_unique<SimulatedNic>(segment, osal, options);
            nics[n] = std::make_unique<DeafNic>(*wires[n]);
        }
        wires[0]->set_other_end(wires[1].get());
        wires[1]->set_other_end(wires[0].get());
        if (!two) segment.set_cable({kSlaves - 1, 1}, false);
        ring = std::make_unique<Redundancy>(*nics[0], *nics[1], pairs, std::span<FramePair>());
        for (std::uint16_t n = 0; n < kSlaves; ++n) {
            const RingPosition at{n};
            write(at, 0x0010, octets({1U + n, 0x10}));
            write(at, 0x0F80, octets({0x10U + n}));
            // FMMU 0: read 0x0F80; FMMU 1: write 0x0F90.
            write(at, 0x0600, octets({n, 0, 1, 0, 1, 0, 0, 7, 0x80, 0x0F, 0, 1, 1, 0, 0, 0}));
            write(at, 0x0610, octets({n, 0, 1, 0, 1, 0, 0, 7, 0x90, 0x0F, 0, 2, 1, 0, 0, 0}));
        }
        if (broken < kSlaves) segment.set_cable({broken, 0}, false);
        if (broken == kSlaves) segment.set_cable({kSlaves - 1, 1}, false);
        (void)exchange({{Command::BRD, {0, 0}, octets({0})}});  // counts the slaves at each end
    }
    void write(RingPosition at, std::uint16_t address, std::vector<std::byte> data) {
        const auto got = exchange({{Command::APWR, {at, address}, std::move(data)}});
        ASSERT_EQ(got.size(), 1U);
        ASSERT_EQ(got[0].wkc, 1U) << address;
    }
    std::vector<Got> exchange(const std::vector<Sent>& datagrams) {
        std::array<std::byte, wire::kMaxFrameBytes> frame{};
        wire::FrameBuilder builder(frame, ring->source_mac());
        ++index;
        for (const Sent& one : datagrams) {
            const auto data = builder.append(one.command, index, one.address, one.data.size());
            std::ranges::copy(one.data, data.begin());
        }
        EXPECT_EQ(ring->send(builder.finish()), SendStatus::sent);
        return receive();
    }
    std::vector<Got> receive() {
        std::array<std::byte, wire::kMaxFrameBytes> frame{};
        std::size_t length = 0;
        for (unsigned n = 0; n < 200 && length == 0; ++n) {
            osal.advance(std::chrono::microseconds(5));
            length = ring->receive(frame);
        }
        std::vector<Got> all;
        if (length == 0) return all;
        EXPECT_EQ(frame[wire::kSourceMacOffset] & wire::kPassedEscBit, wire::kPassedEscBit);
        wire::DatagramReader reader(Bytes(frame).first(length));
        while (const auto d = reader.next()) {
            EXPECT_EQ(d->header.index, index);
            all.push_back({{d->data.begin(), d->data.end()}, d->wkc});
        }
        EXPECT_EQ(reader.fault(), wire::FrameFault::none);
        return all;
    }
    std::byte memory(std::uint32_t slave, std::uint16_t address) {
        std::array<std::byte, 1> octet{};
        (void)segment.slave(slave).ecat_read(address, octet, osal.now());
        return octet[0];
    }
};

// Exchanges the datagrams in a line, and in the ring with each cable broken, and compares.
void expect_as_in_a_line(const std::vector<Sent>& datagrams) {
    Rig line(kSlaves + 1, false);
    const auto expected = line.exchange(datagrams);
    ASSERT_EQ(expected.size(), datagrams.size());
    for (unsigned broken = 0; broken <= kSlaves + 1; ++broken) {
        SCOPED_TRACE("broken before slave " + std::to_string(broken));
        Rig rig(broken);
        EXPECT_EQ(rig.exchange(datagrams), expected);
        for (std::uint32_t n = 0; n < kSlaves; ++n) {
            EXPECT_EQ(rig.memory(n, 0x0F80), line.memory(n, 0x0F80)) << n;
            EXPECT_EQ(rig.memory(n, 0x0F90), line.memory(n, 0x0F90)) << n;
        }
    }
}

TEST(RingCommands, ByPosition) {
    for (std::uint16_t n = 0; n < kSlaves; ++n) {
        const RingPosition at{n};
        expect_as_in_a_line({{Command::APRD, {at, 0x0F80}, octets({0xAA})},
                             {Command::APWR, {at, 0x0F90}, octets({0x77})},
                             {Command::APRW, {at, 0x0F80}, octets({0x33})}});
    }
    expect_as_in_a_line({{Command::APRD, {RingPosition{kSlaves}, 0x0F80}, octets({0})}});
}

TEST(RingCommands, ByStationAddress) {
    for (std::uint16_t n = 0; n < kSlaves; ++n) {
        const StationAddress at{static_cast<std::uint16_t>(0x1001 + n)};
        expect_as_in_a_line({{Command::FPRD, {at, 0x0F80}, octets({0xFF})},
                             {Command::FPWR, {at, 0x0F90}, octets({0x55})},
                             {Command::FPRW, {at, 0x0F80}, octets({0x5A})}});
    }
}

TEST(RingCommands, Broadcast) {
    expect_as_in_a_line({{Command::BRD, {0, 0x0F80}, octets({0})},
                         {Command::BWR, {0, 0x0F90}, octets({0x21})},
                         {Command::BRD, {0, 0x0F90}, octets({0, 0})}});
}

// BRW forwards the values that the slaves before have read. Behind the break the slaves get the sent values. The result
// and the working counter are the same as in the line.
TEST(RingCommands, BroadcastReadWrite) {
    Rig line(kSlaves + 1, false);
    const std::vector<Sent> brw{{Command::BRW, {0, 0x0F80}, octets({0x40})}};
    const auto expected = line.exchange(brw);
    for (unsigned broken = 0; broken <= kSlaves + 1; ++broken) EXPECT_EQ(Rig(broken).exchange(brw), expected) << broken;
}

TEST(RingCommands, Logical) {
    constexpr auto at = [](std::uint32_t address) { return DatagramAddress(LogicalAddress{address}); };
    const auto out = octets({0x81, 0x42, 0x23, 0x14, 0x05, 0xF6, 0xFF, 0, 0x99});  // three octets that no slave maps
    expect_as_in_a_line({{Command::LRD, at(0x10000), octets({0, 0, 0, 0, 0, 0, 0, 0, 0})}});
    expect_as_in_a_line({{Command::LRD, at(0x10000), out}});
    expect_as_in_a_line({{Command::LWR, at(0x10000), out}});
    expect_as_in_a_line({{Command::LRW, at(0x10000), out}});
    expect_as_in_a_line({{Command::LRW, at(0x10002), octets({0xFF, 0})}});
}

// The reference is read at any place. The slaves at the other end get the sent values.
TEST(RingCommands, FrmwAndArmw) {
    for (unsigned reference = 0; reference < kSlaves; ++reference)
        for (unsigned broken = 0; broken <= kSlaves + 1; ++broken) {
            SCOPED_TRACE("reference " + std::to_string(reference) + ", broken before slave " + std::to_string(broken));
            Rig rig(broken);
            const StationAddress station{static_cast<std::uint16_t>(0x1001 + reference)};
            const RingPosition position{static_cast<std::uint16_t>(reference)};
            const Got expected{octets({0x10 + reference}), kSlaves};
            const auto frmw = rig.exchange({{Command::FRMW, {station, 0x0F80}, octets({0x77})}});
            ASSERT_EQ(frmw.size(), 1U);
            EXPECT_EQ(frmw[0], expected);
            const auto armw = rig.exchange({{Command::ARMW, {position, 0x0F80}, octets({0x77})}});
            ASSERT_EQ(armw.size(), 1U);
            EXPECT_EQ(armw[0], expected);
        }
}

// The ring breaks after the slaves were counted. A frame with positions gets no answer instead of a wrong answer, and
// its repetition succeeds.
TEST(RingCommands, PositionsAfterANewBreakAreRepeated) {
    Rig rig(kSlaves + 1);
    rig.segment.set_cable({3, 0}, false);
    const std::vector<Sent> read{{Command::APRD, {RingPosition{4}, 0x0F80}, octets({0})}};
    EXPECT_TRUE(rig.exchange(read).empty());
    EXPECT_EQ(rig.ring->status().repeated, 1U);
    const auto again = rig.exchange(read);
    ASSERT_EQ(again.size(), 1U);
    EXPECT_EQ(again[0], (Got{octets({0x14}), 1}));
}

// The cable heals and another cable breaks, and no frame has noticed this. A write by position reaches the right slave,
// or is an error. After an error another slave may have received the write, and no working counter hides this.
TEST(RingCommands, PositionsWhileTheBreakMoves) {
    for (unsigned to = 1; to < kSlaves; ++to)
        for (std::uint16_t at = 0; at < kSlaves; ++at) {
            SCOPED_TRACE("break before " + std::to_string(to) + ", position " + std::to_string(at));
            Rig rig(2);
            ASSERT_EQ(rig.exchange({{Command::BRD, {0, 0}, octets({0})}}).size(), 1U);
            rig.segment.set_cable({2, 0}, true);
            rig.segment.set_cable({to, 0}, false);
            const std::vector<Sent> sent{{Command::APWR, {RingPosition{at}, 0x0F80}, octets({0x77})}};
            auto got = rig.exchange(sent);
            if (got.empty()) got = rig.exchange(sent);
            ASSERT_EQ(got.size(), 1U) << "repeated once at most";
            std::vector<unsigned> written;
            for (std::uint16_t n = 0; n < kSlaves; ++n) {
                const StationAddress station{static_cast<std::uint16_t>(0x1001 + n)};
                const auto seen = rig.exchange({{Command::FPRD, {station, 0x0F80}, octets({0})}});
                ASSERT_EQ(seen.size(), 1U);
                if (seen[0].data == octets({0x77})) written.push_back(n);
            }
            if (got[0].wkc == 1) {
                EXPECT_EQ(written, std::vector<unsigned>{at});
            } else {
                EXPECT_EQ(got[0].wkc, 0);
            }
            if (to == 2) {
                EXPECT_EQ(got[0].wkc, 1) << "the break is where it was";
            }
        }
}

// After the ring was whole, the slaves behind a new break are not counted yet. No slave gets a datagram for another
// slave.
TEST(RingCommands, PositionsAtANewBreakHarmNoSlave) {
    for (unsigned to = 1; to < kSlaves; ++to)
        for (std::uint16_t at = 0; at < kSlaves; ++at) {
            SCOPED_TRACE("break before " + std::to_string(to) + ", position " + std::to_string(at));
            Rig rig(3);
            ASSERT_EQ(rig.exchange({{Command::BRD, {0, 0}, octets({0})}}).size(), 1U);
            rig.segment.set_cable({3, 0}, true);
            ASSERT_EQ(rig.exchange({{Command::FPRD, {StationAddress{0x1001}, 0x0F80}, octets({0})}}).size(), 1U);
            rig.segment.set_cable({to, 0}, false);
            const std::vector<Sent> sent{{Command::APWR, {RingPosition{at}, 0x0F80}, octets({0x77})}};
            auto got = rig.exchange(sent);
            for (int tries = 0; tries < 3 && got.empty(); ++tries) got = rig.exchange(sent);
            ASSERT_EQ(got.size(), 1U);
            EXPECT_EQ(got[0].wkc, 1);
            for (std::uint16_t n = 0; n < kSlaves; ++n) {
                const StationAddress station{static_cast<std::uint16_t>(0x1001 + n)};
                const auto seen = rig.exchange({{Command::FPRD, {station, 0x0F80}, octets({0})}});
                ASSERT_EQ(seen.size(), 1U);
                EXPECT_EQ(seen[0].data == octets({0x77}), n == at) << n;
            }
        }
}

// The NIC at the beginning sends, but its replies do not arrive. Then positions count from the break. No position
// addresses the slaves of this NIC, because no reply would arrive. When its replies arrive again, positions count from
// this NIC.
TEST(RingCommands, PositionsBesideADeafNic) {
    constexpr std::uint16_t kBreak = 3;
    for (const bool swapped : {false, true})
        for (std::uint16_t at = 0; at < kSlaves; ++at) {
            SCOPED_TRACE((swapped ? "swapped, position " : "position ") + std::to_string(at));
            Rig rig(kSlaves + 1);
            if (swapped) {
                rig.segment.set_cable({kBreak, 0}, false);
                rig.ring = std::make_unique<Redundancy>(*rig.nics[1], *rig.nics[0], rig.pairs, std::span<FramePair>());
                (void)rig.exchange({{Command::BRD, {0, 0}, octets({0})}});
                ASSERT_TRUE(rig.ring->status().swapped);
            }
            rig.segment.set_cable({kBreak, 0}, false);
            rig.nics[0]->deaf = true;
            for (int n = 0; n < 3; ++n) {
                (void)rig.exchange({{Command::BRD, {0, 0}, octets({0})}});
                rig.ring->give_up(rig.index);
            }
            const std::vector<Sent> sent{{Command::APWR, {RingPosition{at}, 0x0F80}, octets({0x77})}};
            const auto got = rig.exchange(sent);
            ASSERT_EQ(got.size(), 1U);
            EXPECT_EQ(got[0].wkc, at < kSlaves - kBreak ? 1 : 0);
            rig.nics[0]->deaf = false;
            const std::vector<Sent> then{{Command::APWR, {RingPosition{at}, 0x0F81}, octets({0x78})}};
            auto heard = rig.exchange(then);
            if (at < kSlaves - kBreak) {
                ASSERT_EQ(heard.size(), 1U);
                EXPECT_EQ(heard[0].wkc, 0) << "the slave that was not meant is written: an error tells it";
            } else {
                EXPECT_TRUE(heard.empty()) << "it is repeated";
            }
            heard = rig.exchange(then);
            ASSERT_EQ(heard.size(), 1U);
            EXPECT_EQ(heard[0].wkc, 1);
            for (std::uint16_t n = 0; n < kSlaves; ++n) {
                const StationAddress station{static_cast<std::uint16_t>(0x1001 + n)};
                const auto seen = rig.exchange({{Command::FPRD, {station, 0x0F80}, octets({0, 0})}});
                ASSERT_EQ(seen.size(), 1U);
                EXPECT_EQ(seen[0].data[0] == std::byte{0x77}, n == at + kBreak) << n;
                EXPECT_EQ(seen[0].data[1] == std::byte{0x78}, n == at || n == at + kBreak) << n;
            }
        }
}

// A busy NIC does not cause the loss of a frame that the other NIC brings to all slaves.
TEST(RingCommands, ABusyNicAtTheEndOfTheRing) {
    for (const bool swapped : {false, true}) {
        SCOPED_TRACE(swapped);
        Rig rig(kSlaves + 1);
        if (swapped)
            rig.ring = std::make_unique<Redundancy>(*rig.nics[1], *rig.nics[0], rig.pairs, std::span<FramePair>());
        const std::vector<Sent> sent{{Command::BRD, {0, 0}, octets({0})}};
        for (int n = 0; n < 2; ++n) ASSERT_EQ(rig.exchange(sent).size(), 1U);
        ASSERT_EQ(rig.ring->status().swapped, swapped);
        for (int n = 0; n < 3; ++n) {
            rig.nics[1]->busy = true;
            const auto got = rig.exchange(sent);
            ASSERT_EQ(got.size(), 1U) << n;
            EXPECT_EQ(got[0].wkc, kSlaves) << n;
            rig.nics[1]->busy = n != 2;
        }
        EXPECT_EQ(rig.exchange(sent).size(), 1U);
        EXPECT_EQ(rig.ring->status().ring, RingState::whole);
        // The copy of the head is necessary, so the caller sends the frame again.
        rig.nics[0]->busy = true;
        std::array<std::byte, wire::kMaxFrameBytes> frame{};
        wire::FrameBuilder builder(frame, rig.ring->source_mac());
        (void)builder.append(Command::BRD, 0x70, DatagramAddress(0, 0), 1);
        const auto first = rig.ring->send(builder.finish());
        EXPECT_TRUE(swapped || first == SendStatus::busy);
    }
}

// Several frames at the same time, with different round trips at both ends. Each reply is merged from its own two
// copies.
TEST(RingCommands, ManyFramesInFlight) {
    Rig rig(2);
    std::array<std::byte, wire::kMaxFrameBytes> frame{};
    for (std::uint8_t n = 0; n < 4; ++n) {
        wire::FrameBuilder builder(frame, rig.ring->source_mac());
        const StationAddress at{static_cast<std::uint16_t>(0x1001 + n)};
        (void)builder.append(Command::FPRD, static_cast<std::uint8_t>(0x40 + n), {at, 0x0F80}, 1);
        (void)builder.append(Command::BRD, static_cast<std::uint8_t>(0x40 + n), DatagramAddress(0, 0), 1);
        ASSERT_EQ(rig.ring->send(builder.finish()), SendStatus::sent);
        rig.osal.advance(std::chrono::microseconds(7));
    }
    for (std::uint8_t n = 0; n < 4; ++n) {
        rig.index = static_cast<std::uint8_t>(0x40 + n);
        const auto got = rig.receive();
        ASSERT_EQ(got.size(), 2U);
        EXPECT_EQ(got[0], (Got{octets({0x10U + n}), 1}));
        EXPECT_EQ(got[1].wkc, kSlaves);
    }
    EXPECT_EQ(rig.ring->status().cables[0].late + rig.ring->status().cables[1].late, 0U);
}

// Copies that arrive after the link has given up their frame are dropped and counted.
TEST(RingCommands, LateReplies) {
    Rig rig(2);
    std::array<std::byte, wire::kMaxFrameBytes> frame{};
    wire::FrameBuilder builder(frame, rig.ring->source_mac());
    (void)builder.append(Command::BRD, 0x50, DatagramAddress(0, 0), 1);
    ASSERT_EQ(rig.ring->send(builder.finish()), SendStatus::sent);
    rig.osal.advance(std::chrono::microseconds(72));
    EXPECT_EQ(rig.ring->receive(frame), 0U);  // the copy of the second NIC has come
    rig.ring->give_up(0x50);
    EXPECT_EQ(rig.ring->status().cables[0].lost, 1U);
    rig.osal.advance(std::chrono::microseconds(100));
    EXPECT_EQ(rig.ring->receive(frame), 0U);
    EXPECT_EQ(rig.exchange({{Command::BRD, {0, 0}, octets({0})}}).at(0).wkc, kSlaves);
}

TEST(RingMerge, ABitIsChangedWhereOneOfBothHasChangedIt) {
    std::array<std::byte, 64> sent{};
    std::array<std::byte, 64> one{};
    std::array<std::byte, 64> two{};
    constexpr MacAddress kSource{2, 0, 0, 0, 0, 1};
    for (auto* frame : {&sent, &one, &two}) {
        wire::FrameBuilder builder(*frame, kSource);
        const auto data = builder.append(Command::LRW, 1, DatagramAddress(0), 11);
        std::ranges::fill(data, std::byte{0b1100});
        (void)builder.finish();
    }
    constexpr std::size_t kData = wire::kFramePrefixBytes + wire::kDatagramHeaderBytes;
    one[kData] = one[kData + 10] = std::byte{0b0101};  // cleared bit 3, set bit 0
    two[kData] = two[kData + 10] = std::byte{0b1010};  // cleared bit 2, set bit 1
    one[kData + 11] = std::byte{0xFF};                 // the working counters: 0x00FF + 2
    two[kData + 11] = std::byte{2};
    merge_replies(one, two, sent);
    EXPECT_EQ(one[kData], std::byte{0b0011});
    EXPECT_EQ(one[kData + 10], std::byte{0b0011});
    EXPECT_EQ(one[kData + 1], std::byte{0b1100});
    EXPECT_EQ(one[kData + 11], std::byte{1});
    EXPECT_EQ(one[kData + 12], std::byte{1});
}

}  // namespace
}  // namespace margay
