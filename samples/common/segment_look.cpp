#include "common/segment_look.hpp"

#include "wire/datagram.hpp"
#include "wire/esc.hpp"

#include <margay/al_state.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <span>

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

// The MAC address without the bit that the first slave sets.
MacAddress without_mark(MacAddress mac) {
    mac[0] &= static_cast<std::uint8_t>(~std::to_integer<unsigned>(wire::kPassedEscBit));
    return mac;
}

// One NIC, or the two NICs of a ring.
struct Ends {
    std::array<Nic*, 2> nics{};

    [[nodiscard]] bool has_link() const {
        return std::ranges::any_of(nics, [](Nic* n) { return n != nullptr && n->link_state() != LinkState::down; });
    }
    [[nodiscard]] WaitHandles handles() const {
        return {nics[0]->wait_handle(), nics[1] == nullptr ? -1 : nics[1]->wait_handle()};
    }
    [[nodiscard]] Time next_arrival() const {
        return std::min(nics[0]->next_arrival(), nics[1] == nullptr ? kNever : nics[1]->next_arrival());
    }
    [[nodiscard]] MacAddress source(std::size_t nic) const {
        MacAddress mac = without_mark(nics[nic]->source_mac());
        if (nic == 1 && mac == source(0)) mac.back() ^= 1;
        return mac;
    }
    // The NIC that has sent the frame; nothing for a frame of another master.
    [[nodiscard]] std::optional<std::size_t> sender_of(Bytes frame) const {
        if (nics[1] == nullptr) return 0;
        MacAddress got{};
        std::ranges::copy(frame.subspan(wire::kSourceMacOffset, got.size()),
                          std::as_writable_bytes(std::span(got)).begin());
        got = without_mark(got);
        for (std::size_t nic = 0; nic < nics.size(); ++nic)
            if (got == source(nic)) return nic;
        return std::nullopt;
    }
};

bool wait_for_link(const Ends& ends, Osal& osal) {
    const Time give_up = osal.now() + kLinkTimeout;
    while (!ends.has_link()) {
        if (osal.now() >= give_up) return false;
        osal.wait(osal.now() + std::chrono::milliseconds(10), -1);
    }
    return true;
}

// One read of the AL status, and its reply.
struct Question {
    wire::Command command = wire::Command::BRD;
    std::uint8_t index = kIndex;
    std::uint16_t position = 0;
};
struct Reply {
    std::uint16_t wkc = 0;
    bool circulated = false;  // it has passed a slave whose port 0 is closed: the first slave behind a break
    std::array<std::byte, kOctets> octets{};
};
// The replies, by the NIC that has sent the request.
using Replies = std::array<std::optional<Reply>, 2>;

// The reply of the slaves in a frame. Returns no value for any other frame. A frame that no slave has processed is a
// reply if it has crossed the ring, because it has passed the slaves in the other direction.
std::optional<Reply> answer_in(Bytes frame, const Question& question, bool crossed) {
    wire::DatagramReader reader(frame);
    const auto datagram = reader.next();
    if (!datagram || datagram->header.command != question.command || datagram->header.index != question.index ||
        datagram->header.address.ado() != wire::reg::kAlStatus.address || datagram->data.size() != kOctets ||
        (datagram->wkc == 0 && !crossed))
        return std::nullopt;
    Reply reply{.wkc = datagram->wkc, .circulated = datagram->header.circulating};
    std::ranges::copy(datagram->data, reply.octets.begin());
    return reply;
}

void take_answers(const Ends& ends, const Question& question, Replies& replies) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (std::size_t at = 0; at < ends.nics.size(); ++at) {
        if (ends.nics[at] == nullptr) continue;
        while (const auto size = ends.nics[at]->receive(buffer)) {
            const auto frame = Bytes(buffer).first(std::min(size, buffer.size()));
            if (frame.size() < wire::kFramePrefixBytes) continue;
            const auto from = ends.sender_of(frame);
            if (from && !replies[*from]) replies[*from] = answer_in(frame, question, *from != at);
        }
    }
}

// The NICs that send requests, by number.
using Askers = std::array<bool, 2>;

bool is_awaited(const Askers& asking, const Replies& replies) {
    return (asking[0] && !replies[0]) || (asking[1] && !replies[1]);
}

void wait_for_answers(const Ends& ends, Osal& osal, const Question& question, const Askers& asking, Replies& replies) {
    const Time give_up = osal.now() + kReplyTimeout;
    for (;;) {
        take_answers(ends, question, replies);
        if (!is_awaited(asking, replies) || osal.now() >= give_up) return;
        osal.wait(std::min(give_up, ends.next_arrival()), ends.handles());
    }
}

// Sends the request up to kSendings times. Both NICs send at the same time, like a master with two NICs: in an unbroken
// ring, usually one of the two copies is processed by no slave, and an analysis of a recording treats both as one
// frame.
Replies ask(const Ends& ends, Osal& osal, const Question& question, Askers asking) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    Replies replies{};
    for (int sending = 0; sending < kSendings && is_awaited(asking, replies); ++sending) {
        for (std::size_t nic = 0; nic < asking.size(); ++nic) {
            if (!asking[nic]) continue;
            wire::FrameBuilder builder(buffer, ends.source(nic));
            // Each slave adds 1 to a position, and the slave that reads 0 answers.
            const auto position = static_cast<std::uint16_t>(0U - question.position);
            (void)builder.append(question.command, question.index,
                                 wire::DatagramAddress(position, wire::reg::kAlStatus.address), kOctets);
            asking[nic] = ends.nics[nic]->send(builder.finish()) != SendStatus::failed;
        }
        wait_for_answers(ends, osal, question, asking, replies);
    }
    return replies;
}

// The replies of the slaves that the frames of each NIC reach.
std::array<Reply, 2> ask_all(const Ends& ends, Osal& osal) {
    const Replies replies = ask(ends, osal, {}, {true, ends.nics[1] != nullptr});
    return {replies[0].value_or(Reply{}), replies[1].value_or(Reply{})};
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

SegmentLook look_at_segment(Nic& nic, Osal& osal, Nic* second) {
    const Ends ends{{&nic, second}};
    if (!wait_for_link(ends, osal)) return {.link = false};
    const auto [one, two] = ask_all(ends, osal);
    return {.slaves = static_cast<std::uint16_t>(one.wkc + two.wkc),
            .al_status = static_cast<std::uint16_t>(load_le<std::uint16_t>(one.octets, 0) |
                                                    load_le<std::uint16_t>(two.octets, 0))};
}

std::vector<AlStatus> look_at_states(Nic& nic, Osal& osal, Nic* second) {
    std::vector<AlStatus> all;
    const Ends ends{{&nic, second}};
    if (!wait_for_link(ends, osal)) return all;
    const auto replies = ask_all(ends, osal);
    const bool turned =
        replies[0].circulated && !replies[1].circulated;  // the first NIC is at the end of a broken ring
    for (const std::size_t end : {turned ? 1U : 0U, turned ? 0U : 1U}) {
        for (std::uint16_t n = 0; n < replies[end].wkc; ++n) {
            const Question question{wire::Command::APRD, static_cast<std::uint8_t>(all.size()), n};
            const auto answer = ask(ends, osal, question, {end == 0, end == 1})[end];
            all.push_back(answer && answer->wkc != 0 ? al_status_in(answer->octets) : AlStatus{});
        }
    }
    return all;
}

}  // namespace margay::samples
