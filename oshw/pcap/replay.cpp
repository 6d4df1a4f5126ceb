#include "oshw/pcap/replay.hpp"

#include "wire/text.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::size_t kFramesOnTheWay = 256;

std::uint64_t key_of(const wire::DatagramHeader& header) {
    return std::uint64_t{header.address.value} | (std::uint64_t{header.length} << 32) |
           (std::uint64_t{static_cast<std::uint8_t>(header.command)} << 48);
}

// Octets after the last datagram are ignored; some masters announce too many octets.
bool readable(Bytes frame) {
    wire::DatagramReader reader(frame);
    while (reader.next()) {
    }
    return reader.fault() == wire::FrameFault::none || reader.fault() == wire::FrameFault::trailing;
}

// The data of write commands returns unchanged. Data is not used to identify requests.
bool data_comes_back_changed(wire::Command command) {
    using enum wire::Command;
    return command != NOP && command != APWR && command != FPWR && command != BWR && command != LWR;
}

std::string in_words(const wire::DatagramHeader& header) {
    std::array<char, 128> buffer;
    TextWriter text(buffer);
    wire::describe_request(text, header);
    return std::string(text.text());
}

}  // namespace

ReplayNic::ReplayNic(Osal& clock) noexcept : clock_(clock), memory_(kFramesOnTheWay), queue_(memory_) {}

Result<> ReplayNic::load_end(const std::string& path, const std::array<MacAddress, 2>* macs, unsigned end) {
    problem_.clear();
    queue_.clear();
    in_ring_ = macs != nullptr;
    end_ = end;
    if (in_ring_) macs_ = *macs;
    if (auto loaded = capture_.load(path); !loaded) {
        problem_ = capture_.problem();
        return loaded;
    }
    const auto& frames = capture_.frames();
    const auto request = std::find_if(frames.begin(), frames.end(), [](const auto& frame) { return !frame.reply; });
    if (request == frames.end()) {
        problem_ = "recording " + path +
                   ": no frame is a request; all source addresses have the bit set by which the first slave "
                   "marks replies";
        return Error{.code = Errc::nic, .step = Step::open_nic};
    }
    const auto bytes = capture_.bytes(*request);
    for (std::size_t i = 0; i < source_mac_.size(); ++i)
        source_mac_[i] = std::to_integer<std::uint8_t>(bytes[wire::kSourceMacOffset + i]);
    if (in_ring_) source_mac_ = macs_[end_];
    prepare();
    return {};
}

unsigned ReplayNic::sender_of(const CapturedFrame& frame) const noexcept {
    if (!in_ring_) return 0;
    const auto source = capture_.bytes(frame).subspan(wire::kSourceMacOffset);
    for (unsigned nic = 0; nic < macs_.size(); ++nic) {
        const auto own = std::as_bytes(std::span(macs_[nic]));
        if ((source[0] & ~wire::kPassedEscBit) == own[0] && std::equal(own.begin() + 1, own.end(), source.begin() + 1))
            return nic;
    }
    return kNobody;
}

// A copy that no slave has processed has no mark. If the file does not have the direction, the source address of the
// other NIC shows that the copy was received.
bool ReplayNic::was_received(const CapturedFrame& frame) const noexcept {
    using Direction = PacketOrigin::Direction;
    if (!in_ring_) return frame.reply;
    if (frame.origin.direction != Direction::unknown) return frame.origin.direction == Direction::received;
    return frame.reply || sender_of(frame) != frame.origin.interface;
}

void ReplayNic::complain(const std::string& what) {
    if (problem_.empty()) problem_ = what;
}

std::size_t ReplayNic::receive(std::span<std::byte> into) noexcept { return queue_.take(clock_.now(), into); }

Result<> PcapReplayNic::load_ring(const std::string& path, PcapReplayNic& second) {
    CaptureFile file;
    std::array<MacAddress, 2> macs{};
    if (auto loaded = file.load(path); !loaded) {
        complain(file.problem());
        return loaded;
    }
    if (!file.is_of_ring(macs)) {
        complain("recording " + path + ": it has not the frames of two NICs with addresses of their own");
        return Error{.code = Errc::nic, .step = Step::open_nic};
    }
    other_ = &second;
    second.other_ = this;
    if (auto loaded = load_end(path, &macs, 0); !loaded) return loaded;
    return second.load_end(path, &macs, 1);
}

