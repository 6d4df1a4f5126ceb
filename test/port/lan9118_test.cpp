// The driver of the LAN9118 without the controller; test/qemu runs it with one.
#include <margay/parts/oshw/lan9118/lan9118.hpp>

#include <gtest/gtest.h>

#include <array>

namespace margay {
namespace {

// A bus where each register reads as the same value: the controller has lost its supply, or is in reset.
struct DeadBus {
    explicit DeadBus(std::uint32_t value) { registers.fill(value); }
    std::array<std::uint32_t, 64> registers{};
    Lan9118 nic{registers.data(), {0, 1, 2, 3, 4, 5}};
};

TEST(Lan9118, ReceiveOfAControllerThatDoesNotAnswerReturns) {
    for (const std::uint32_t value : {0xFFFFFFFFU, 0x7FFFFFFFU, 0x00010000U, 0x00FF8000U, 0U}) {
        DeadBus bus(value);
        std::array<std::byte, 1514> memory{};
        EXPECT_EQ(bus.nic.receive(memory), 0U) << std::hex << value;
        EXPECT_LE(bus.nic.damaged(), 255U) << "more frames than the controller stores";
    }
}

TEST(Lan9118, SendToAControllerThatDoesNotAnswerReturns) {
    for (const std::uint32_t value : {0xFFFFFFFFU, 0x7FFFFFFFU, 0U}) {
        DeadBus bus(value);
        const std::array<std::byte, 60> frame{};
        (void)bus.nic.send(frame);
        EXPECT_NE(bus.nic.send(std::array<std::byte, 13>{}), SendStatus::sent);
    }
}

}  // namespace
}  // namespace margay
