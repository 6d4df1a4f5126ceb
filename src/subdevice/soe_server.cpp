#include "subdevice/soe_server.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace soe = wire::soe;
using soe::Opcode;
using wire::MailboxErrorCode;

namespace {

// Fragments of one write follow each other as fast as the slave reads them.
constexpr auto kSilence = std::chrono::milliseconds(200);

}  // namespace

void SoeServer::start(AlState state, const MailboxRoom& room) {
    (void)room;
    state_ = state;
    stop();
}

void SoeServer::stop() {
    sending_ = too_long_ = false;
    to_come_ = 0;
    note_count_ = 0;
}

std::optional<MailboxErrorCode> SoeServer::receive(const wire::MailboxMessage& message, Outbox& out, Time now) {
    const auto data = message.data;
    if (data.size() < soe::kHeaderBytes) return MailboxErrorCode::size_too_short;
    if (out.open().size() < soe::kHeaderBytes + soe::kErrorBytes) return MailboxErrorCode::no_more_memory;
    const auto header = soe::load_header(data);
    address_ = message.header.address;
    switch (header.opcode) {
        case Opcode::read_request:
            header_ = header;
            to_come_ = 0;  // a read request ends an unfinished write
            read(out, now);
            return std::nullopt;
        case Opcode::write_request: write(header, data.subspan(soe::kHeaderBytes), out, now); return std::nullopt;
        case Opcode::read_response:
        case Opcode::write_response:
        case Opcode::notification:
        case Opcode::slave_info: return MailboxErrorCode::service_not_supported;
    }
    return MailboxErrorCode::invalid_header;
}

SoeError SoeServer::find(const soe::Header& header) {
    if (header.drive >= drives_.size()) return SoeError::invalid_drive;
    drive_ = &drives_[header.drive];
    parameter_ = drive_->find(header.idn());
    if (parameter_ == nullptr) return SoeError::no_idn;
    return header.elements == 0 ? SoeError::no_element : SoeError::none;
}

void SoeServer::answer(Opcode opcode, SoeError error, Outbox& out) {
    const auto at = out.open();
    soe::Header header = header_;
    header.opcode = opcode;
    header.incomplete = false;
    header.error = error != SoeError::none;
    soe::store_header(at, header);
    if (header.error) store_le(at, soe::kHeaderBytes, error);
    out.commit(wire::MailboxType::soe, soe::kHeaderBytes + (header.error ? soe::kErrorBytes : 0), address_);
}

Time SoeServer::step(Outbox& out, Time) {
    while (sending_ && send_next(out)) {
    }
    while (!sending_ && note_count_ != 0) {
        const auto at = out.open();
        if (at.size() < soe::kHeaderBytes) break;
        const Note& note = notes_[first_note_];
        const auto bytes = std::min<std::size_t>(note.bytes, at.size() - soe::kHeaderBytes);
        soe::store_header(at, note.header);
        std::copy_n(note.data.begin(), bytes, at.begin() + soe::kHeaderBytes);
        out.commit(wire::MailboxType::soe, soe::kHeaderBytes + bytes, 0);
        first_note_ = static_cast<std::uint8_t>((first_note_ + 1U) % notes_.size());
        --note_count_;
    }
    return kNever;
}

// ------------------------------------------------------------------ read

void SoeServer::read(Outbox& out, Time now) {
    SoeError error = find(header_);
    if (error == SoeError::none) error = compose(now);
    if (error != SoeError::none) return answer(Opcode::read_response, error, out);
    sent_ = 0;
    sending_ = true;
    (void)send_next(out);
}

// Sends one message with as many octets as fit. Returns false when no slot is free.
bool SoeServer::send_next(Outbox& out) {
    const auto at = out.open();
    if (at.size() <= soe::kHeaderBytes) return false;
    const std::size_t room = at.size() - soe::kHeaderBytes;
    const std::size_t left = used_ - sent_;
    const std::size_t part = std::min(left, room);
    soe::Header header = header_;
    header.opcode = Opcode::read_response;
    header.error = false;
    header.incomplete = part < left;
    if (header.incomplete) header.number = static_cast<std::uint16_t>((left - part + room - 1) / room);
    soe::store_header(at, header);
    std::copy_n(staging_.begin() + static_cast<std::ptrdiff_t>(sent_), part, at.begin() + soe::kHeaderBytes);
    sent_ += part;
    sending_ = header.incomplete;
    out.commit(wire::MailboxType::soe, soe::kHeaderBytes + part, address_);
    return true;
}

