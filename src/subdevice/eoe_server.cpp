#include "subdevice/eoe_server.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace eoe = wire::eoe;
using eoe::Type;

namespace {

constexpr std::size_t kHeadBytes = 3;  // size and port of a frame in the memory
constexpr std::size_t kMostBlocks = 0x3F;

}  // namespace

void EoeServer::start(AlState, const MailboxRoom& room) {
    room_ = room.send_bytes >= eoe::kLeastRoom ? room.send_bytes : 0;
    used_ = offset_ = 0;
    fragment_ = 0;
    assembly_.drop();
}

void EoeServer::stop() {
    room_ = used_ = 0;
    assembly_.drop();
    application_.stopped();
}

// ------------------------------------------------------------------ to the master

bool EoeServer::has_room(std::size_t bytes) const {
    return room_ != 0 && memory_.size() - used_ >= kHeadBytes && bytes <= memory_.size() - used_ - kHeadBytes;
}

bool EoeServer::send(Bytes frame, std::uint8_t port) {
    const bool right = frame.size() >= eoe::kLeastFrameBytes && eoe::blocks_of(frame.size()) <= kMostBlocks;
    if (!right || !has_room(frame.size())) {
        ++counters_.lost;
        return false;
    }
    const auto at = memory_.subspan(used_, kHeadBytes + frame.size());
    store_le(at, 0, static_cast<std::uint16_t>(frame.size()));
    store_le(at, 2, port);
    std::ranges::copy(frame, at.begin() + kHeadBytes);
    used_ += at.size();
    return true;
}

Time EoeServer::step(Outbox& out, Time now) {
    const Time next = application_.step(*this, now);
    while (used_ != 0 && send_fragment(out, now)) {
    }
    return next;
}

// False: no message can be sent now.
bool EoeServer::send_fragment(Outbox& out, Time now) {
    const auto slot = out.open();
    if (slot.size() < eoe::kLeastRoom) return false;
    const std::size_t whole = load_le<std::uint16_t>(memory_);
    const bool stamps = append_time_stamp && slot.size() >= eoe::kLeastRoom + eoe::kTimeStampBytes;
    const std::size_t left = whole - offset_;
    std::size_t bytes = eoe::fragment_bytes(left, slot.size(), stamps ? eoe::kTimeStampBytes : 0);
    const bool last = bytes == left;
    const std::size_t blocks = fragment_ == 0 ? eoe::blocks_of(whole) : offset_ / eoe::kBlockBytes;
    eoe::store_header(slot, eoe::Header{.port = load_le<std::uint8_t>(memory_, 2),
                                        .last = last,
                                        .time_appended = last && stamps,
                                        .fragment = fragment_,
                                        .blocks = static_cast<std::uint8_t>(blocks),
                                        .frame_number = frame_number_});
    const auto data = slot.subspan(eoe::kHeaderBytes);
    std::ranges::copy(memory_.subspan(kHeadBytes + offset_, bytes), data.begin());
    offset_ += bytes;
    ++fragment_;
    if (last) {
        if (stamps) {
            store_le(data, bytes, application_.time_stamp(now));
            bytes += eoe::kTimeStampBytes;
        }
        std::ranges::copy(memory_.first(used_).subspan(kHeadBytes + whole), memory_.begin());
        used_ -= kHeadBytes + whole;
        offset_ = 0;
        fragment_ = 0;
        frame_number_ = static_cast<std::uint8_t>((frame_number_ + 1) & 0xF);
        ++counters_.sent;
    }
    out.commit(wire::MailboxType::eoe, eoe::kHeaderBytes + bytes, 0);
    return true;
}

// ------------------------------------------------------------------ from the master

std::optional<wire::MailboxErrorCode> EoeServer::receive(const wire::MailboxMessage& message, Outbox& out, Time now) {
    if (message.data.size() < eoe::kHeaderBytes) return wire::MailboxErrorCode::size_too_short;
    const eoe::Header header = eoe::load_header(message.data);
    const Bytes parameters = message.data.subspan(eoe::kHeaderBytes);
    const auto type = static_cast<unsigned>(header.type);
    if (header.type == Type::fragment) {
        receive_fragment(header, parameters, out, now);
        return std::nullopt;
    }
    const bool request = type % 2 == 0 && type <= static_cast<unsigned>(Type::get_filter_request);
    if (!request) return wire::MailboxErrorCode::service_not_supported;
    const auto slot = out.open();
    if (slot.size() < eoe::kHeaderBytes) return wire::MailboxErrorCode::no_more_memory;
    std::size_t bytes = 0;
    const EoeResult result = execute(header.type, parameters, slot.subspan(eoe::kHeaderBytes), bytes);
    eoe::store_header(slot, static_cast<Type>(type + 1), result);
    out.commit(wire::MailboxType::eoe, eoe::kHeaderBytes + bytes, message.header.address);
    return std::nullopt;
}

// Returns the result; `bytes` octets of `answer` are used.
EoeResult EoeServer::execute(Type type, Bytes parameters, MutableBytes answer, std::size_t& bytes) {
    EoeIp ip;
    EoeFilter filter;
    EoeResult result = EoeResult::unspecified;
    if (type == Type::set_ip_request) {
        const auto wanted = eoe::load_ip(parameters);
        if (!wanted) return EoeResult::unspecified;
        result = application_.set_ip(*wanted);
        if (result == EoeResult::success) append_time_stamp = wanted->append_time_stamp;
    } else if (type == Type::set_filter_request) {
        const auto wanted = eoe::load_filter(parameters);
        return wanted ? application_.set_filter(*wanted) : EoeResult::unspecified;
    } else if (type == Type::get_ip_request && answer.size() >= eoe::kIpBytes) {
        result = application_.get_ip(ip);
        ip.append_time_stamp = append_time_stamp;
        if (result == EoeResult::success) bytes = eoe::store_ip(answer, ip);
    } else if (type == Type::get_filter_request && answer.size() >= eoe::kFilterBytes) {
        result = application_.get_filter(filter);
        if (result != EoeResult::success) return result;
        eoe::store_filter(answer, filter);
        bytes = eoe::kFilterBytes;
    }
    return result;
}

void EoeServer::receive_fragment(const eoe::Header& header, Bytes data, Outbox& out, Time now) {
    using Took = eoe::Assembly::Took;
    // The first fragment of a frame ends a frame that is not complete. Other fragments of a dropped frame are ignored.
    const bool begins = header.fragment == 0;
    if (begins && assembly_.busy()) ++counters_.dropped;
    if (!begins && !assembly_.busy()) return;
    const Took took = assembly_.add(header, data);
    if (took == Took::more) return;
    if (took != Took::whole) {
        ++counters_.dropped;
        return;
    }
    ++counters_.received;
    const auto slot = out.open();
    if (header.time_requested && slot.size() >= eoe::kHeaderBytes + eoe::kTimeStampBytes) {
        eoe::store_header(slot, {.type = Type::time_stamp_response, .frame_number = header.frame_number});
        store_le(slot, eoe::kHeaderBytes, application_.time_stamp(now));
        out.commit(wire::MailboxType::eoe, eoe::kHeaderBytes + eoe::kTimeStampBytes, 0);
    }
    application_.received(*this, assembly_.frame(), now);
}

}  // namespace margay::subdevice
