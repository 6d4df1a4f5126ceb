// Devices for the tests of entries, with chosen SyncManagers and PDOs that only their SII describes.
#pragma once

#include "process_data/bus.hpp"
#include "wire/sii_writer.hpp"

namespace margay {

struct EntryDevice {
    std::vector<wire::sii::PdoDescription> rx{};
    std::vector<wire::sii::PdoDescription> tx{};
    std::uint8_t output_sms = 1;  // the first SyncManagers are outputs, the other SyncManagers are inputs
    std::uint8_t input_sms = 1;
};

// Appends a device to the line.
inline void add_device(Bus& bus, const EntryDevice& device) {
    std::vector<SmInfo> sms;
    for (unsigned n = 0; n < unsigned{device.output_sms} + device.input_sms; ++n) {
        const bool out = n < device.output_sms;
        sms.push_back({static_cast<std::uint16_t>(0x1100 + 0x200 * n), 0, static_cast<std::uint8_t>(out ? 0x64 : 0x20),
                       1, out ? SmType::outputs : SmType::inputs});
    }
    std::vector<std::byte> image(2048);
    const auto written = wire::sii::write_image({.configuration = {.pdi_control = 0x0005},
                                                 .identity = {.vendor = 0x00004D47, .product = 0x0200},
                                                 .name = "MG entries",
                                                 .sync_managers = sms,
                                                 .tx_pdos = device.tx,
                                                 .rx_pdos = device.rx},
                                                image);
    ASSERT_TRUE(written.ok());
    auto made = sim::device_from_sii(std::move(image));
    made.chip = sim::lan9252();
    made.chip.ram_kib = 16;
    made.chip.fmmus = 8;
    made.chip.sync_managers = 8;
    const auto n = bus.segment.add(std::move(made).assemble());
    EXPECT_TRUE(n == 0 ? bus.segment.connect_master({0, 0}) : bus.segment.connect({n - 1, 1}, {n, 0}));
}

// Reads and writes single bits, for comparison in tests.
inline std::uint64_t bits_at(std::span<const std::byte> octets, std::size_t first, unsigned bits) {
    std::uint64_t value = 0;
    for (unsigned n = 0; n < bits; ++n) {
        const std::size_t bit = first + n;
        value |= std::uint64_t{(std::to_integer<unsigned>(octets[bit / 8]) >> (bit % 8)) & 1U} << n;
    }
    return value;
}
inline void set_bits(std::span<std::byte> octets, std::size_t first, unsigned bits, std::uint64_t value) {
    for (unsigned n = 0; n < bits; ++n) {
        const std::size_t bit = first + n;
        const auto mask = static_cast<std::byte>(1U << (bit % 8));
        octets[bit / 8] = (value >> n & 1U) != 0 ? octets[bit / 8] | mask : octets[bit / 8] & ~mask;
    }
}

}  // namespace margay
