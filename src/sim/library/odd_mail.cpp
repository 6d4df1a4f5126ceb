#include "sim/library/odd_mail.hpp"

#include "wire/coe.hpp"

#include <algorithm>

namespace margay::sim {

namespace coe = wire::coe;
namespace sdo = wire::coe::sdo;
using coe::SdoLayout;
using subdevice::MailboxRoom;
using wire::MailboxErrorCode;
using wire::MailboxType;

namespace {

constexpr Duration kLate = std::chrono::milliseconds(100);
constexpr std::uint8_t kMostMappingEntries = 8;

bool is_sdo(Bytes data, coe::Service service) {
    return data.size() >= coe::kSegmentHeaderBytes && coe::load_header(data).service == service;
}
std::uint8_t command_of(Bytes data) { return SdoLayout::command::load(data); }

}  // namespace

OddMail::OddMail(subdevice::MailboxServer& inner, MailboxType type, std::size_t most)
    : inner_(inner), type_(type), draft_(most), held_(most) {
    for (auto& letter : letters_) letter.data.resize(most);
    late_.data.resize(most);
}

void OddMail::start(AlState state, const MailboxRoom& room) {
    first_ = waiting_ = segments_ = 0;
    late_until_ = kNever;
    holding_ = toggle_ = false;
    room_ = std::min(room.send_bytes, draft_.size());
    inner_.start(state, room);
    if (!quirks_.has(Quirk::old_mail) || type_ != MailboxType::coe) return;
    // A reply to an old request: 0x1008, expedited.
    std::array<std::byte, coe::kSdoBytes> reply{};
    coe::store_header(reply, {0, coe::Service::sdo_response});
    SdoLayout::command::store(reply, 0x43);
    SdoLayout::index::store(reply, 0x1008);
    queue(type_, reply, 0);
}

bool OddMail::busy() const { return late_until_ != kNever || inner_.busy() || waiting_ + 4 > letters_.size(); }

std::optional<MailboxErrorCode> OddMail::receive(const wire::MailboxMessage& message, subdevice::Outbox& out,
                                                 Time now) {
    if (quirks_.has(Quirk::error_replies)) return MailboxErrorCode::service_not_supported;
    if (quirks_.has(Quirk::slow_replies)) {
        late_.bytes = std::min(message.data.size(), late_.data.size());
        late_.address = message.header.address;
        std::copy_n(message.data.begin(), late_.bytes, late_.data.begin());
        late_until_ = now + kLate;
        return std::nullopt;
    }
    const auto error = forward(message, now);
    flush(out);
    return error;
}

std::optional<MailboxErrorCode> OddMail::forward(const wire::MailboxMessage& message, Time now) {
    const auto data = message.data;
    if (type_ == MailboxType::coe && is_sdo(data, coe::Service::sdo_request) &&
        answer_for_quirk(data, message.header.address))
        return std::nullopt;
    return inner_.receive(message, *this, now);
}

Time OddMail::step(subdevice::Outbox& out, Time now) {
    if (late_until_ <= now) {
        late_until_ = kNever;
        const wire::MailboxMessage message{{.address = late_.address, .type = type_},
                                           Bytes(late_.data).first(late_.bytes)};
        (void)forward(message, now);
    }
    const auto next = inner_.step(*this, now);
    flush(out);
    return std::min(next, late_until_);
}

// ------------------------------------------------------------------ requests

bool OddMail::answer_for_quirk(Bytes request, std::uint16_t address) {
    const auto command = command_of(request);
    const auto specifier = sdo::specifier(command);
    if (specifier == coe::request::kUploadSegment) return serve_segment(command, address);
    if (request.size() < coe::kSdoBytes) return false;
    if (specifier != coe::request::kUpload && specifier != coe::request::kDownload) return false;
    holding_ = false;
    segments_ = 0;
    const bool download = specifier == coe::request::kDownload;
    const auto index = SdoLayout::index::load(request);
    const bool complete = (command & sdo::kCompleteAccess) != 0;
    const bool mapping = (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00);
    if (quirks_.has(Quirk::refuses_complete_access) && complete) {
        refuse(request, coe::Abort::unsupported_access, address);
    } else if (quirks_.has(Quirk::no_assignment) && (mapping || (index >= 0x1C10 && index < 0x1C30))) {
        refuse(request, coe::Abort::no_object, address);
    } else if (quirks_.has(Quirk::few_mapping_entries) && mapping && download &&
               ((SdoLayout::subindex::load(request) == 0 && (command & sdo::kExpedited) != 0 &&
                 std::to_integer<std::uint8_t>(request[SdoLayout::expedited_data]) > kMostMappingEntries) ||
                SdoLayout::subindex::load(request) > kMostMappingEntries)) {
        refuse(request, coe::Abort::exceeds_pdo, address);
    } else {
        return false;
    }
    return true;
}

bool OddMail::serve_segment(std::uint8_t command, std::uint16_t address) {
    ++segments_;
    std::array<std::byte, coe::kSdoBytes> nothing{};
    if (quirks_.has(Quirk::aborts_midway) && segments_ == 2) {
        holding_ = false;
        refuse(nothing, coe::Abort::general, address);
        return true;
    }
    if (!holding_) return false;
    if (((command & sdo::kToggle) != 0) != toggle_) {
        holding_ = false;
        refuse(nothing, coe::Abort::toggle_not_changed, address);
        return true;
    }
    const auto most = quirks_.has(Quirk::small_segments) ? coe::kMinSegmentDataBytes : room_ - coe::kSegmentHeaderBytes;
    const auto bytes = std::min(held_bytes_ - held_at_, most);
    const auto padded = std::max(bytes, coe::kMinSegmentDataBytes);
    const bool last = held_at_ + bytes == held_bytes_;
    const auto reply = MutableBytes(draft_).first(coe::kSegmentHeaderBytes + padded);
    std::fill(reply.begin(), reply.end(), std::byte{0});
    coe::store_header(reply, {0, coe::Service::sdo_response});
    const auto unused = static_cast<unsigned>(padded - bytes);
    SdoLayout::command::store(reply, sdo::command(coe::response::kUploadSegment,
                                                  (toggle_ ? sdo::kToggle : 0u) | unused << sdo::kSegmentUnusedShift |
                                                      (last ? sdo::kLastSegment : 0u)));
    std::copy_n(held_.begin() + static_cast<std::ptrdiff_t>(held_at_), bytes, reply.begin() + coe::kSegmentHeaderBytes);
    held_at_ += bytes;
    toggle_ = !toggle_;
    holding_ = !last;
    commit(type_, reply.size(), address);
    return true;
}

void OddMail::refuse(Bytes request, coe::Abort why, std::uint16_t address) {
    std::array<std::byte, coe::kSdoBytes> reply{};
    coe::store_header(reply, {0, coe::Service::sdo_request});
    SdoLayout::command::store(reply, sdo::command(coe::kAbortSpecifier));
    SdoLayout::index::store(reply, SdoLayout::index::load(request));
    SdoLayout::subindex::store(reply, SdoLayout::subindex::load(request));
    SdoLayout::complete_size::store(reply, static_cast<std::uint32_t>(why));
    queue(type_, reply, address);
}

// ------------------------------------------------------------------ replies

MutableBytes OddMail::open() {
    if (waiting_ + 3 > letters_.size()) return {};
    return MutableBytes(draft_).first(room_);
}

void OddMail::commit(MailboxType type, std::size_t bytes, std::uint16_t address) {
    if (quirks_.has(Quirk::never_replies)) return;
    const auto data = MutableBytes(draft_).first(room_);
    if (type == MailboxType::coe && is_sdo(data.first(bytes), coe::Service::sdo_response)) spoil(data, bytes);
    before_reply();
    queue(type, data.first(bytes), address);
    if (quirks_.has(Quirk::replies_twice)) queue(type, data.first(bytes), address);
}

void OddMail::spoil(MutableBytes data, std::size_t& bytes) {
    const auto command = command_of(data);
    const auto specifier = sdo::specifier(command);
    if (specifier == coe::response::kUpload) return spoil_upload(data, bytes);
    if (specifier != coe::response::kUploadSegment) return;
    if (quirks_.has(Quirk::toggle_stuck))
        SdoLayout::command::store(data, static_cast<std::uint8_t>(command & ~sdo::kToggle));
    if (quirks_.has(Quirk::empty_segments)) bytes = 0;
}

void OddMail::spoil_upload(MutableBytes data, std::size_t& bytes) {
    auto command = command_of(data);
    if ((command & sdo::kExpedited) != 0) {
        const std::size_t size = coe::kExpeditedBytes - (command >> sdo::kExpeditedUnusedShift & 3u);
        if (quirks_.has(Quirk::no_size_indicated)) {
            command = static_cast<std::uint8_t>(command & ~(sdo::kSizeIndicated | 3u << sdo::kExpeditedUnusedShift));
            SdoLayout::command::store(data, command);
        }
        const bool normal = quirks_.has(Quirk::never_expedited) || quirks_.has(Quirk::segments_only) ||
                            quirks_.has(Quirk::small_segments);
        if (!normal || SdoLayout::normal_data + size > data.size()) return;
        std::copy_backward(data.begin() + SdoLayout::expedited_data,
                           data.begin() + SdoLayout::expedited_data + static_cast<std::ptrdiff_t>(size),
                           data.begin() + SdoLayout::normal_data + static_cast<std::ptrdiff_t>(size));
        SdoLayout::complete_size::store(data, static_cast<std::uint32_t>(size));
        SdoLayout::command::store(
            data, sdo::command(coe::response::kUpload, sdo::kSizeIndicated | (command & sdo::kCompleteAccess)));
        bytes = SdoLayout::normal_data + size;
    }
    hold_back(data, bytes);
    const auto size = SdoLayout::complete_size::load(data);
    const bool whole = bytes == SdoLayout::normal_data + size;
    // Subindex 0 uses 16 bits in complete access; this device uses 8.
    if (quirks_.has(Quirk::unpadded_complete_access) && (command & sdo::kCompleteAccess) != 0 && whole && size > 2 &&
        SdoLayout::subindex::load(data) == 0) {
        std::copy(data.begin() + SdoLayout::normal_data + 2, data.begin() + static_cast<std::ptrdiff_t>(bytes),
                  data.begin() + SdoLayout::normal_data + 1);
        SdoLayout::complete_size::store(data, size - 1);
        --bytes;
    }
}

// Sends a value in segments, although it fits into one message.
void OddMail::hold_back(MutableBytes data, std::size_t& bytes) {
    const bool segments = quirks_.has(Quirk::segments_only) || quirks_.has(Quirk::small_segments);
    const auto size = SdoLayout::complete_size::load(data);
    if (!segments || bytes != SdoLayout::normal_data + size || size == 0) return;
    held_bytes_ = size;
    held_at_ = 0;
    std::copy_n(data.begin() + SdoLayout::normal_data, size, held_.begin());
    holding_ = true;
    toggle_ = false;
    bytes = SdoLayout::normal_data;
}

// Sends unsolicited messages before the requested reply.
void OddMail::before_reply() {
    std::array<std::byte, coe::kSdoBytes> mail{};
    if (quirks_.has(Quirk::emergency_first)) {
        coe::store_header(mail, {0, coe::Service::emergency});
        coe::EmergencyLayout::error_code::store(mail, 0xFF00);
        coe::EmergencyLayout::error_register::store(mail, 0x81);
        queue(MailboxType::coe, mail, 0);
        mail = {};
    }
    if (quirks_.has(Quirk::ethernet_first)) {
        std::array<std::byte, 4 + 60> frame{};  // an EoE fragment, the last fragment of frame 0
        frame[1] = std::byte{1};
        queue(MailboxType::eoe, frame, 0);
    }
    coe::store_header(mail, {0, coe::Service::sdo_response});
    SdoLayout::command::store(mail, 0x43);
    if (quirks_.has(Quirk::mail_for_others)) {
        SdoLayout::index::store(mail, 0x1018);
        queue(MailboxType::coe, mail, 0x1FFF);
    }
    if (quirks_.has(Quirk::foreign_replies)) {
        SdoLayout::index::store(mail, 0x5FFF);
        SdoLayout::subindex::store(mail, 7);
        queue(MailboxType::coe, mail, 0);
    }
}

void OddMail::queue(MailboxType type, Bytes data, std::uint16_t address) {
    if (waiting_ == letters_.size()) return;
    auto& letter = letters_[(first_ + waiting_++) % letters_.size()];
    letter.type = type;
    letter.address = address;
    letter.bytes = std::min(data.size(), letter.data.size());
    std::copy_n(data.begin(), letter.bytes, letter.data.begin());
}

void OddMail::flush(subdevice::Outbox& out) {
    while (waiting_ > 0) {
        const auto at = out.open();
        if (at.empty()) return;
        const auto& letter = letters_[first_];
        const auto bytes = std::min(letter.bytes, at.size());
        std::copy_n(letter.data.begin(), bytes, at.begin());
        out.commit(letter.type, bytes, letter.address);
        first_ = (first_ + 1) % letters_.size();
        --waiting_;
    }
}

}  // namespace margay::sim
