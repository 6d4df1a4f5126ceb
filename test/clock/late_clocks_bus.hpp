// Slaves that come, or come back, while other slaves are in operation.
#pragma once

#include "clock/clock_bus.hpp"

namespace margay {

using namespace std::chrono_literals;

struct LateClocksBus : ClockBus {
    std::vector<ExpectedSlave> wanted;
    SlaveSetup setup{.dc = {.source = SyncSettings::Source::application}};
    Duration period = 1ms;
    SimulatedNic::Options nic_options;

    // Connects slaves at the ports of a junction, which is the first slave. `late`: the slave may be missing.
    void hang(std::uint8_t port, const ClockOf& clock, bool late = false) {
        ExpectedSlave slave;
        slave.number = static_cast<std::uint16_t>(wanted.size() + 1);
        slave.product = 0x0200 + slave.number;
        slave.optional = late;
        wanted.push_back(slave);
        auto made = clocked(clock, kOneMode, {.product = *slave.product});
        made.chip.ports = sim::junction().ports;
        const auto n = segment.add(std::move(made).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({0, port}, {n, 0}, kCable));
    }
    void bring_up(ClockSettings settings, std::initializer_list<std::uint32_t> missing) {
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal, nic_options);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        for (const auto n : missing) power(n, false);
        ASSERT_TRUE(expect(*ctx, wanted).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
        settings.cycle = period;
        const auto reference = configdc(*ctx, settings);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        ctx->group(0).config.acyclic_bytes = 1498;
        for (std::uint16_t n = 1; n <= wanted.size(); ++n) ctx->slave(n).config.setup = &setup;
        (void)config_map(*ctx, image);
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        steps(2000);
        (void)events();
    }
    void step() { step(period); }
    void step(Duration after) {
        osal.advance(after);
        if (send_processdata(*ctx, 0)) (void)receive_processdata(*ctx, reply_timeout, 0);
        (void)poll(*ctx, osal.now());
    }
    void steps(int count) {
        while (count-- > 0) step();
    }
};

}  // namespace margay
