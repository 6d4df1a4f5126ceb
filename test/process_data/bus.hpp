// A master and a simulated segment with devices of chosen sizes, in virtual time.
#pragma once

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"
#include "sim/process_data.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace margay {

class Bus {
  public:
    VirtualOsal osal;
    sim::Segment segment;
    std::unique_ptr<SimulatedNic> nic;
    std::unique_ptr<HostContext> ctx;
    Duration reply_timeout = std::chrono::microseconds(500);
    SimulatedNic::Options nic_options;

    // Appends a slave to the line.
    void add(std::uint32_t output_bits, std::uint32_t input_bits) {
        auto device = sim::device_from_sii(io_image(output_bits, input_bits));
        device.chip = sim::lan9252();
        device.chip.ram_kib = 16;
        device.chip.fmmus = 4;
        const auto n = segment.add(std::move(device).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
    }
    // Switches the segment on and scans it.
    void start(const Limits& limits = {.slaves = 64}) {
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal, nic_options);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal));
        const auto found = config_init(*ctx);
        ASSERT_TRUE(found.ok());
        ASSERT_EQ(*found, segment.size());
    }
    // Executes a cycle, one millisecond after the last cycle.
    Result<std::uint32_t> cycle(std::uint8_t group = 0) {
        osal.advance(std::chrono::milliseconds(1));
        const auto sent = send_processdata(*ctx, group);
        const auto wkc = sent ? receive_processdata(*ctx, reply_timeout, group) : Result<std::uint32_t>(sent.error());
        (void)poll(*ctx, osal.now());
        return wkc;
    }
    // Brings all slaves to OP while cycles are exchanged.
    AlStatus to_op() {
        for (int i = 0; i < 5; ++i) (void)cycle();
        EXPECT_TRUE(writestate(*ctx, 0, AlState::op).ok());
        AlStatus reached;
        for (int i = 0; i < 100; ++i) {
            (void)cycle();
            const auto now = statecheck(*ctx, 0, AlState::op, Duration{0});
            EXPECT_TRUE(now.ok());
            reached = *now;
            if (reached.state == AlState::op) break;
        }
        return reached;
    }
    // The firmware of slave `number`.
    sim::ProcessDataFirmware& device(std::size_t number) {
        return static_cast<sim::ProcessDataFirmware&>(
            *segment.slave(static_cast<std::uint32_t>(number - 1)).firmware());
    }
    std::vector<std::string> errors() { return taken(ctx->errors()); }
    std::vector<std::string> warnings() { return taken(ctx->warnings()); }
    static std::vector<std::string> taken(ErrorLog& log) {
        std::vector<std::string> all;
        while (const auto error = log.take()) {
            std::array<char, 256> text{};
            all.emplace_back(describe(*error, text));
        }
        return all;
    }
};

}  // namespace margay
