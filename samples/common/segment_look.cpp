#include "common/segment_look.hpp"

#include "wire/datagram.hpp"
#include "wire/esc.hpp"

#include <margay/al_state.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

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

// One NIC, or the two NICs of a ring; the first one asks.
struct Ends {
    Nic* nic = nullptr;
    Nic* other = nullptr;

    [[nodiscard]] bool has_link() const {
        return nic->link_state() != LinkState::down || (other != nullptr && other->link_state() != LinkState::down);
    }
    [[nodiscard]] WaitHandles handles() const {
        return {nic->wait_handle(), other == nullptr ? -1 : other->wait_handle()};
    }
    [[nodiscard]] Time next_arrival() const {
        return other == nullptr ? nic->next_arrival() : std::min(nic->next_arrival(), other->next_arrival());
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

// One read of the AL status, and its answer.
struct Question {
    wire::Command command = wire::Command::BRD;
    std::uint8_t index = kIndex;
    std::uint16_t position = 0;
};
struct Reply {
    std::uint16_t wkc = 0;
    bool crossed = false;     // it came back at the other NIC
    bool circulated = false;  // it has passed a slave whose port 0 is closed: the first slave behind a break
    std::array<std::byte, kOctets> octets{};

    // All slaves of the ring have answered. A question of the other NIC would come back without an answer, and a
    // recording would show a lost frame.
    [[nodiscard]] bool has_passed_ring() const { return crossed && wkc != 0; }
};

// The answer of the slaves in a frame. Returns nothing for any other frame. A frame that no slave has processed is an
// answer where it has crossed the ring: it has passed the slaves in the other direction.
std::optional<Reply> answer_in(Bytes frame, const Question& question, bool crossed) {
    wire::DatagramReader reader(frame);
    const auto datagram = reader.next();
    if (!datagram || datagram->header.command != question.command || datagram->header.index != question.index ||
        datagram->header.address.ado() != wire::reg::kAlStatus.address || datagram->data.size() != kOctets ||
        (datagram->wkc == 0 && !crossed))
        return std::nullopt;
    Reply reply{.wkc = datagram->wkc, .crossed = crossed, .circulated = datagram->header.circulating};
    std::ranges::copy(datagram->data, reply.octets.begin());
    return reply;
}

std::optional<Reply> received_answer(const Ends& ends, const Question& question) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (Nic* at : {ends.nic, ends.other}) {
        if (at == nullptr) continue;
        while (const auto size = at->receive(buffer))
            if (const auto answer =
                    answer_in(Bytes(buffer).first(std::min(size, buffer.size())), question, at == ends.other))
                return answer;
    }
    return std::nullopt;
}

std::optional<Reply> wait_for_answer(const Ends& ends, Osal& osal, const Question& question) {
    const Time give_up = osal.now() + kReplyTimeout;
    for (;;) {
        if (const auto answer = received_answer(ends, question)) return answer;
        if (osal.now() >= give_up) return std::nullopt;
        osal.wait(std::min(give_up, ends.next_arrival()), ends.handles());
    }
}

// Sends the question up to kSendings times.
std::optional<Reply> ask(const Ends& ends, Osal& osal, const Question& question) {
    std::array<std::byte, wire::kMaxFrameBytes> buffer{};
    for (int sending = 0; sending < kSendings; ++sending) {
        wire::FrameBuilder builder(buffer, ends.nic->source_mac());
        // Each slave adds 1 to a position, and the slave that reads 0 answers.
        const auto position = static_cast<std::uint16_t>(0U - question.position);
        (void)builder.append(question.command, question.index,
                             wire::DatagramAddress(position, wire::reg::kAlStatus.address), kOctets);
        if (ends.nic->send(builder.finish()) == SendStatus::failed) return std::nullopt;
        if (const auto answer = wait_for_answer(ends, osal, question)) return answer;
    }
    return std::nullopt;
}

// What the slaves answer that the frames of the asking NIC reach.
Reply ask_all(const Ends& ends, Osal& osal, std::uint8_t index) {
    return ask(ends, osal, {.index = index}).value_or(Reply{});
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
    if (!wait_for_link({&nic, second}, osal)) return {.link = false};
    const Reply one = ask_all({&nic, second}, osal, kIndex);
    const Reply two = second == nullptr || one.has_passed_ring() ? Reply{} : ask_all({second, &nic}, osal, kIndex + 1);
    return {.slaves = static_cast<std::uint16_t>(one.wkc + two.wkc),
            .al_status = static_cast<std::uint16_t>(load_le<std::uint16_t>(one.octets, 0) |
                                                    load_le<std::uint16_t>(two.octets, 0))};
}

std::vector<AlStatus> look_at_states(Nic& nic, Osal& osal, Nic* second) {
    std::vector<AlStatus> all;
    if (!wait_for_link({&nic, second}, osal)) return all;
    std::array<Ends, 2> ends{Ends{&nic, second}, Ends{second, &nic}};
    std::array<Reply, 2> replies{ask_all(ends[0], osal, kIndex)};
    if (second != nullptr && !replies[0].has_passed_ring()) replies[1] = ask_all(ends[1], osal, kIndex + 1);
    if (replies[0].circulated && !replies[1].circulated) {  // the first NIC is at the end of a broken ring
        std::swap(ends[0], ends[1]);
        std::swap(replies[0], replies[1]);
    }
    for (std::size_t end = 0; end < ends.size(); ++end) {
        for (std::uint16_t n = 0; n < replies[end].wkc; ++n) {
            const Question question{wire::Command::APRD, static_cast<std::uint8_t>(all.size()), n};
            const auto answer = ask(ends[end], osal, question);
            all.push_back(answer && answer->wkc != 0 ? al_status_in(answer->octets) : AlStatus{});
        }
    }
    return all;
}

}  // namespace margay::samples
