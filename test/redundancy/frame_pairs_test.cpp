// Which pair of buffers the next frame on both cables takes, and how a recording tells the probes of both NICs apart.
#include "redundancy/ring_bus.hpp"

#include "link/redundancy.hpp"

#include <array>
#include <set>

namespace margay {
namespace {

class SilentNic final : public Nic {
  public:
    explicit SilentNic(std::uint8_t last) : last_(last) {}
    SendStatus send(std::span<const std::byte>) noexcept override { return SendStatus::sent; }
    std::size_t receive(std::span<std::byte>) noexcept override { return 0; }
    LinkState link_state() noexcept override { return LinkState::up; }
    MacAddress source_mac() const noexcept override { return {2, 0, 0, 0, 0, last_}; }
    Time next_arrival() const noexcept override { return kNever; }

  private:
    std::uint8_t last_;
};

// The reply to the first frame is awaited while the second frame is back. The third frame may not take the pair of the
// first one, whose reply would be lost.
TEST(FramePairs, AnUnusedPairComesBeforeAnOpenOne) {
    SilentNic one(1);
    SilentNic two(2);
    std::array<FramePair, 2> own;
    Redundancy ring(one, two, own, {});
    const auto send = [&](std::uint8_t index) {
        std::array<std::byte, 64> bytes{};
        wire::FrameBuilder builder(bytes, one.source_mac());
        (void)builder.append(wire::Command::BRD, index, {std::uint16_t{0}, std::uint16_t{0}}, 2);
        return ring.send(builder.finish());
    };
    ASSERT_EQ(send(1), SendStatus::sent);
    ASSERT_EQ(send(2), SendStatus::sent);
    ASSERT_EQ(own[0].index, 1);
    ASSERT_EQ(own[1].index, 2);
    own[1].state = FramePair::unused;
    ASSERT_EQ(send(3), SendStatus::sent);
    EXPECT_EQ(own[0].index, 1);
    EXPECT_EQ(own[1].index, 3);
    ASSERT_EQ(send(4), SendStatus::sent);
    EXPECT_EQ(own[0].index, 4) << "both are open: the older frame was lost";
}

TEST(FramePairs, TheIndexOfAProbeTellsItsNic) {
    RingBus bus;
    bus.build_line(4);
    bus.start();
    std::set<std::byte> seen[2];
    for (unsigned n = 0; n < 2; ++n)
        bus.nics[n]->sees_frame = [&seen, n](std::span<const std::byte> frame) {
            const auto first = wire::load_datagram_header(frame.subspan(wire::kFramePrefixBytes));
            if (first.command == wire::Command::NOP && first.address == wire::DatagramAddress(0x5052'4F42))
                seen[n].insert(static_cast<std::byte>(first.index));
        };
    bus.run();
    for (const std::size_t place : {0U, 4U}) {  // the cables of both NICs
        for (auto& nic : bus.nics) nic->tells_link = false;
        bus.cable(bus.ring_cables[place], false);
        (void)bus.stale_cycles(100);
        bus.cable(bus.ring_cables[place], true);
        (void)bus.stale_cycles(100);
    }
    ASSERT_FALSE(seen[0].empty());
    ASSERT_FALSE(seen[1].empty());
    for (const unsigned nic : {0U, 1U})
        for (const std::byte index : seen[nic]) EXPECT_EQ(std::to_integer<unsigned>(index) & 1U, nic);
}

}  // namespace
}  // namespace margay
