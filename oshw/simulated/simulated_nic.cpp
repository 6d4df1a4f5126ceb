#include "oshw/simulated/simulated_nic.hpp"

#include "wire/ethernet.hpp"

#include <algorithm>

namespace margay {

SimulatedNic::SimulatedNic(sim::Segment& segment, Osal& osal, const Options& options)
    : segment_(segment),
      osal_(osal),
      options_(options),
      slots_(std::max<std::size_t>(options.queue_frames, 1)),
      held_(options.timed_frames),
      timed_(held_) {}

FrameTiming SimulatedNic::timing() noexcept {
    FrameTiming has;
    if (options_.time_stamps) has.sent = this;
    if (options_.time_stamps) has.received = this;
    if (options_.timed_frames != 0) has.send_at = this;
    return has;
}

SendStatus SimulatedNic::send(std::span<const std::byte> frame) noexcept {
    if (frame.size() < wire::kEthernetHeaderBytes || frame.size() > kMaxBytes) return SendStatus::failed;
    const Time now = osal_.now();
    transmit_due(now);
    if (full() || (other_ != nullptr && other_->full())) return SendStatus::busy;
    if (!segment_.master_link(options_.master_port)) {
        if (options_.time_stamps) send_times_.add(frame, std::nullopt);
        return SendStatus::failed;
    }
    if (send_time_ > now && options_.timed_frames != 0)
        return timed_.put(send_time_, frame) ? SendStatus::sent : SendStatus::busy;
    if (send_time_ != now && send_time_ != kAtOnce) ++missed_;
    std::copy(frame.begin(), frame.end(), frame_.begin());
    transmit(frame.size(), now);
    return SendStatus::sent;
}

// Sends the frame in `frame_`.
void SimulatedNic::transmit(std::size_t length, Time at) noexcept {
    const auto bytes = MutableBytes(frame_).first(length);
    const Duration on_wire(options_.wire_time ? wire::bytes_on_the_wire(length) * 80 : 0);
    const Time start = options_.wire_time ? std::max(at, wire_free_) : at;
    wire_free_ = start + on_wire;
    ++sent_;
    if (options_.time_stamps) send_times_.add(bytes, clock_ns(start));
    const auto passage = segment_.process(bytes, start, options_.master_port, on_wire);
    if (!passage.returned) {
        ++lost_;
        return;
    }
    auto* to = passage.master_port == options_.master_port ? this : other_;
    if (to != nullptr) to->put(passage.at, on_wire + options_.round_trip, bytes);
}

// Sends the due frames of both ends in the order of their times.
void SimulatedNic::transmit_due(Time now) noexcept {
    for (;;) {
        const bool by_other = other_ != nullptr && other_->timed_.next_due() < timed_.next_due();
        SimulatedNic& nic = by_other ? *other_ : *this;
        const Time due = nic.timed_.next_due();
        if (due > now) return;
        nic.transmit(nic.timed_.take(now, nic.frame_), due);
    }
}

std::uint64_t SimulatedNic::clock_ns(Time at) const noexcept {
    constexpr std::int64_t kThousandMillion = 1'000'000'000;
    const std::int64_t passed = at.time_since_epoch().count();
    const std::int64_t drift = passed / kThousandMillion * options_.clock_drift_ppb +
                               passed % kThousandMillion * options_.clock_drift_ppb / kThousandMillion;
    return options_.clock_start_ns + static_cast<std::uint64_t>(passed + drift);
}

// The due time never decreases, because a cable does not reorder frames.
void SimulatedNic::put(Time arrived, Duration later, std::span<const std::byte> frame) noexcept {
    if (full()) return;
    auto& slot = slots_[(first_ + count_++) % slots_.size()];
    last_due_ = slot.due = std::max(arrived + later, last_due_);
    slot.arrived_ns = clock_ns(arrived);
    slot.length = frame.size();
    std::copy(frame.begin(), frame.end(), slot.bytes.begin());
}

std::size_t SimulatedNic::receive(std::span<std::byte> into) noexcept {
    const Time now = osal_.now();
    transmit_due(now);
    if (count_ == 0 || slots_[first_].due > now) return 0;
    const auto& slot = slots_[first_];
    const auto length = std::min(slot.length, into.size());
    std::copy_n(slot.bytes.begin(), length, into.begin());
    if (options_.time_stamps) receive_times_.add(into.first(length), slot.arrived_ns);
    first_ = (first_ + 1) % slots_.size();
    --count_;
    return length;
}

LinkState SimulatedNic::link_state() noexcept {
    return segment_.master_link(options_.master_port) ? LinkState::up : LinkState::down;
}

Time SimulatedNic::next_arrival() const noexcept {
    return std::min(timed_.next_due(), count_ == 0 ? kNever : slots_[first_].due);
}

}  // namespace margay
