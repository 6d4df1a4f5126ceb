// The segment for the tests of mistakes that new users make.
#pragma once

#include "process_data/plant.hpp"

namespace margay {

// A line of two slaves with 8 bits of outputs and of inputs each, without mailboxes.
class Mistakes : public testing::Test, protected Plant {
  protected:
    std::vector<std::byte> second_image = std::vector<std::byte>(64);

    void SetUp() override {
        ASSERT_TRUE(segment.connect_master({make({.product = 0x100}), 0}));
        ASSERT_TRUE(segment.connect({0, 1}, {make({.product = 0x101}), 0}));
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        limits.groups = 2;
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    std::vector<std::string> all(ErrorLog& log) {
        std::vector<std::string> texts;
        while (const auto error = log.take()) texts.push_back(words(*error));
        return texts;
    }
};

}  // namespace margay
