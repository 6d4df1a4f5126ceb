// The datagrams that carry a process image, and in which frames they travel. Pure functions; no bus.
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
    std::uint16_t frame = 0;  // which of the group's frames, from 0; several datagrams may share one
    LogicalAddress address;
    std::uint16_t bytes = 0;
    std::uint16_t expected_wkc = 0;
    // What of the image goes out (from the first octet of the datagram's data on) and what comes in (from octet
    // input_at on).
    std::uint32_t image_output = 0;
    std::uint32_t image_input = 0;
    std::uint16_t output_bytes = 0;
    std::uint16_t input_bytes = 0;
    std::uint16_t input_at = 0;

    friend constexpr bool operator==(const DatagramPlan&, const DatagramPlan&) = default;
};

// Cuts the image into datagrams: LRW, or LWR and LRD when the group or one of its slaves wants that or when there is
// only one direction. Frames are as few as can be; among the ways to get by with so few, the data of a slave is kept in
// one frame. Each datagram's expected working counter is that of the slaves' FMMUs: 1 for a slave it reads from, 1
// (LWR) or 2 (LRW) for one it writes to. Returns how many there are. The first frame has room for the readings that are
// wanted. Errors: too_many_frames when `into` is too small, invalid_argument (what shall be kept free leaves nothing;
// the reference clock has none; cycles_in_flight out of range), unknown_slave (the reference clock), and those of
// make_fmmus().
[[nodiscard]] Result<std::size_t> plan_datagrams(std::span<const Slave> slaves, std::uint8_t group,
                                                 const GroupConfiguration& wanted, const ImageLayout& layout,
                                                 std::span<DatagramPlan> into);

// Registers that are read with each cycle, in the group's first frame behind what is planned for it.
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
[[nodiscard]] ReadingPlans plan_readings(std::span<const Slave> slaves, const GroupConfiguration& wanted);

// What one slave adds to the working counter of a datagram.
[[nodiscard]] std::uint16_t working_counter_of(const SlaveFmmus& fmmus, const DatagramPlan& datagram);

}  // namespace margay
