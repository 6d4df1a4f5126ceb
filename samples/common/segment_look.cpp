#include "common/segment_look.hpp"

#include "wire/datagram.hpp"
#include "wire/esc.hpp"

#include <margay/al_state.hpp>

#include <algorithm>
#include <array>
#include <optional>

namespace margay::samples {
namespace {

constexpr Duration kLinkTimeout = std::chrono::seconds(5);
constexpr Duration kReplyTimeout = std::chrono::milliseconds(20);
constexpr int kSendings = 5;
// AL status to AL status code. No scan reads these six octets in one datagram. Thus a recording distinguishes this
// read from the reads of the scan, and a replay of a program that does not make this read finds the reads of the scan
// in their order.
constexpr std::size_t kOctets = 6;
constexpr std::uint8_t kIndex = 0xA5;

bool wait_for_link(Nic& nic, Osal& osal) {
    const Time give_up = osal.now() + kLinkTimeout;
    while (nic.link_state() == LinkState::down) {
        if (osal.now() >= give_up) return false;
        osal.wait(osal.now() + std::chrono::milliseconds(10), -1);
    }
    return true;
}

// The answer of the slaves in a frame. Returns nothing for any other frame, and for a frame that no slave has
// processed.
std::optional<SegmentLook> answer_in(Bytes frame) {
    wire::DatagramReader reader(frame);
    const auto datagram = reader.next();
    if (!datagram || datagram->header.command != wire::Command::BRD || datagram->header.index != kIndex ||
        datagram->header.address.ado() != wire::reg::kAlStatus.address || datagram->data.size() != kOctets ||
        datagram->wkc == 0)
        return std::nullopt;
    return SegmentLook{.slaves = datagram->wkc, .al_status = load_le<std::uint16_t>(datagram->data, 0)};
}

std::optional<SegmentLook> wait_for_answer(Nic& nic, Osal& osal) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    const Time give_up = osal.now() + kReplyTimeout;
    for (;;) {
        while (const auto size = nic.receive(buffer))
            if (const auto answer = answer_in(Bytes(buffer).first(std::min(size, buffer.size())))) return answer;
        if (osal.now() >= give_up) return std::nullopt;
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handle());
    }
}

}  // namespace

bool SegmentLook::running() const {
    constexpr auto kRunning = static_cast<unsigned>(AlState::safeop) | static_cast<unsigned>(AlState::op);
    return (al_status & kRunning) != 0;
}

SegmentLook look_at_segment(Nic& nic, Osal& osal) {
    if (!wait_for_link(nic, osal)) return {.link = false};
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (int sending = 0; sending < kSendings; ++sending) {
        wire::FrameBuilder builder(buffer, nic.source_mac());
        (void)builder.append(wire::Command::BRD, kIndex,
                             wire::DatagramAddress(std::uint16_t{0}, wire::reg::kAlStatus.address), kOctets);
        if (nic.send(builder.finish()) == SendStatus::failed) return {};
        if (const auto answer = wait_for_answer(nic, osal)) return *answer;
    }
    return {};
}

}  // namespace margay::samples
