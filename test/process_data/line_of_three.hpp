// A line of three slaves for tests about the slaves that are driven, and the states that they get.
#pragma once

#include "process_data/plant.hpp"

namespace margay {

// Products 0x100, 0x101, 0x102, each with 8 bits out and 8 bits in and without a mailbox.

class LineOfThree : public testing::Test, protected Plant {
  protected:
    static constexpr PdoEntry kEightOut[] = {{0x7000, 1, 8}};
    static constexpr PdoEntry kEightIn[] = {{0x6000, 1, 8}};
    static constexpr Pdo kOutputs[] = {{0x1600, kEightOut}};
    static constexpr Pdo kInputs[] = {{0x1A00, kEightIn}};
    static constexpr SmPdos kPdos[] = {{0, kOutputs}, {1, kInputs}};
    static constexpr SlaveSetup kSetup{.pdos = kPdos};

    std::array<std::uint32_t, 3> line{};
    void SetUp() override {
        for (std::uint32_t n = 0; n < line.size(); ++n) {
            line[n] = make({.product = 0x100 + n});
            ASSERT_TRUE(n == 0 ? segment.connect_master({line[n], 0})
                               : segment.connect({line[n - 1], 1}, {line[n], 0}));
        }
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    Result<std::uint16_t> scan(std::span<const ExpectedSlave> expected) {
        EXPECT_TRUE(expect(*ctx, expected).ok());
        return config_init(*ctx);
    }
    // Supervises and sends outputs for `count` cycles. Returns the outputs that each device applied.
    std::vector<unsigned> drive(int count = 800) {
        EXPECT_TRUE(submit(*ctx, supervision).ok());
        for (int n = 0; n < count; ++n) {
            for (const Slave& slave : ctx->slaves())
                for (auto& octet : slave.image.outputs.bytes) octet = std::byte{0xA5};
            (void)cycle();
        }
        std::vector<unsigned> out;
        for (const auto number : line) {
            const auto bytes = program(number).outputs();
            out.push_back(bytes.empty() ? 0U : std::to_integer<unsigned>(bytes[0]));
        }
        return out;
    }
};

}  // namespace margay
