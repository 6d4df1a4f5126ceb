#include "mailbox/foe_transfer.hpp"

#include <algorithm>

namespace margay {

namespace foe = wire::foe;
using foe::Layout;
using foe::Opcode;

namespace {

constexpr std::uint32_t kNarrow = 0xFFFF;  // the numbers of a slave that counts with 16 bits
constexpr std::uint32_t kRemembered = 8;   // replies to this number of earlier messages are ignored
constexpr std::string_view kEnded = "canceled";

// The distance from a number in a reply to the expected number.
std::uint32_t distance(std::uint32_t number, std::uint32_t expected) {
    const bool narrow = expected > kNarrow && number <= kNarrow;
    return narrow ? (expected - number) & kNarrow : expected - number;
}

void store_message(MutableBytes data, Opcode opcode, std::uint32_t word) {
    Layout::opcode::store(data, opcode);
    data[1] = std::byte{0};
    Layout::packet_number::store(data, word);
}

}  // namespace

// Texts come from a slave and go to a terminal or a log.
void FoeAccess::set_text(FoeRequest& request, Bytes text) {
    const auto end = std::ranges::find(text, std::byte{0});
    const auto bytes = std::min<std::size_t>(static_cast<std::size_t>(end - text.begin()), request.text_.size());
    std::transform(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(bytes), request.text_.begin(),
                   [](std::byte octet) {
                       const auto c = std::to_integer<unsigned char>(octet);
                       return c >= 0x20 && c < 0x7F ? static_cast<char>(c) : '?';
                   });
    request.text_bytes_ = bytes;
}

void FoeTransfer::fail(const Error& error, foe::ErrorCode said) {
    phase_ = Phase::over;
    error_ = error;
    said_ = said;
}

std::array<std::byte, FoeTransfer::kAbortBytes> FoeTransfer::abort_message() const {
    std::array<std::byte, kAbortBytes> data{};
    store_message(data, Opcode::error, static_cast<std::uint32_t>(said_));
    std::ranges::transform(kEnded, data.begin() + foe::kHeaderBytes, [](char c) { return static_cast<std::byte>(c); });
    return data;
}

void FoeTransfer::report_progress(FoeProgress progress) {
    progress.bytes = done_;
    progress.total = total();
    FoeAccess::set_bytes(request_, done_);
    if (request_.progressed != nullptr) request_.progressed(progress, request_.user);
}

std::size_t FoeTransfer::compose(MutableBytes data) {
    if (phase_ != Phase::request) return compose_packet(data);
    const std::string_view name = request_.name;
    if (data.size() < foe::kHeaderBytes + name.size()) return 0;
    store_message(data, asks_, request_.password);
    std::ranges::transform(name, data.begin() + foe::kHeaderBytes, [](char c) { return static_cast<std::byte>(c); });
    slave_open_ = true;
    return foe::kHeaderBytes + name.size();
}

// Whether the reply belongs to the last message. The message that ends the transfer has no reply.
bool FoeTransfer::is_answered(std::uint32_t number) const {
    return phase_ != Phase::farewell && distance(number, number_) == 0;
}

// Whether the reply is old. During the request, a reply with another number than the expected one belongs to an earlier
// transfer.
bool FoeTransfer::is_old(std::uint32_t number) const {
    return phase_ == Phase::request || begins_again_ || distance(number, number_) <= kRemembered;
}

// Whether the first packet has come twice although it was requested once: then the previous one belonged to an earlier
// file.
bool FoeTransfer::is_first_again(std::uint32_t number) const {
    const bool begun = phase_ == Phase::packets || phase_ == Phase::farewell;
    return doubtful_ && !repeated_ && !asked_again_ && answer_ == Opcode::data && begun && number == 1;
}

// Mail outside an exchange: a first packet may come while the transfer waits for no reply.
void FoeTransfer::overhear(Bytes data) {
    const bool packet = data.size() >= foe::kHeaderBytes && Layout::opcode::load(data) == Opcode::data;
    const auto number = packet ? Layout::packet_number::load(data) : 0;
    if (packet && is_first_again(number)) end_out_of_order(number);
}

void FoeTransfer::end_out_of_order(std::uint32_t number) {
    overtaken_ = late_ != 0 && is_first_again(number);
    fail({.code = Errc::protocol, .expected = number_, .actual = number}, foe::ErrorCode::wrong_packet_number);
}

MailClient::Taken FoeTransfer::accept(const wire::MailboxMessage& mail) {
    if (phase_ == Phase::over || mail.data.size() < foe::kHeaderBytes) return Taken::no;
    const auto opcode = Layout::opcode::load(mail.data);
    if (opcode == Opcode::error) return end_by_slave(mail.data);
    if (opcode == Opcode::busy) return wait_for_slave(mail.data);
    if (opcode != answer_) return Taken::no;
    const auto number = Layout::packet_number::load(mail.data);
    const Bytes body = mail.data.subspan(foe::kHeaderBytes);
    busy_ = false;
    if (!is_answered(number)) {
        if (is_old(number) && !is_first_again(number)) return Taken::no;
        end_out_of_order(number);
        return Taken::all;
    }
    heard_ = number;
    read_answer(body);
    return Taken::all;
}

MailClient::Taken FoeTransfer::end_by_slave(Bytes data) {
    FoeAccess::set_text(request_, data.subspan(foe::kHeaderBytes));
    slave_open_ = false;
    fail({.code = Errc::foe_error, .detail = static_cast<std::uint32_t>(Layout::error_code::load(data))});
    return Taken::all;
}

MailClient::Taken FoeTransfer::wait_for_slave(Bytes data) {
    busy_ = repeated_ = true;
    FoeAccess::set_text(request_, data.subspan(foe::kHeaderBytes));
    FoeProgress progress;
    progress.busy = true;
    progress.busy_done = Layout::done::load(data);
    progress.busy_entire = Layout::entire::load(data);
    progress.busy_text = request_.slave_text();
    report_progress(progress);
    FoeAccess::set_text(request_, {});
    return Taken::all;
}

// ------------------------------------------------------------------ read

FoeReadTransfer::FoeReadTransfer(FoeRead& request, ByteSink& sink, MutableBytes packet)
    : FoeTransfer(request, Opcode::read, Opcode::data, packet), sink_(sink), to_memory_(request.sink == nullptr) {
    number_ = 1;
}

// A packet that is not full is the last one.
void FoeReadTransfer::read_answer(Bytes body) {
    phase_ = Phase::packets;
    filled_ = std::min(body.size(), packet_.size());
    std::ranges::copy(body.first(filled_), packet_.begin());
    pushed_ = 0;
    fresh_ = true;
}

// If a file has only one packet, the packet may belong to an earlier file. So the file is requested again, once for
// each reply that may be late: the slave answers in order, so the last reply belongs to this file. If this reply is not
// the only packet of the file, the previous reply belonged to another file, and the slave has mistaken its
// acknowledgement for an acknowledgement of this file.
bool FoeReadTransfer::asks_again() {
    const bool only = filled_ < packet_.size();
    if (!only && asked_again_)
        fail({.code = Errc::protocol, .expected = number_, .actual = number_}, foe::ErrorCode::wrong_packet_number);
    if (only && late_ != 0) {
        --late_;
        fresh_ = false;
        asked_again_ = begins_again_ = true;
        phase_ = Phase::farewell;
    }
    return !fresh_ || phase_ == Phase::over;
}

bool FoeReadTransfer::prepare() {
    if (!fresh_ || (number_ == 1 && asks_again())) return true;
    while (pushed_ < filled_) {
        const auto rest = Bytes(packet_).subspan(pushed_, filled_ - pushed_);
        const ByteSink::Taken taken = sink_.push(rest);
        if (taken.failure != 0) {
            // A sink of the application may fail with any code. Only for the sink in memory, the failure means that it
            // is full.
            const bool full = to_memory_;
            fail({.code = full ? Errc::capacity : Errc::stream_failed, .detail = full ? 0 : taken.failure},
                 foe::ErrorCode::disk_full);
            return true;
        }
        pushed_ += std::min(taken.bytes, rest.size());
        if (taken.bytes < rest.size()) return false;
    }
    fresh_ = false;
    done_ += filled_;
    ++number_;
    if (filled_ < packet_.size()) phase_ = Phase::farewell;
    report_progress({});
    return true;
}

std::size_t FoeReadTransfer::compose_packet(MutableBytes data) {
    if (data.size() < foe::kHeaderBytes) return 0;
    slave_open_ = phase_ != Phase::farewell;
    store_message(data, Opcode::acknowledge, heard_);
    return foe::kHeaderBytes;
}

// ------------------------------------------------------------------ write

FoeWriteTransfer::FoeWriteTransfer(FoeWrite& request, ByteSource& source, MutableBytes packet)
    : FoeTransfer(request, Opcode::write, Opcode::acknowledge, packet),
      source_(source),
      total_(request.source != nullptr ? request.total : request.data.size()) {}

void FoeWriteTransfer::read_answer(Bytes) {
    const bool first = phase_ == Phase::request;
    const bool last = !first && filled_ < packet_.size();
    done_ += first ? 0 : filled_;
    filled_ = 0;
    ++number_;
    phase_ = last ? Phase::over : Phase::packets;
    slave_open_ = !last;
    if (!first) report_progress({});
}

// The first acknowledgement may belong to an earlier request, and the next acknowledgement to the first packet after
// that request. So the request is sent again, once for each acknowledgement that may be late: the slave answers in
// order, so the last of these acknowledgements and all later ones belong to this file.
bool FoeWriteTransfer::asks_again() {
    if (phase_ != Phase::packets || pulled_ || late_ == 0) return false;
    --late_;
    number_ = 0;
    begins_again_ = true;
    phase_ = Phase::farewell;
    return true;
}

bool FoeWriteTransfer::prepare() {
    if (phase_ == Phase::request || asks_again()) return true;
    pulled_ = true;
    while (!at_end_ && filled_ < packet_.size()) {
        const MutableBytes rest = packet_.subspan(filled_);
        const ByteSource::Piece piece = source_.pull(rest);
        if (piece.failure != 0) {
            fail({.code = Errc::stream_failed, .detail = piece.failure});
            return true;
        }
        filled_ += std::min(piece.bytes, rest.size());
        at_end_ = piece.last;
        if (!at_end_ && piece.bytes < rest.size()) return false;
    }
    return true;
}

std::size_t FoeWriteTransfer::compose_packet(MutableBytes data) {
    if (phase_ == Phase::farewell) {
        const auto message = abort_message();
        const std::size_t bytes = std::min(message.size(), data.size());
        std::copy_n(message.begin(), bytes, data.begin());
        return bytes;
    }
    if (data.size() < foe::kHeaderBytes + filled_) return 0;
    store_message(data, Opcode::data, number_);
    std::ranges::copy(packet_.first(filled_), data.begin() + foe::kHeaderBytes);
    return foe::kHeaderBytes + filled_;
}

// ------------------------------------------------------------------ memory

ByteSource::Piece MemorySource::pull(MutableBytes into) {
    const std::size_t bytes = std::min(into.size(), left_.size());
    std::copy_n(left_.begin(), bytes, into.begin());
    left_ = left_.subspan(bytes);
    return {.bytes = bytes, .last = left_.empty()};
}

ByteSink::Taken MemorySink::push(Bytes octets) {
    if (octets.size() > left_.size()) return {.failure = kFull};
    std::ranges::copy(octets, left_.begin());
    left_ = left_.subspan(octets.size());
    return {.bytes = octets.size()};
}

}  // namespace margay
