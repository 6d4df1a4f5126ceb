// The queues of an EoePort, and the fragments of its frames.
#include "mailbox/eoe_relay.hpp"

#include <algorithm>

namespace margay {

namespace eoe = wire::eoe;

namespace {

// A frame in the queue to the slave: its size and whether it wants a time; then its octets.
struct OutRecord {
    using bytes = Field<std::uint16_t, 0>;
    using wants_time = Field<std::uint8_t, 2>;
};
constexpr std::size_t kOutRecordBytes = OutRecord::wants_time::end;

// A frame in the queue from the slave.
struct InRecord {
    using bytes = Field<std::uint16_t, 0>;
    using port = Field<std::uint8_t, 2>;  // bit 7: it has a time stamp
    using time_stamp = Field<std::uint32_t, 3>;
};
constexpr std::size_t kInRecordBytes = InRecord::time_stamp::end;
constexpr std::uint8_t kStamped = 0x80;

}  // namespace

// ------------------------------------------------------------------ the queues

bool EoePort::can_send() const { return to_slave_.room() >= kOutRecordBytes + kEoeFrameBytes; }

bool EoePort::send(std::span<const std::byte> frame, bool want_time) {
    std::array<std::byte, kOutRecordBytes> record{};
    OutRecord::bytes::store(record, static_cast<std::uint16_t>(frame.size()));
    OutRecord::wants_time::store(record, want_time ? 1 : 0);
    const bool right = frame.size() >= eoe::kLeastFrameBytes && frame.size() <= kEoeFrameBytes;
    if (right && to_slave_.add(record, frame)) return true;
    count(kRefused);
    return false;
}

std::optional<EoeFrame> EoePort::receive(std::span<std::byte> into) {
    if (from_slave_.empty()) return std::nullopt;
    std::array<std::byte, kInRecordBytes> record{};
    from_slave_.peek(0, record);
    const std::uint8_t port_and_flag = InRecord::port::load(record);
    EoeFrame frame{.bytes = InRecord::bytes::load(record), .port = static_cast<std::uint8_t>(port_and_flag & 0xF)};
    if ((port_and_flag & kStamped) != 0) frame.time_stamp = InRecord::time_stamp::load(record);
    from_slave_.peek(kInRecordBytes, into.first(std::min(into.size(), frame.bytes)));
    from_slave_.drop(kInRecordBytes + frame.bytes);
    return frame;
}

EoeStatistics EoePort::statistics() const {
    const auto of = [&](Count which) { return counts_[which].load(std::memory_order_relaxed); };
    return {.sent = of(kSent),
            .sent_octets = of(kSentOctets),
            .refused = of(kRefused),
            .not_sent = of(kNotSent),
            .received = of(kReceived),
            .received_octets = of(kReceivedOctets),
            .overrun = of(kOverrun),
            .incomplete = of(kIncomplete),
            .malformed = of(kMalformed),
            .too_long = of(kTooLong)};
}

// ------------------------------------------------------------------ frames and fragments

EoeRelay::EoeRelay(std::uint16_t slave, EoePort& port, EoeRelayWatch& watch)
    : MailListener(MailboxType::eoe), port_(port), watch_(watch) {
    only_slave = slave;
    slots_ = std::min(port.parts_.size() / kEoeFrameBytes, assemblies_.size());
    for (std::size_t n = 0; n < slots_; ++n)
        assemblies_[n].use(port.parts_.subspan(n * kEoeFrameBytes, kEoeFrameBytes));
}

bool EoeRelay::has_fragment() {
    if (frame_bytes_ != 0) return true;
    if (port_.to_slave_.empty()) return false;
    std::array<std::byte, kOutRecordBytes> record{};
    port_.to_slave_.peek(0, record);
    frame_bytes_ = OutRecord::bytes::load(record);
    wants_time_ = OutRecord::wants_time::load(record) != 0;
    offset_ = 0;
    fragment_ = 0;
    return true;
}

std::size_t EoeRelay::compose(MutableBytes data) {
    if (data.size() < eoe::kLeastRoom) return 0;
    watch_.composing();
    const std::size_t left = frame_bytes_ - offset_;
    composed_ = eoe::fragment_bytes(left, data.size());
    const bool last = composed_ == left;
    const std::size_t blocks = fragment_ == 0 ? eoe::blocks_of(frame_bytes_) : offset_ / eoe::kBlockBytes;
    eoe::store_header(data, eoe::Header{.port = port_.port,
                                        .last = last,
                                        .time_requested = last && wants_time_,
                                        .fragment = fragment_,
                                        .blocks = static_cast<std::uint8_t>(blocks),
                                        .frame_number = frame_number_});
    port_.to_slave_.peek(kOutRecordBytes + offset_, data.subspan(eoe::kHeaderBytes, composed_));
    return eoe::kHeaderBytes + composed_;
}

void EoeRelay::sent(bool taken) {
    if (!taken) return end_frame(EoePort::kNotSent);
    offset_ += composed_;
    ++fragment_;
    if (offset_ < frame_bytes_) return;
    port_.count(EoePort::kSentOctets, frame_bytes_);
    end_frame(EoePort::kSent);
}

void EoeRelay::end_frame(EoePort::Count outcome) {
    port_.count(outcome);
    port_.to_slave_.drop(kOutRecordBytes + frame_bytes_);
    frame_bytes_ = 0;
    frame_number_ = static_cast<std::uint8_t>((frame_number_ + 1) & 0xF);
}

void EoeRelay::drop_all() {
    while (has_fragment()) sent(false);
    begin_again();
}

void EoeRelay::begin_again() {
    offset_ = 0;
    fragment_ = 0;
    for (Assembly& assembly : assemblies_)
        if (assembly.busy()) {
            assembly.drop();
            port_.count(EoePort::kIncomplete);
        }
    dropped_ = 0;
}

bool EoeRelay::take(const UnaskedMail& mail) {
    if (mail.data.size() < eoe::kHeaderBytes) return false;
    const eoe::Header header = eoe::load_header(mail.data);
    const Bytes data = mail.data.subspan(eoe::kHeaderBytes);
    if (header.type == eoe::Type::time_stamp_response && data.size() >= eoe::kTimeStampBytes) {
        (void)port_.sending_times_.add(load_le<std::uint32_t>(data));
        return true;
    }
    if (header.type != eoe::Type::fragment) return false;
    watch_.arrived(take_fragment(header, data));
    return true;
}

bool EoeRelay::take_fragment(const eoe::Header& header, Bytes data) {
    Assembly* const place = place_for(header);
    if (place == nullptr) {
        drop(header, EoePort::kIncomplete);
        return false;
    }
    switch (place->add(header, data)) {
        case Assembly::Took::more: return true;
        case Assembly::Took::whole: deliver(header.port, *place); break;
        case Assembly::Took::out_of_order: drop(header, EoePort::kIncomplete); break;
        case Assembly::Took::malformed: drop(header, EoePort::kMalformed); break;
        case Assembly::Took::too_long: drop(header, EoePort::kTooLong); break;
    }
    return false;
}

// The place of the frame that the fragment continues. For the first fragment of a frame: the place of the frame with
// the same number, which gets no more fragments; otherwise a free place; otherwise the place of the oldest frame.
EoeRelay::Assembly* EoeRelay::place_for(const eoe::Header& header) {
    if (header.fragment == 0) drop_old(header);
    const auto all = std::span(assemblies_).first(slots_);
    auto place = std::ranges::find_if(all, [&](const Assembly& one) { return one.is_part(header); });
    if (header.fragment != 0) return place == all.end() ? nullptr : &*place;
    dropped_ = static_cast<std::uint16_t>(dropped_ & ~(1U << header.frame_number));
    if (place == all.end()) place = std::ranges::find_if(all, [](const Assembly& one) { return !one.busy(); });
    if (place == all.end()) {
        place = all.begin() + static_cast<std::ptrdiff_t>(oldest());
        dropped_ = static_cast<std::uint16_t>(dropped_ | 1U << place->frame_number());
    }
    if (place->busy()) port_.count(EoePort::kIncomplete);
    begun_[static_cast<std::size_t>(place - all.begin())] = ++begun_last_;
    return &*place;
}

// A frame begins. Frame numbers have 4 bits, and slaves count up: a frame whose number is 8 or more behind will not be
// completed, and must not be mistaken for the next frame with this number.
void EoeRelay::drop_old(const eoe::Header& header) {
    constexpr unsigned kNumbers = 16;
    const auto behind = [&](unsigned number) { return (header.frame_number - number) % kNumbers; };
    for (Assembly& one : std::span(assemblies_).first(slots_)) {
        if (!one.busy() || one.port() != header.port || behind(one.frame_number()) < kNumbers / 2) continue;
        one.drop();
        port_.count(EoePort::kIncomplete);
    }
    for (unsigned number = 0; number < kNumbers; ++number)
        if (behind(number) >= kNumbers / 2) dropped_ = static_cast<std::uint16_t>(dropped_ & ~(1U << number));
}

std::size_t EoeRelay::oldest() const {
    std::size_t n = 0;
    for (std::size_t other = 1; other < slots_; ++other)
        if (begun_last_ - begun_[other] > begun_last_ - begun_[n]) n = other;
    return n;
}

// A dropped frame is counted once: its further fragments are ignored.
void EoeRelay::drop(const eoe::Header& header, EoePort::Count why) {
    const auto bit = static_cast<std::uint16_t>(1U << header.frame_number);
    if ((dropped_ & bit) == 0) port_.count(why);
    dropped_ = static_cast<std::uint16_t>(header.last ? dropped_ & ~bit : dropped_ | bit);
}

void EoeRelay::deliver(std::uint8_t port, const Assembly& whole) {
    std::array<std::byte, kInRecordBytes> record{};
    InRecord::bytes::store(record, static_cast<std::uint16_t>(whole.frame().size()));
    InRecord::port::store(record, static_cast<std::uint8_t>(port | (whole.time_stamp() ? kStamped : 0)));
    InRecord::time_stamp::store(record, whole.time_stamp().value_or(0));
    if (!port_.from_slave_.add(record, whole.frame())) return port_.count(EoePort::kOverrun);
    port_.count(EoePort::kReceived);
    port_.count(EoePort::kReceivedOctets, whole.frame().size());
}

}  // namespace margay
