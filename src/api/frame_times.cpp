// Functions that use the times of the frames of the cycle.
#include "api/master.hpp"

#include <margay/cycle_stamps.hpp>
#include <margay/margay.hpp>
#include <margay/receive_clock.hpp>
#include <margay/timed_send.hpp>

#include <algorithm>
#include <array>

namespace margay {
namespace {

using Head = std::array<std::byte, ReceiveClock::kHeadBytes>;

// The reply has the mark of the first ESC, unless the slaves do not set it.
std::optional<std::uint64_t> received_at(ReceiveClock& clock, Head head) {
    head[wire::kSourceMacOffset] |= wire::kPassedEscBit;
    if (const auto marked = clock.receive_time_ns(head)) return marked;
    head[wire::kSourceMacOffset] &= ~wire::kPassedEscBit;
    return clock.receive_time_ns(head);
}

// The index of a frame returns after 256 frames. A NIC whose cable is out, or that has lost the time of this frame,
// then shows the time of an earlier frame. `passed`: since the frame was sent.
void drop_old_time(CycleStamps& stamps, Duration passed) {
    constexpr Duration kInaccuracy = std::chrono::milliseconds(1);
    const auto trip = stamps.round_trip();
    if (trip && *trip < -kInaccuracy) stamps.received_ns = std::nullopt;
    if (trip && *trip > passed + passed / 500 + kInaccuracy) stamps.sent_ns = std::nullopt;
}

}  // namespace

Result<> send_processdata_at(Context& ctx, TimedSend& nic, Time at, std::uint8_t group) {
    Master* master = master_of(ctx);
    if (master != nullptr && !master->owned_by_caller())
        return Error{.code = Errc::not_owner, .step = Step::exchange_process_data};
    const Time begun = master != nullptr ? master->osal.now() : at;
    nic.set_send_time(at);
    const auto sent = send_processdata(ctx, std::max(at, begun), group);
    nic.set_send_time(TimedSend::kAtOnce);
    return sent;
}

CycleStamps cycle_stamps(Context& ctx, const FrameTiming& nic, std::size_t frame, std::uint8_t group) {
    Master* master = master_of(ctx);
    if (master == nullptr || !master->owned_by_caller() || group >= master->network.process.groups.size()) return {};
    const ProcessGroup& asked = master->network.process.groups[group];
    if (!asked.mapped || asked.overlap.sets > 1 || frame >= asked.prepared.size()) return {};
    const PreparedFrame& of_cycle = asked.prepared[frame];
    if (of_cycle.end == CycleEnd::missing) return {};
    Head head;
    std::copy_n(of_cycle.bytes.begin(), head.size(), head.begin());
    CycleStamps stamps;
    if (nic.sent != nullptr) stamps.sent_ns = nic.sent->send_time_ns(head);
    if (nic.received != nullptr) stamps.received_ns = received_at(*nic.received, head);
    drop_old_time(stamps, master->osal.now() - asked.pace.last);
    return stamps;
}

}  // namespace margay
