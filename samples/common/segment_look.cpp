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

// One read of the AL status, and its answer.
struct Question {
    wire::Command command = wire::Command::BRD;
    std::uint8_t index = kIndex;
    std::uint16_t position = 0;
};
struct Reply {
    std::uint16_t wkc = 0;
    std::array<std::byte, kOctets> octets{};
};

// The answer of the slaves in a frame. Returns nothing for any other frame, and for a frame that no slave has
// processed.
std::optional<Reply> answer_in(Bytes frame, const Question& question) {
    wire::DatagramReader reader(frame);
    const auto datagram = reader.next();
    if (!datagram || datagram->header.command != question.command || datagram->header.index != question.index ||
        datagram->header.address.ado() != wire::reg::kAlStatus.address || datagram->data.size() != kOctets ||
        datagram->wkc == 0)
        return std::nullopt;
    Reply reply{.wkc = datagram->wkc};
    std::ranges::copy(datagram->data, reply.octets.begin());
    return reply;
}

std::optional<Reply> wait_for_answer(Nic& nic, Osal& osal, const Question& question) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    const Time give_up = osal.now() + kReplyTimeout;
    for (;;) {
        while (const auto size = nic.receive(buffer))
            if (const auto answer = answer_in(Bytes(buffer).first(std::min(size, buffer.size())), question))
                return answer;
        if (osal.now() >= give_up) return std::nullopt;
        osal.wait(std::min(give_up, nic.next_arrival()), nic.wait_handle());
    }
}

// Sends the question up to kSendings times.
std::optional<Reply> ask(Nic& nic, Osal& osal, const Question& question) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (int sending = 0; sending < kSendings; ++sending) {
        wire::FrameBuilder builder(buffer, nic.source_mac());
        // Each slave adds 1 to a position, and the slave that reads 0 answers.
        const auto position = static_cast<std::uint16_t>(0U - question.position);
        (void)builder.append(question.command, question.index,
                             wire::DatagramAddress(position, wire::reg::kAlStatus.address), kOctets);
        if (nic.send(builder.finish()) == SendStatus::failed) return std::nullopt;
        if (const auto answer = wait_for_answer(nic, osal, question)) return answer;
    }
    return std::nullopt;
}

}  // namespace

bool SegmentLook::running() const {
    constexpr auto kRunning = static_cast<unsigned>(AlState::safeop) | static_cast<unsigned>(AlState::op);
    return (al_status & kRunning) != 0;
}

AlStatus al_status_in(Bytes registers) {
    const auto status = load_le<std::uint16_t>(registers, 0);
    // While AL status reports a device id, the AL status code register contains the id (ETG.1020).
    const bool is_code = (status & wire::al::kDeviceIdentification) == 0;
    return {.state = static_cast<AlState>(status & wire::al::kStateMask),
            .error = (status & wire::al::kErrorIndication) != 0,
            .code = is_code ? load_le<std::uint16_t>(registers, 4) : std::uint16_t{0}};
}

SegmentLook look_at_segment(Nic& nic, Osal& osal) {
    if (!wait_for_link(nic, osal)) return {.link = false};
    const auto answer = ask(nic, osal, {});
    if (!answer) return {};
    return {.slaves = answer->wkc, .al_status = load_le<std::uint16_t>(answer->octets, 0)};
}

std::vector<AlStatus> look_at_states(Nic& nic, Osal& osal) {
    std::vector<AlStatus> all(look_at_segment(nic, osal).slaves);
    for (std::size_t n = 0; n < all.size(); ++n) {
        const auto answer = ask(nic, osal,
                                {.command = wire::Command::APRD,
                                 .index = static_cast<std::uint8_t>(n),
                                 .position = static_cast<std::uint16_t>(n)});
        if (answer) all[n] = al_status_in(answer->octets);
    }
    return all;
}

}  // namespace margay::samples
