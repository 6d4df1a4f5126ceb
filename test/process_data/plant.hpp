// A segment of any topology with its master. A test can connect slaves elsewhere during operation.
#pragma once

#include "process_data/bus.hpp"
#include "sim/sii_firmware.hpp"

namespace margay {

struct Plant : Bus {
    std::vector<std::byte> image = std::vector<std::byte>(1024);
    SuperviseRequest supervision;
    Limits limits{.slaves = 32};

    // Makes a slave with 8 bits in each direction that is not connected yet. Returns its number in the segment, from 0.
    std::uint32_t make(const IoDevice& of) {
        auto made = sim::device_from_sii(io_image(8, 8, of));
        made.chip = sim::junction();
        return segment.add(std::move(made).assemble());
    }
    sim::SiiFirmware& program(std::uint32_t number) {
        return static_cast<sim::SiiFirmware&>(*segment.slave(number).firmware());
    }
    void plug(sim::PortRef at, std::uint32_t number) { ASSERT_TRUE(segment.connect(at, {number, 0})); }
    void pull(std::uint32_t number) { segment.disconnect({number, 0}); }
    void power(std::uint32_t number, bool on) { segment.set_power(number, on, osal.now()); }

    // Scans, and returns the texts of all errors.
    std::vector<std::string> bring_up(std::span<const ExpectedSlave> expected) {
        if (!nic) {
            segment.power_up(osal.now());
            nic = std::make_unique<SimulatedNic>(segment, osal);
            ctx = std::make_unique<HostContext>(limits);
            EXPECT_TRUE(init(*ctx, *nic, osal).ok());
        }
        EXPECT_TRUE(expect(*ctx, expected).ok());
        const auto found = config_init(*ctx);
        EXPECT_TRUE(found.ok() || found.error().slave != 0);  // an error of one slave: the other slaves were found
        return errors();
    }
    // Maps the group. Then the supervision brings all slaves to OP.
    void run() {
        (void)config_map(*ctx, image);
        ASSERT_TRUE(ctx->group(0).mapped);
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        ASSERT_TRUE(until([&] { return all_in_op(); })) << joined(events());
        (void)events();
    }
    bool in_op(std::size_t n) {
        return ctx->slave(n).al == AlStatus{AlState::op, false, 0} && ctx->slave(n).takes_part;
    }
    bool all_in_op() {
        for (std::size_t n = 1; n <= ctx->slaves().size(); ++n)
            if (ctx->slave(n).ring_position != 0 && !in_op(n)) return false;
        return true;
    }
    template <class Holds>
    bool until(Holds holds, int most = 3000) {
        for (int n = 0; n < most; ++n) {
            (void)cycle();
            if (holds()) return true;
        }
        return false;
    }
    void cycles(int count) {
        for (int n = 0; n < count; ++n) (void)cycle();
    }
    std::vector<std::string> events() {
        std::vector<std::string> all;
        while (const auto event = ctx->events().take()) {
            std::array<char, 256> text{};
            all.emplace_back(describe(*event, text));
        }
        return all;
    }
    static std::string joined(const std::vector<std::string>& all) {
        std::string text;
        for (const auto& one : all) text += one + "\n";
        return text;
    }
    static std::ptrdiff_t told(const std::vector<std::string>& all, const std::string& text) {
        return std::ranges::count_if(all, [&](const std::string& one) { return one.find(text) != std::string::npos; });
    }
    // Checks that the input of slave n is the value that device `number` provides, and that the output for slave n
    // arrives at this device.
    void expect_exchanged(std::size_t n, std::uint32_t number) {
        const Slave& slave = ctx->slave(n);
        ASSERT_EQ(slave.image.inputs.bytes.size(), 1U) << n;
        const auto value = static_cast<std::byte>(0x40 + number);
        program(number).inputs()[0] = value;
        program(number).poke();
        slave.image.outputs.bytes[0] = static_cast<std::byte>(0x80 + number);
        cycles(3);
        EXPECT_EQ(slave.image.inputs.bytes[0], value) << "slave " << n;
        EXPECT_EQ(program(number).outputs()[0], static_cast<std::byte>(0x80 + number)) << "slave " << n;
    }
};

}  // namespace margay
