// A bench for the tests of files.
#pragma once

#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/master_clock.hpp>

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"
#include "sim/sii_firmware.hpp"
#include "wire/sii.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

namespace margay::files {

using namespace std::chrono_literals;

inline std::string words(const Error& error) {
    std::array<char, 400> text{};
    return std::string(describe(error, text));
}

// A segment of simulated devices and a master, as after power-up.
struct Machine {
    explicit Machine(const std::vector<std::string>& devices, const Limits& limits = {}) : ctx(limits) {
        std::vector<sim::Device> made;
        for (const std::string& name : devices) made.push_back(std::move(*make(name)));
        connect(std::move(made));
    }
    Machine() : ctx(Limits{}) {}  // the test calls connect()
    void connect(std::vector<sim::Device> devices) {
        for (sim::Device& device : devices) {
            const auto n = segment.add(std::move(device).assemble());
            n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0});
        }
        segment.power_up(osal.now());
        EXPECT_TRUE(init(ctx, nic, osal));
    }
    // "drive@7": a drive with the alias 7. "io#7": a device with 8 inputs, 8 outputs and the device id 7.
    static std::optional<sim::Device> make(const std::string& name) {
        namespace sii = wire::sii;
        if (const auto at = name.find('#'); at != std::string::npos) {
            auto device = sim::device_from_sii(io_image(8, 8, {.flags = sii::general_flag::kIdentAlStatus}));
            static_cast<sim::SiiFirmware&>(*device.firmware)
                .set_device_id(static_cast<std::uint16_t>(std::stoi(name.substr(at + 1))));
            return device;
        }
        const auto at = name.find('@');
        auto device = sim::make_device(name.substr(0, at));
        if (at != std::string::npos) {
            using Layout = sii::ConfigurationLayout;
            Layout::alias::store(device->sii, static_cast<std::uint16_t>(std::stoi(name.substr(at + 1))));
            Layout::checksum::store(device->sii, sii::checksum(device->sii));
        }
        return device;
    }
    // Station address, watchdogs, FMMUs, SyncManagers, SYNC.
    [[nodiscard]] std::vector<std::byte> registers(std::uint32_t n) {
        std::vector<std::byte> all;
        const auto add = [&](std::uint16_t address, std::size_t octets) {
            const auto some = segment.slave(n).peek(address, static_cast<std::uint16_t>(octets));
            all.insert(all.end(), some.begin(), some.end());
        };
        add(0x0010, 2);
        add(0x0400, 2);
        add(0x0410, 2);
        add(0x0420, 2);
        add(0x0600, 0x80);
        for (std::uint16_t sm = 0; sm < 8; ++sm) {
            add(static_cast<std::uint16_t>(0x0800 + 8 * sm), 5);  // start, length, control
            add(static_cast<std::uint16_t>(0x0806 + 8 * sm), 1);  // activate
        }
        add(0x0980, 2);
        add(0x09A0, 8);
        return all;
    }
    // With clocks the frames pass half a cycle before SYNC0.
    [[nodiscard]] bool to_op(Duration cycle) {
        MasterClock clock({.set_value = -cycle / 2, .phase = {.cycle = cycle}});
        const auto op =
            reach(ctx, AlState::op, 10s, {.period = cycle, .clock = reference_clock(ctx) != 0 ? &clock : nullptr});
        EXPECT_TRUE(op) << words(op.error());
        return op.ok();
    }

    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic nic{segment, osal};
    HostContext ctx;
    std::vector<std::byte> image = std::vector<std::byte>(4096);
};

}  // namespace margay::files