// Collects all requested elements in the order of their bits.
SoeError SoeServer::compose(Time now) {
    used_ = 0;
    constexpr unsigned kOfValue = soe_element::kDataState | soe_element::kValue;
    if ((header_.elements & kOfValue) != 0 && drive_->application != nullptr) {
        const auto error = drive_->application->before_read(access(now));
        if (error != SoeError::none) return error;
    }
    for (unsigned element = 1; element <= 0x80; element <<= 1) {
        if ((header_.elements & element) == 0) continue;
        const auto error = add_element(static_cast<std::uint8_t>(element));
        if (error != SoeError::none) return error;
    }
    return SoeError::none;
}

SoeError SoeServer::add_element(std::uint8_t element) {
    const auto& p = *parameter_;
    const bool number = !p.attribute.list && !p.attribute.command;
    const auto fits = [](bool added) { return added ? SoeError::none : SoeError::general; };
    switch (element) {
        case soe_element::kDataState: {
            std::array<std::byte, soe::kDataStateBytes> state{};
            if (p.attribute.command) std::ranges::copy(drive_->image.subspan(p.offset + 2, 2), state.begin());
            return fits(add(state));
        }
        case soe_element::kName: return p.name.empty() ? SoeError::no_name : fits(add_text(p.name));
        case soe_element::kAttribute: {
            std::array<std::byte, soe::kAttributeBytes> bits{};
            store_le(bits, 0, soe_attribute_bits(p.attribute));
            return fits(add(bits));
        }
        case soe_element::kUnit: return p.unit.empty() ? SoeError::no_unit : fits(add_text(p.unit));
        case soe_element::kMinimum:
            return !p.limited || !number ? SoeError::no_minimum
                                         : fits(add_number(static_cast<std::uint64_t>(p.minimum)));
        case soe_element::kMaximum:
            return !p.limited || !number ? SoeError::no_maximum
                                         : fits(add_number(static_cast<std::uint64_t>(p.maximum)));
        case soe_element::kDefault: return !number ? SoeError::no_default : fits(add_number(p.initial));
        default: return add_value();
    }
}

SoeError SoeServer::add_value() {
    const auto& p = *parameter_;
    const Guard guard(lock_);
    bool fits = true;
    const auto add_idn = [&](Idn idn) {
        std::array<std::byte, 2> octets{};
        store_le(octets, 0, idn.value);
        fits = fits && add(octets);
    };
    if (p.storage == SoeStorage::text) {
        fits = add_text(p.text);
    } else if (p.storage == SoeStorage::image) {
        const auto whole = drive_->image.subspan(p.offset, p.image_bytes());
        if (p.attribute.list)
            fits = add(whole.first(soe::kListHeadBytes +
                                   std::min<std::size_t>(soe::ListLayout::current_bytes::load(whole), p.most_bytes)));
        else
            fits = add(whole.first(p.attribute.bytes));
    } else if (p.attribute.list) {  // a list of IDNs that never changes: its header is written after its elements
        const std::size_t head = used_;
        fits = add(std::array<std::byte, soe::kListHeadBytes>{});
        for (const Idn idn : p.initial_idns) add_idn(idn);
        for (const auto& other : drive_->parameters)
            if (p.storage == SoeStorage::all_idns || (p.storage == SoeStorage::all_commands && other.attribute.command))
                add_idn(other.idn);
        if (!fits) return SoeError::general;
        const auto bytes = static_cast<std::uint16_t>(used_ - head - soe::kListHeadBytes);
        soe::ListLayout::current_bytes::store(staging_.subspan(head), bytes);
        soe::ListLayout::most_bytes::store(staging_.subspan(head), bytes);
    } else {
        fits = add_number(p.initial);
    }
    return fits ? SoeError::none : SoeError::general;
}

bool SoeServer::add(Bytes octets) {
    if (octets.size() > staging_.size() - used_) return false;
    std::ranges::copy(octets, staging_.begin() + static_cast<std::ptrdiff_t>(used_));
    used_ += octets.size();
    return true;
}

bool SoeServer::add_text(std::string_view text) {
    std::array<std::byte, soe::kListHeadBytes> head{};
    soe::ListLayout::current_bytes::store(head, static_cast<std::uint16_t>(text.size()));
    soe::ListLayout::most_bytes::store(head, static_cast<std::uint16_t>(text.size()));
    return add(head) && add(std::as_bytes(std::span(text)));
}

bool SoeServer::add_number(std::uint64_t value) {
    std::array<std::byte, 8> octets{};
    store_le(octets, 0, value);
    return add(Bytes(octets).first(parameter_->attribute.bytes));
}

// ------------------------------------------------------------------ write