void PcapReplayNic::prepare() {
    refused_ = false;
    series_.clear();
    outstanding_.clear();
    counters_ = {};
    for (std::size_t i = 0; i < capture().frames().size(); ++i) {
        const auto& frame = capture().frames()[i];
        if (!readable(capture().bytes(frame)))
            ++counters_.malformed;
        else if (sender_of(frame) != end())
            continue;
        else if (was_received(frame))
            take_reply(i);
        else
            take_request(i);
    }
    outstanding_.clear();
}

void PcapReplayNic::take_request(std::size_t frame) {
    constexpr std::size_t kRemembered = 256;  // the number of datagram indices
    Outstanding request{frame, {}};
    const auto& sent = capture().frames()[frame];
    const bool refused = in_ring() && sent.origin.direction == PacketOrigin::Direction::refused;
    wire::DatagramReader reader(capture().bytes(sent));
    while (const auto datagram = reader.next()) {
        auto& exchanges = series_[key_of(datagram->header)].exchanges;
        request.at.push_back(exchanges.size());
        exchanges.push_back({.refused = refused});
    }
    if (refused) return;
    outstanding_.push_back(std::move(request));
    if (outstanding_.size() > kRemembered) outstanding_.pop_front();
}

// Whether a frame can be the reply to a request: the same datagrams with the same indices; only the working counters
// may differ.
bool PcapReplayNic::answers(const Outstanding& request, Bytes reply) const {
    wire::DatagramReader asked(capture().bytes(capture().frames()[request.frame]));
    wire::DatagramReader said(reply);
    for (;;) {
        const auto a = asked.next();
        const auto b = said.next();
        if (!a || !b) return !a && !b;
        const bool same_address = wire::counts_position(a->header.command)
                                      ? a->header.address.ado() == b->header.address.ado()
                                      : a->header.address == b->header.address;
        if (!same_address || a->header.command != b->header.command || a->header.index != b->header.index ||
            a->header.length != b->header.length)
            return false;
    }
}

// Two equal requests may be outstanding: either they were sent one after the other, and the replies arrive in order; or
// the older one was lost and repeated, and the reply belongs to the newer one. The age of the requests distinguishes
// the two cases: a retry is sent only after several round trips.
void PcapReplayNic::take_reply(std::size_t frame) {
    constexpr int kRoundTripsUntilRetry = 4;
    const auto& reply = capture().frames()[frame];
    const auto bytes = capture().bytes(reply);
    const auto fits = [&](const Outstanding& request) { return answers(request, bytes); };
    const auto newest = std::find_if(outstanding_.rbegin(), outstanding_.rend(), fits);
    if (newest == outstanding_.rend()) {
        ++counters_.stray;
        return;
    }
    const auto age = [&](const Outstanding& request) {
        return std::max(Duration::zero(), reply.at - capture().frames()[request.frame].at);
    };
    const auto limit = age(*newest);
    const auto found = std::find_if(outstanding_.begin(), outstanding_.end(), [&](const Outstanding& request) {
        return age(request) / kRoundTripsUntilRetry <= limit && fits(request);
    });
    connect(*found, frame);
    outstanding_.erase(found);
}

void PcapReplayNic::connect(const Outstanding& request, std::size_t reply_frame) {
    const auto& asked = capture().frames()[request.frame];
    const auto& said = capture().frames()[reply_frame];
    wire::DatagramReader requests(capture().bytes(asked));
    wire::DatagramReader replies(capture().bytes(said));
    for (const auto at : request.at) {
        const auto a = requests.next();
        const auto b = replies.next();
        if (!a || !b) return;  // not possible: answers() has compared both frames
        series_[key_of(a->header)].exchanges[at] = {.answered = true,
                                                    .used = false,
                                                    .refused = false,
                                                    .answer_offset = static_cast<std::uint32_t>(b->offset),
                                                    .answer_frame = static_cast<std::uint32_t>(reply_frame),
                                                    .latency = std::max(Duration::zero(), said.at - asked.at)};
    }
}

