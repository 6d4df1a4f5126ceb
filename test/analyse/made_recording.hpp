// Recordings made octet by octet.
#pragma once

#include "analyse/analyser.hpp"

#include "replay/files.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <initializer_list>
#include <vector>

namespace margay::analyse {

using namespace std::chrono_literals;
using wire::Command;

struct Part {
    Command command{};
    wire::DatagramAddress address{};
    std::vector<std::byte> data{};
    std::uint16_t wkc = 0;
};

inline Frame frame_of(const std::vector<Part>& parts, bool reply, std::uint8_t index = 1,
                      std::uint8_t first_octet = 0) {
    Frame buffer(wire::kMaxFrameBytes);
    const auto octet = static_cast<std::uint8_t>(first_octet | (reply ? 2U : 0U));
    wire::FrameBuilder builder(buffer, {octet, 0x11, 0x22, 0x33, 0x44, 0x55});
    for (const auto& part : parts) {
        auto address = part.address;
        const auto data = builder.append(part.command, index, address, part.data.size());
        std::ranges::copy(part.data, data.begin());
        if (reply) store_le(MutableBytes(buffer), builder.size() - 2, part.wkc);
    }
    buffer.resize(builder.finish().size());
    return buffer;
}

inline std::vector<std::byte> octets_of(std::initializer_list<unsigned> values) {
    std::vector<std::byte> all;
    for (const auto value : values) all.push_back(static_cast<std::byte>(value));
    return all;
}

struct AnalyserTest : testing::Test {
    Analyser analyser;
    std::uint64_t number = 0;

    void packet(Duration at, const Frame& frame) { analyser.packet({++number, at}, frame, frame.size()); }
    void exchange(Duration at, const std::vector<Part>& parts, std::uint8_t index = 1) {
        packet(at, frame_of(parts, false, index));
        packet(at + 30us, frame_of(parts, true, index));
    }
};

}  // namespace margay::analyse
