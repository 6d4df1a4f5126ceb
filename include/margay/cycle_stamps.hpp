// The times at which the NIC has sent a frame of the last cycle and has received the reply: the round trip on the wire,
// without the time that the program and the kernel need.
//
//     nic.stamp_frames(PacketNic::Stamps::hardware, PacketNic::Stamped::both);
//     …
//     receive_processdata(ctx, 500us);
//     const CycleStamps stamps = cycle_stamps(ctx, nic.timing());
//     if (const auto trip = stamps.round_trip()) …;
#pragma once

#include <margay/context.hpp>
#include <margay/frame_timing.hpp>
#include <margay/time.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>

namespace margay {

struct CycleStamps {
    // In ns of the clock of the NIC; nothing: the NIC has no time for the frame, or not yet.
    std::optional<std::uint64_t> sent_ns;
    std::optional<std::uint64_t> received_ns;

    [[nodiscard]] std::optional<Duration> round_trip() const {
        if (!sent_ns || !received_ns) return std::nullopt;
        return Duration(static_cast<std::int64_t>(*received_ns - *sent_ns));
    }
};

// Call it after receive_processdata(), before the next cycle is sent. `nic`: Nic::timing() of the NIC that sends the
// cycle. `frame`: of the frames of the group, from 0. Returns no time when the frame has not come back, when `nic` has
// no clocks, when the group or the frame does not exist, when cycles of the group overlap
// (GroupConfiguration::cycles_in_flight), or when the calling thread does not own the context. In a ring with two NICs
// the function finds only the copy that the first NIC has sent; `nic` may have `sent` of one NIC and `received` of the
// other. A time that contradicts the other one is of an earlier frame with the same index, and is left out; without
// `sent`, this cannot be seen. Callable from the cycle; never waits. It costs one system call with PacketNic, and none
// with a NIC without clocks.
[[nodiscard]] CycleStamps cycle_stamps(Context& ctx, const FrameTiming& nic, std::size_t frame = 0,
                                       std::uint8_t group = 0);

}  // namespace margay
