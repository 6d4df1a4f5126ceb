// The common parts of the tables of the library's devices: a processor with CoE mailboxes and process data in both
// directions, the objects of every device, and the table line that gives make_device() the name.
#pragma once

#include "sim/library/library.hpp"

namespace margay::sim {

// The individual properties of one device. Its mailboxes are located one after the other from 0x1000 on, each with
// space for twice its size; the outputs and inputs follow.
struct IoDevice {
    std::uint32_t product_code = 0;
    std::string_view name{};
    std::string_view order_code{};
    std::string_view group{};
    std::uint16_t output_bytes = 0;
    std::uint16_t input_bytes = 0;
    std::uint16_t mailbox_bytes = 128;
    std::uint16_t mailbox_room = 256;
    std::uint16_t least_mailbox = 34;
};

[[nodiscard]] constexpr subdevice::DeviceDescription io_device(const IoDevice& device) {
    const auto area = [&](unsigned n) { return static_cast<std::uint16_t>(0x1000 + n * device.mailbox_room); };
    return {.vendor_id = kVendorId,
            .product_code = device.product_code,
            .revision = 1,
            .name = device.name,
            .order_code = device.order_code,
            .group = device.group,
            .protocols = {.coe = true},
            .mailbox = {{area(0), device.mailbox_bytes, device.least_mailbox, device.mailbox_room},
                        {area(1), device.mailbox_bytes, device.least_mailbox, device.mailbox_room}},
            .outputs = {.sync_manager = 2, .start = area(2), .max_bytes = device.output_bytes, .watchdog = true},
            .inputs = {.sync_manager = 3, .start = area(3), .max_bytes = device.input_bytes},
            .dc = {.supported = true},
            .free_run_cycle = std::chrono::milliseconds(1)};
}

// The objects of the device itself, combined with the objects of every device, ascending by index.
template <class Common, std::size_t N>
[[nodiscard]] constexpr std::array<subdevice::Object, N + 8> with_common(const std::array<subdevice::Object, N>& own) {
    return subdevice::joined(
        own, std::array{Common::device_type, Common::error_history, Common::device_name, Common::hardware,
                        Common::software, Common::identity, Common::diagnosis, Common::sync_manager_types});
}
template <class Common, std::size_t N>
[[nodiscard]] constexpr std::array<subdevice::Object, N + 8> with_common(const subdevice::Object (&own)[N]) {
    return with_common<Common>(std::to_array(own));
}

// The PDO assignments of a device with one fixed PDO in each direction.
inline constexpr std::array kOneRxPdo{subdevice::entry_count(1), subdevice::assigned(1, 0x1600)};
inline constexpr std::array kOneTxPdo{subdevice::entry_count(1), subdevice::assigned(1, 0x1A00)};

// A device with an FPGA as ESC, SPI, and SYNC and latch units.
template <class M>
[[nodiscard]] constexpr Blueprint blueprint(std::string_view name, const subdevice::DeviceDescription& device,
                                            std::span<const subdevice::Object> objects, std::size_t image_bytes,
                                            subdevice::BoardDescription board = {.pdi_control = kSpiWithDc}) {
    return {.name = name,
            .chip = ip_core,
            .device = &device,
            .board = board,
            .objects = objects,
            .image_bytes = image_bytes,
            .make = [] { return std::unique_ptr<Model>(std::make_unique<M>()); }};
}

}  // namespace margay::sim
