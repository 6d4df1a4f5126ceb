// Divides a process image into datagrams and frames. Pure functions; no bus access.
#pragma once

#include "network/image_layout.hpp"
#include "wire/datagram.hpp"

#include <margay/group.hpp>
#include <margay/result.hpp>

#include <array>
#include <span>

namespace margay {

struct DatagramPlan {
    wire::Command command = wire::Command::NOP;
    std::uint16_t frame = 0;  // index of the frame in the group; several datagrams may share a frame
    LogicalAddress address;
    std::uint16_t bytes = 0;
    std::uint16_t expected_wkc = 0;
    // Parts of the image: output_bytes from image_output are sent from the first octet of the datagram's data on;
    // input_bytes from octet input_at of the data on are copied to image_input.
    std::uint32_t image_output = 0;
    std::uint32_t image_input = 0;
    std::uint16_t output_bytes = 0;
    std::uint16_t input_bytes = 0;
    std::uint16_t input_at = 0;

    friend constexpr bool operator==(const DatagramPlan&, const DatagramPlan&) = default;
};

// Divides the image into datagrams: LRW; or LWR and LRD when the group or one of its slaves requires that, or when
// there is only one direction. The number of frames is the lowest possible; if several divisions have this number, the
// data of a slave is kept in one frame. The expected working counter of each datagram follows from the slaves' FMMUs: 1
// for a slave that the datagram reads from, and 1 (LWR) or 2 (LRW) for a slave that it writes to. Returns the number of
// datagrams. The first frame keeps room for the readings that are wanted. Errors: too_many_frames when `into` is too
// small, invalid_argument (detail: Argument::reserve_bytes or dc_reference), unknown_slave (the reference clock), and
// the errors of make_fmmus().
[[nodiscard]] Result<std::size_t> plan_datagrams(std::span<const Slave> slaves, std::uint8_t group,
                                                 const GroupConfiguration& wanted, const ImageLayout& layout,
                                                 std::span<DatagramPlan> into);

// A register that is read with each cycle, in the group's first frame behind the planned datagrams.
struct ReadingPlan {
    wire::Command command = wire::Command::NOP;
    wire::DatagramAddress address;
    std::uint16_t bytes = 0;
    RegisterReading Group::*into = nullptr;
};
struct ReadingPlans {
    static constexpr std::size_t kMost = 2;
    std::array<ReadingPlan, kMost> at{};
    std::size_t count = 0;
    [[nodiscard]] std::span<const ReadingPlan> all() const { return std::span(at).first(count); }
};

// Command and address of the datagram that reads the time of a slave, and writes it to the slaves behind.
struct TimeSource {
    wire::Command command = wire::Command::NOP;
    std::uint16_t address = 0;  // station address (FRMW), or negative position (ARMW)

    friend constexpr bool operator==(const TimeSource&, const TimeSource&) = default;
};
[[nodiscard]] TimeSource by_station(const Slave& reference);
// `by_position`: ClockSettings::by_position. While a slave is lost, the positions may be other ones: then the address
// is the station address nevertheless.
[[nodiscard]] TimeSource time_source_of(std::span<const Slave> slaves, const Slave& reference, bool by_position);

[[nodiscard]] ReadingPlans plan_readings(std::span<const Slave> slaves, const GroupConfiguration& wanted,
                                         bool by_position = false);

// The contribution of one slave to the working counter of a datagram.
[[nodiscard]] std::uint16_t working_counter_of(const SlaveFmmus& fmmus, const DatagramPlan& datagram);

}  // namespace margay