// Stores the fragments. Only the last fragment contains the IDN, and only the last fragment gets a response.
//
// No fragment says that it is the first one. A master that gives up a write and begins another write may continue with
// the numbers of the first write. Therefore a fragment that arrives after a pause may be the first fragment of a new
// write.
void SoeServer::write(const soe::Header& header, Bytes data, Outbox& out, Time now) {
    const bool goes_on = to_come_ != 0 && header.drive == header_.drive && header.elements == header_.elements &&
                         (header.incomplete ? header.number + 1 == to_come_ : to_come_ == 1);
    if (!goes_on) {
        used_ = begins_ = 0;
        too_long_ = false;
    } else if (now - heard_ > kSilence) {
        begins_ = used_;
    }
    heard_ = now;
    header_ = header;
    to_come_ = header.incomplete ? header.number : std::uint16_t{0};
    const bool whole = !goes_on && !header.incomplete;
    if (!whole && !add(data)) too_long_ = true;
    if (header.incomplete) return;
    SoeError error = find(header);
    if (error == SoeError::none)
        error = too_long_ ? SoeError::value_too_long : whole ? store(data, now) : store_fragments(now);
    answer(Opcode::write_response, error, out);
}

// The fragments before the silence are dropped if the fragments behind it alone are a value of the parameter.
SoeError SoeServer::store_fragments(Time now) {
    const Bytes all = staging_.first(used_);
    const bool restarted =
        begins_ != 0 && check(all) != SoeError::none && check(all.subspan(begins_)) == SoeError::none;
    return store(restarted ? all.subspan(begins_) : all, now);
}

SoeError SoeServer::store(Bytes data, Time now) {
    if (const auto error = check(data); error != SoeError::none) return error;
    const auto& p = *parameter_;
    if (p.attribute.command) return command(load_le<std::uint16_t>(data), now);
    if (drive_->application != nullptr) {
        const auto error = drive_->application->before_write(access(now), data);
        if (error != SoeError::none) return error;
    }
    const auto at = drive_->image.subspan(p.offset, p.image_bytes());
    {
        const Guard guard(lock_);
        std::ranges::copy(data, at.begin());
        if (p.attribute.list) soe::ListLayout::most_bytes::store(at, p.most_bytes);
    }
    if (drive_->application != nullptr) drive_->application->after_write(access(now));
    return SoeError::none;
}

namespace {

SoeError read_only_error(std::uint8_t elements) {
    if ((elements & soe_element::kName) != 0) return SoeError::name_read_only;
    if ((elements & soe_element::kAttribute) != 0) return SoeError::attribute_read_only;
    if ((elements & soe_element::kUnit) != 0) return SoeError::unit_read_only;
    if ((elements & soe_element::kMinimum) != 0) return SoeError::minimum_read_only;
    if ((elements & soe_element::kMaximum) != 0) return SoeError::maximum_read_only;
    if ((elements & soe_element::kDefault) != 0) return SoeError::default_read_only;
    return SoeError::value_read_only;
}

SoeError check_number(const SoeParameter& p, Bytes data) {
    if (data.size() != p.attribute.bytes)
        return data.size() < p.attribute.bytes ? SoeError::value_too_short : SoeError::value_too_long;
    if (!p.limited) return SoeError::none;
    std::array<std::byte, 8> octets{};
    const bool negative =
        p.attribute.type == SoeType::signed_decimal && (data.back() & std::byte{0x80}) != std::byte{0};
    if (negative) octets.fill(std::byte{0xFF});
    std::ranges::copy(data, octets.begin());
    const auto value = load_le<std::int64_t>(octets);
    if (value < p.minimum) return SoeError::value_too_small;
    return value > p.maximum ? SoeError::value_too_large : SoeError::none;
}

SoeError check_list(const SoeParameter& p, Bytes data) {
    if (data.size() < soe::kListHeadBytes) return SoeError::value_too_short;
    const std::size_t length = soe::ListLayout::current_bytes::load(data);
    const std::size_t bytes = data.size() - soe::kListHeadBytes;
    if (bytes < length) return SoeError::value_too_short;
    if (bytes > length || length > p.most_bytes) return SoeError::value_too_long;
    return length % p.attribute.bytes == 0 ? SoeError::none : SoeError::value_invalid;
}

}  // namespace

SoeError SoeServer::check(Bytes data) const {
    const auto& p = *parameter_;
    if (header_.elements != soe_element::kValue) return read_only_error(header_.elements);
    if (p.never_written()) return SoeError::value_read_only;
    const bool held = state_ == AlState::op       ? p.attribute.protected_op
                      : state_ == AlState::safeop ? p.attribute.protected_safeop
                                                  : p.attribute.protected_preop;
    if (held) return SoeError::value_protected;
    return p.attribute.list ? check_list(p, data) : check_number(p, data);
}

// ------------------------------------------------------------------ procedure commands

