// A line of three slaves whose devices are exchanged for other devices.
#pragma once

#include "process_data/plant.hpp"

namespace margay {

using namespace std::chrono_literals;

inline std::string in_words(const Error& error) {
    std::array<char, 400> buffer{};
    return std::string(describe(error, buffer));
}

// A line of three slaves (products 0x100 to 0x102), and devices that are not connected: a tool of product 0x200, and a
// device of the kind of slave 2.
struct Identities : testing::Test, Plant {
    std::vector<std::uint32_t> line;
    std::uint32_t tool = 0;
    std::uint32_t twin = 0;
    bool nameless = false;  // slave 2 has no identity
    bool listed = true;     // expect() has a list
    std::vector<ExpectedSlave> wanted{
        {.number = 1, .product = 0x100}, {.number = 2, .product = 0x101}, {.number = 3, .product = 0x102}};

    void SetUp() override { build(); }
    void build() {
        wanted.reserve(8);  // the context uses the list until the next list, so the list must not move
        for (unsigned n = 0; n < 3; ++n)
            line.push_back(n == 1 && nameless ? make_nameless() : make({.product = 0x100 + n}));
        tool = make({.product = 0x200, .alias = 7});
        twin = make({.product = 0x101, .alias = 8});
        ASSERT_TRUE(segment.connect_master({line[0], 0}));
        ASSERT_TRUE(segment.connect({line[0], 1}, {line[1], 0}));
        ASSERT_TRUE(segment.connect({line[1], 1}, {line[2], 0}));
        EXPECT_EQ(bring_up(listed ? std::span<const ExpectedSlave>(wanted) : std::span<const ExpectedSlave>()),
                  std::vector<std::string>());
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(reach(*ctx, AlState::op, 5s).ok());
    }
    // Vendor, product, revision and serial number in the SII of this device are 0.
    std::uint32_t make_nameless() {
        auto image_of_sii = io_image(8, 8, {.product = 0});
        std::fill_n(image_of_sii.begin() + 16, 16, std::byte{0});
        auto made = sim::device_from_sii(image_of_sii);
        made.chip = sim::junction();
        return segment.add(std::move(made).assemble());
    }
    // Sets a register to a value that another master, or an earlier run of this master, has written.
    void set(std::uint32_t device, std::uint16_t reg, std::uint16_t value) {
        const std::array octets{static_cast<std::byte>(value & 0xFF), static_cast<std::byte>(value >> 8)};
        (void)segment.slave(device).ecat_write(reg, octets, osal.now());
        sim::FrameEnd end{};
        end.at = osal.now();
        segment.slave(device).frame_end(end);
    }
    std::uint32_t make_of_revision(std::uint32_t product, std::uint32_t revision) {
        auto octets = io_image(8, 8, {.product = product});
        store_le(octets, 0x18, revision);
        auto made = sim::device_from_sii(octets);
        made.chip = sim::junction();
        return segment.add(std::move(made).assemble());
    }
    // Gives the devices time to process the values of set().
    void settle_devices() {
        for (int n = 0; n < 20; ++n) {
            osal.advance(1ms);
            segment.reconsider();
            segment.advance(osal.now());
        }
    }
    // Makes the FMMUs, SyncManagers, station address and state of the device equal to those of slave 2, as an earlier
    // run of a program could have configured the device in this place.
    void make_like_slave_2(std::uint32_t device, AlState state) { make_like_slave_2(device, state, mapping_of(2)); }
    struct Mapping {
        std::array<std::byte, 0x30> fmmus{};
        std::array<std::byte, 0x20> sync_managers{};
    };
    [[nodiscard]] Mapping mapping_of(std::size_t slave) {
        Mapping mapping;
        std::ranges::copy(segment.slave(line[slave - 1]).peek(0x0600, 0x30), mapping.fmmus.begin());
        std::ranges::copy(segment.slave(line[slave - 1]).peek(0x0800, 0x20), mapping.sync_managers.begin());
        return mapping;
    }
    void make_like_slave_2(std::uint32_t device, AlState state, const Mapping& mapping) {
        auto& there = segment.slave(device);
        (void)there.ecat_write(0x0600, mapping.fmmus, osal.now());
        for (std::uint16_t sm = 0; sm < 0x20; sm += 8)
            (void)there.ecat_write(static_cast<std::uint16_t>(0x0800 + sm),
                                   std::span(mapping.sync_managers).subspan(sm, 8), osal.now());
        set(device, 0x0010, 0x1002);
        for (const AlState next : {AlState::preop, AlState::safeop, AlState::op}) {
            if (next > state) break;
            set(device, 0x0120, static_cast<std::uint16_t>(next));
            for (int n = 0; n < 3; ++n) settle_devices();
        }
        ASSERT_GE(state_of(device), static_cast<int>(std::min(state, AlState::safeop)));
    }
    [[nodiscard]] int state_of(std::uint32_t device) {
        return std::to_integer<int>(segment.slave(device).peek(0x0130, 1)[0]) & 0xF;
    }
    void take_out(std::uint32_t device) {
        segment.disconnect({device, 0});
        segment.disconnect({device, 1});
    }
    void take_out_slave_2() { take_out(line[1]); }
    void put_in(std::uint32_t device) {
        ASSERT_TRUE(segment.connect({line[0], 1}, {device, 0}));
        ASSERT_TRUE(segment.connect({device, 1}, {line[2], 0}));
    }
    void write_outputs() {
        for (const Slave& slave : ctx->slaves())
            std::ranges::fill(slave.image.outputs.bytes, static_cast<std::byte>(0xA0 + slave.number));
    }
    [[nodiscard]] bool gets_outputs(std::uint32_t device) {
        for (int n = 0; n < 50; ++n) {
            write_outputs();
            (void)cycle();
        }
        const auto outputs = program(device).outputs();
        return !outputs.empty() && outputs[0] != std::byte{0};
    }
    void expect_no_outputs(std::uint32_t device) {
        for (int n = 0; n < 1'500; ++n) {
            write_outputs();
            (void)cycle();
            const auto outputs = program(device).outputs();
            ASSERT_TRUE(outputs.empty() || outputs[0] == std::byte{0}) << n;
        }
        EXPECT_FALSE(all_right(*ctx));
    }
};

}  // namespace margay