PcapReplayNic::Use PcapReplayNic::find(const wire::DatagramHeader& header) noexcept {
    const auto found = series_.find(key_of(header));
    if (found == series_.end()) {
        ++counters_.unknown;
        complain("the recording has no " + in_words(header));
        return {};
    }
    auto& series = found->second;
    while (series.next < series.exchanges.size() && series.exchanges[series.next].used) ++series.next;
    if (series.next < series.exchanges.size()) return {&series, series.next, true};
    const auto last = std::find_if(series.exchanges.rbegin(), series.exchanges.rend(),
                                   [](const Exchange& exchange) { return exchange.answered; });
    if (used_up_ == UsedUp::unanswered || last == series.exchanges.rend()) {
        ++counters_.used_up;
        complain("the recording has " + in_words(header) + " only " + std::to_string(series.exchanges.size()) +
                 " times");
        return {};
    }
    return {&series, static_cast<std::size_t>(series.exchanges.rend() - last) - 1, false};
}

SendStatus PcapReplayNic::send(std::span<const std::byte> frame) noexcept {
    if (queue().full() || (other_ != nullptr && other_->queue().full())) return SendStatus::busy;
    std::array<std::byte, HeldFrame::kMaxBytes> buffer{};
    if (frame.size() > buffer.size() || !readable(frame)) {
        ++counters_.malformed;
        complain("a request is no readable EtherCAT frame");
        return SendStatus::sent;
    }
    std::copy(frame.begin(), frame.end(), buffer.begin());
    const auto answer = MutableBytes(buffer).first(frame.size());

    std::array<Use, kMaxDatagrams> uses;
    std::size_t count = 0;
    std::uint64_t repeated = 0;
    Duration latency{};
    bool missing = false;
    bool lost = false;
    const Exchange* latest = nullptr;
    refused_ = false;
    wire::DatagramReader reader(frame);
    while (const auto datagram = reader.next()) {
        const auto use = find(datagram->header);
        if (use.series == nullptr) {
            missing = true;
            break;
        }
        uses[count++] = use;
        auto& exchange = use.series->exchanges[use.at];
        exchange.used = true;
        repeated += use.fresh ? 0u : 1u;
        lost = lost || !exchange.answered;
        refused_ = refused_ || (use.fresh && exchange.refused);
        if (latest == nullptr || exchange.answer_frame > latest->answer_frame) latest = &exchange;
        latency = std::max(latency, exchange.latency);
        if (exchange.answered) write_answer(exchange, *datagram, answer);
    }
    if (!missing && !lost) {
        ++counters_.answered;
        counters_.repeated += repeated;
        deliver(latest, latency, answer);
        return SendStatus::sent;
    }
    // The frame does not return. The answers for its other datagrams remain available. A recorded loss is now used up,
    // unless a datagram without any recording is the cause.
    for (const auto& use : std::span(uses).first(count)) {
        auto& exchange = use.series->exchanges[use.at];
        if (!use.fresh || (!missing && !exchange.answered)) continue;
        exchange.used = false;
        use.series->next = std::min(use.series->next, use.at);
    }
    if (!missing && refused_) return SendStatus::failed;
    if (!missing) ++counters_.lost_as_recorded;
    return SendStatus::sent;
}

void PcapReplayNic::deliver(const Exchange* latest, Duration latency, MutableBytes answer) noexcept {
    bool marked = true;
    PcapReplayNic* to = this;
    if (in_ring() && latest != nullptr) {
        const auto& came = capture().frames()[latest->answer_frame];
        marked = came.reply;
        if (came.origin.interface != end()) to = other_;
    }
    if (marked) answer[wire::kSourceMacOffset] |= wire::kPassedEscBit;
    (void)to->queue().put(clock().now() + latency, answer);  // send() has found room
}

void PcapReplayNic::write_answer(const Exchange& exchange, const wire::DatagramView& request,
                                 MutableBytes frame) const noexcept {
    const auto recorded = capture().bytes(capture().frames()[exchange.answer_frame]).subspan(exchange.answer_offset);
    const auto said = wire::load_datagram_header(recorded);
    auto header = request.header;
    header.address = said.address;
    header.circulating = said.circulating;
    header.irq = said.irq;
    wire::store_datagram_header(frame.subspan(request.offset), header);
    const auto data = recorded.subspan(wire::kDatagramHeaderBytes, said.length);
    const auto data_at = request.offset + wire::kDatagramHeaderBytes;
    if (data_comes_back_changed(header.command)) std::copy(data.begin(), data.end(), frame.subspan(data_at).begin());
    store_le<std::uint16_t>(frame, data_at + said.length,
                            load_le<std::uint16_t>(recorded, wire::kDatagramHeaderBytes + said.length));
}

}  // namespace margay