SoeError SoeServer::command(std::uint16_t control, Time now) {
    constexpr std::uint16_t kGo = soe_command::kSet | soe_command::kEnable;
    if (control > kGo || control == soe_command::kEnable) return SoeError::value_invalid;
    const auto at = drive_->image.subspan(parameter_->offset, kSoeCommandBytes);
    const auto before = load_le<std::uint16_t>(at, 2);
    const bool running = (before & (kGo | soe_command::kRunning)) == (kGo | soe_command::kRunning) &&
                         (before & soe_command::kFailed) == 0;
    if (control == kGo && running) return SoeError::command_active;
    auto* const application = drive_->application;
    if (control != kGo) {
        if (running && application != nullptr) application->stop_command(access(now));
        store_le<std::uint16_t>(at, 0, control);
        store_le<std::uint16_t>(at, 2, control == 0 ? 0 : soe_command::kSet | soe_command::kRunning);
        return SoeError::none;
    }
    store_le<std::uint16_t>(at, 0, control);
    store_le<std::uint16_t>(at, 2, kGo | soe_command::kRunning);
    const auto error = application == nullptr ? SoeError::command_not_now : application->start_command(access(now));
    if (error != SoeError::none) store_le<std::uint32_t>(at, 0, 0);
    return error;
}

void SoeServer::finish_command(std::uint8_t drive, Idn idn, bool success) {
    if (drive >= drives_.size()) return;
    const auto* const p = drives_[drive].find(idn);
    if (p == nullptr || !p->attribute.command) return;
    const auto state = drives_[drive].image.subspan(p->offset + 2, soe::kDataStateBytes);
    constexpr std::uint16_t kActive = soe_command::kSet | soe_command::kEnable | soe_command::kRunning;
    if (load_le<std::uint16_t>(state) != kActive) return;
    store_le<std::uint16_t>(state, 0, success ? kActive & ~soe_command::kRunning : kActive | soe_command::kFailed);
    Note done{
        .header = {
            .opcode = Opcode::notification, .drive = drive, .elements = soe_element::kDataState, .number = idn.value}};
    std::ranges::copy(state, done.data.begin());
    done.bytes = soe::kDataStateBytes;
    (void)note(done);  // a lost notification does no harm: the data state contains the same information
}

bool SoeServer::report(std::uint8_t drive, Bytes data) {
    Note info{.header = {.opcode = Opcode::slave_info, .drive = drive}};
    info.bytes = static_cast<std::uint8_t>(std::min(data.size(), info.data.size()));
    std::copy_n(data.begin(), info.bytes, info.data.begin());
    return note(info);
}

bool SoeServer::note(const Note& note) {
    if (note_count_ == notes_.size()) return false;
    notes_[(first_note_ + note_count_++) % notes_.size()] = note;
    return true;
}

// ------------------------------------------------------------------ values

const SoeParameter* SoeDrive::find(Idn idn) const {
    const auto at =
        std::ranges::lower_bound(parameters, idn.value, {}, [](const SoeParameter& p) { return p.idn.value; });
    return at != parameters.end() && at->idn == idn ? &*at : nullptr;
}

std::uint64_t SoeDrive::number(Idn idn) const {
    const auto* const p = find(idn);
    if (p == nullptr || p->attribute.list) return 0;
    if (p->storage != SoeStorage::image) return p->initial;
    std::array<std::byte, 8> octets{};
    std::ranges::copy(image.subspan(p->offset, p->attribute.bytes), octets.begin());
    return load_le<std::uint64_t>(octets);
}

std::span<const std::byte> SoeDrive::list(Idn idn) const {
    const auto* const p = find(idn);
    if (p == nullptr || !p->attribute.list || p->storage != SoeStorage::image) return {};
    const auto whole = image.subspan(p->offset, p->image_bytes());
    return whole.subspan(soe::kListHeadBytes,
                         std::min<std::size_t>(soe::ListLayout::current_bytes::load(whole), p->most_bytes));
}

void SoeDrive::restore_defaults() const {
    for (const auto& p : parameters) {
        if (p.storage != SoeStorage::image) continue;
        const auto at = image.subspan(p.offset, p.image_bytes());
        std::ranges::fill(at, std::byte{0});
        if (!p.attribute.list) {
            for (std::size_t n = 0; n < at.size() && n < 8; ++n) at[n] = static_cast<std::byte>(p.initial >> (8 * n));
            continue;
        }
        const auto elements = at.subspan(soe::kListHeadBytes);
        std::size_t bytes = 0;
        for (const Idn idn : p.initial_idns.first(std::min(p.initial_idns.size(), elements.size() / 2))) {
            store_le(elements, bytes, idn.value);
            bytes += 2;
        }
        for (const char c : p.text.substr(0, elements.size() - bytes)) elements[bytes++] = static_cast<std::byte>(c);
        soe::ListLayout::current_bytes::store(at, static_cast<std::uint16_t>(bytes));
        soe::ListLayout::most_bytes::store(at, p.most_bytes);
    }
}

}  // namespace margay::subdevice
