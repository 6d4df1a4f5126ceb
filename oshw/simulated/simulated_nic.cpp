#include "oshw/simulated/simulated_nic.hpp"

#include "wire/ethernet.hpp"

#include <algorithm>

namespace margay {

SimulatedNic::SimulatedNic(sim::Segment& segment, Osal& osal, const Options& options)
    : segment_(segment), osal_(osal), options_(options), slots_(std::max<std::size_t>(options.queue_frames, 1)) {}

SendStatus SimulatedNic::send(std::span<const std::byte> frame) noexcept {
    if (frame.size() < wire::kEthernetHeaderBytes || frame.size() > kMaxBytes) return SendStatus::failed;
    if (full() || (other_ != nullptr && other_->full())) return SendStatus::busy;
    if (!segment_.master_link(options_.master_port)) return SendStatus::failed;
    const Time now = osal_.now();
    const Duration on_wire(options_.wire_time ? wire::bytes_on_the_wire(frame.size()) * 80 : 0);
    const Time start = options_.wire_time ? std::max(now, wire_free_) : now;
    wire_free_ = start + on_wire;
    std::copy(frame.begin(), frame.end(), frame_.begin());
    const auto bytes = MutableBytes(frame_).first(frame.size());
    ++sent_;
    if (options_.time_stamps) send_times_.add(bytes, clock_ns(start));
    const auto passage = segment_.process(bytes, start, options_.master_port, on_wire);
    if (!passage.returned) {
        ++lost_;
        return SendStatus::sent;
    }
    auto* to = passage.master_port == options_.master_port ? this : other_;
    if (to != nullptr) to->put(passage.at + on_wire + options_.round_trip, bytes);
    return SendStatus::sent;
}

std::uint64_t SimulatedNic::clock_ns(Time at) const noexcept {
    constexpr std::int64_t kThousandMillion = 1'000'000'000;
    const std::int64_t passed = at.time_since_epoch().count();
    const std::int64_t drift = passed / kThousandMillion * options_.clock_drift_ppb +
                               passed % kThousandMillion * options_.clock_drift_ppb / kThousandMillion;
    return options_.clock_start_ns + static_cast<std::uint64_t>(passed + drift);
}

// The due time never decreases, because a cable does not reorder frames.
void SimulatedNic::put(Time due, std::span<const std::byte> frame) noexcept {
    if (full()) return;
    auto& slot = slots_[(first_ + count_++) % slots_.size()];
    last_due_ = slot.due = std::max(due, last_due_);
    slot.length = frame.size();
    std::copy(frame.begin(), frame.end(), slot.bytes.begin());
}

std::size_t SimulatedNic::receive(std::span<std::byte> into) noexcept {
    if (count_ == 0 || slots_[first_].due > osal_.now()) return 0;
    const auto& slot = slots_[first_];
    const auto length = std::min(slot.length, into.size());
    std::copy_n(slot.bytes.begin(), length, into.begin());
    first_ = (first_ + 1) % slots_.size();
    --count_;
    return length;
}

LinkState SimulatedNic::link_state() noexcept {
    return segment_.master_link(options_.master_port) ? LinkState::up : LinkState::down;
}

Time SimulatedNic::next_arrival() const noexcept { return count_ == 0 ? kNever : slots_[first_].due; }

}  // namespace margay
