// A master on a simulated segment, in virtual time. Used by all tests of this folder.
#pragma once

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/segment.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

namespace margay {

class SegmentTest : public testing::Test {
  protected:
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    HostContext ctx{Limits{.slaves = 256}};

    // Connects a device behind the last device of the line.
    sim::Esc& plug(sim::Device device) {
        const auto number = segment.add(std::move(device).assemble());
        if (number == 0)
            EXPECT_TRUE(segment.connect_master({0, 0}));
        else
            EXPECT_TRUE(segment.connect({number - 1, 1}, {number, 0}));
        return segment.slave(number);
    }
    sim::Esc& plug(std::string_view name) { return plug(sim::make_device(name).value()); }
    void plug_line(std::initializer_list<std::string_view> names) {
        for (const auto name : names) plug(name);
    }
    void switch_on() {
        segment.power_up(osal.now());
        osal.advance(std::chrono::milliseconds(1));
    }
    // Initialises the master on this NIC and scans, without any configuration.
    Result<std::uint16_t> bring_up(Nic& nic) {
        const auto ready = init(ctx, nic, osal);
        return ready ? config_init(ctx) : Result<std::uint16_t>(ready.error());
    }
    Result<std::uint16_t> bring_up() { return bring_up(wire); }

    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    void expect_all_in(AlState state) {
        for (const Slave& slave : ctx.slaves()) {
            EXPECT_EQ(slave.al.state, state) << slave.number;
            EXPECT_EQ(slave.error.code, Errc::none) << words(slave.error);
        }
    }
};

}  // namespace margay
