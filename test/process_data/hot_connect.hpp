// Slaves that arrive later, leave, and return at another place. The segment is a line of three slaves, to which other
// slaves are connected.
#pragma once

#include "process_data/plant.hpp"

namespace margay {

using Sentences = std::vector<std::string>;

inline constexpr std::uint32_t kVendor = 0x4D47;

// The process data of a slave in the line, as in its SII.
inline SlaveConfiguration io() {
    SlaveConfiguration config;
    config.source = ConfigurationSource::application;
    config.add({0, Direction::outputs, 0x64, 0x1100, 8});
    config.add({1, Direction::inputs, 0x20, 0x2000, 8});
    return config;
}
inline const SlaveConfiguration kIo = io();

class HotConnectTest : public testing::Test, protected Plant {
  protected:
    // A line of three slaves: 0x100, 0x101, 0x102.
    std::array<std::uint32_t, 3> line{};
    void SetUp() override {
        for (std::uint32_t n = 0; n < line.size(); ++n) {
            line[n] = make({.product = 0x100 + n});
            ASSERT_TRUE(n == 0 ? segment.connect_master({line[n], 0})
                               : segment.connect({line[n - 1], 1}, {line[n], 0}));
        }
    }
    static ExpectedSlave at(std::uint16_t number, std::uint32_t product, bool optional = false) {
        return {.number = number, .vendor = kVendor, .product = product, .optional = optional, .config = &kIo};
    }
};

}  // namespace margay
