// Frames without commands, which show whether the frames of a NIC come back.
#include "link/redundancy.hpp"

namespace margay {
namespace {

// No frame of the link begins with a NOP of this address.
constexpr wire::DatagramAddress kProbe(0x5052'4F42);

}  // namespace

SendStatus Redundancy::send_probe(unsigned nic) noexcept {
    constexpr std::size_t kShortest = 60;
    std::array<std::byte, kShortest> probe{};
    wire::FrameBuilder builder(probe, source_[nic]);
    // Each probe of both NICs has another index, so that a recording shows which of the probes came back.
    const auto index = static_cast<std::uint8_t>(counters_[nic].sent.load(std::memory_order_relaxed) << 1U | nic);
    (void)builder.append(wire::Command::NOP, index, kProbe, 2);
    (void)builder.finish();
    const SendStatus status = nics_[nic]->send(probe);
    if (status == SendStatus::sent) counters_[nic].sent.fetch_add(1, std::memory_order_relaxed);
    return status;
}

// Sends probes behind the copy of the frame.
void Redundancy::send_probes(FramePair& pair, unsigned nic) noexcept {
    if ((pair.sent.load(std::memory_order_relaxed) & (1U << nic)) == 0) return;
    hearing_[nic].store(Hearing::heard, std::memory_order_relaxed);
    unsigned sent = 0;
    while (sent < kProbes && send_probe(nic) == SendStatus::sent) ++sent;
    pair.sent.fetch_or(static_cast<std::uint8_t>(sent << probes_bit(nic)), std::memory_order_release);
}

bool Redundancy::is_probe(Bytes frame) noexcept {
    const auto first = wire::load_datagram_header(frame.subspan(wire::kFramePrefixBytes));
    return first.command == wire::Command::NOP && first.address == kProbe;
}

// The copy of the NIC was lost, and the copy of the other NIC came back. The lost copy says nothing about the present
// if a frame of the NIC has come back since the copy was sent. Otherwise the probes behind the copy were lost too.
void Redundancy::note_miss(const FramePair& pair, unsigned nic) noexcept {
    constexpr unsigned kCount = 7;
    if (pair.arrivals[nic] != arrivals_[nic].load(std::memory_order_relaxed)) return;
    missed_[nic] += 1 + ((pair.sent.load(std::memory_order_relaxed) >> probes_bit(nic)) & kCount);
    const bool silent = missed_[nic] >= kMissesUntilSilent;
    hearing_[nic].store(silent ? Hearing::silent : Hearing::doubted, std::memory_order_relaxed);
}

// A probe that comes back at its own NIC and has passed a slave with a closed port 0 shows that this NIC is at the end
// of the broken ring again. In a whole ring, the copy of the head shows that the NIC is connected.
void Redundancy::note_probe(Bytes frame, unsigned at, unsigned from) noexcept {
    if (at != from || !wire::load_datagram_header(frame.subspan(wire::kFramePrefixBytes)).circulating) return;
    head_.store(static_cast<std::uint8_t>(1 - from), std::memory_order_relaxed);
    two_beginnings_ = 0;
    ever_parted_ = true;
    set_fault(CablingFault::none);
}

}  // namespace margay
