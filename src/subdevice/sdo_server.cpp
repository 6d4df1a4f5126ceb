#include "subdevice/sdo_server.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace coe = wire::coe;
namespace sdo = wire::coe::sdo;
using coe::SdoLayout;
using wire::MailboxErrorCode;

namespace {
constexpr Duration kPatience = std::chrono::seconds(10);  // longest time that a hook may delay a request
}

void SdoServer::start() {
    transfer_ = Transfer::none;
    waiting_ = false;
    again_ = kNever;
}

std::optional<MailboxErrorCode> SdoServer::receive(Bytes data, std::uint16_t address, Outbox& out, Time now) {
    if (out.open().size() < coe::kSdoBytes) return MailboxErrorCode::no_more_memory;
    if (data.size() < coe::kSegmentHeaderBytes) return MailboxErrorCode::size_too_short;
    const auto command = SdoLayout::command::load(data);
    const auto specifier = sdo::specifier(command);
    address_ = address;
    const bool segment = specifier == coe::request::kDownloadSegment || specifier == coe::request::kUploadSegment;
    if (!segment && data.size() < coe::kSdoBytes) return MailboxErrorCode::size_too_short;
    if (!segment && specifier <= coe::kAbortSpecifier)
        transfer_ = Transfer::none;  // a new request ends an unfinished transfer

    switch (specifier) {
        case coe::request::kDownload:
            if (const auto wrong = find(command, data, true); wrong != Abort::none) {
                abort(wrong, out);
            } else {
                download(command, data, out, now);
            }
            break;
        case coe::request::kUpload:
            if (const auto wrong = find(command, data, false); wrong != Abort::none) {
                abort(wrong, out);
            } else {
                upload(out, now);
            }
            break;
        case coe::request::kDownloadSegment: download_segment(command, data, out, now); break;
        case coe::request::kUploadSegment: upload_segment(command, out); break;
        case coe::kAbortSpecifier: break;  // the client aborts; no reply
        default:
            index_ = SdoLayout::index::load(data);
            subindex_ = SdoLayout::subindex::load(data);
            abort(Abort::unknown_command, out);
    }
    return std::nullopt;
}

// Finds object and entry of an initiate request, and checks whether the access is possible.
Abort SdoServer::find(std::uint8_t command, Bytes data, bool write) {
    index_ = SdoLayout::index::load(data);
    subindex_ = SdoLayout::subindex::load(data);
    complete_ = (command & sdo::kCompleteAccess) != 0;
    by_segments_ = false;
    object_ = dictionary_.find(index_);
    entry_ = nullptr;
    if (object_ == nullptr || !dictionary_.exists(*object_)) return Abort::no_object;
    if (complete_) {
        const bool possible = complete_access_ && subindex_ <= 1 && object_->code != ObjectCode::variable;
        return possible ? check_access(write) : Abort::unsupported_access;
    }
    entry_ = object_->entry(subindex_);
    return entry_ == nullptr ? Abort::no_subindex : check_access(write);
}

// Whether the present state allows the access to the object.
Abort SdoServer::check_access(bool write) const {
    if (complete_) {
        for (unsigned n = subindex_; write && n <= object_->max_subindex(); ++n)
            if (dictionary_.blocked(index_, n)) return Abort::mapped_to_rx_pdo;
        return Abort::none;
    }
    if (!write) return check_readable(*entry_, state_);
    const auto refused = check_writable(*entry_, state_);
    if (refused != Abort::none) return refused;
    return dictionary_.blocked(index_, subindex_) ? Abort::mapped_to_rx_pdo : Abort::none;
}

ObjectAccess SdoServer::access(Time now, bool write, std::size_t bytes) const {
    return {.object = *object_,
            .subindex = subindex_,
            .complete = complete_,
            .write = write,
            .bytes = bytes,
            .state = state_,
            .now = now,
            .dictionary = dictionary_,
            .application = dictionary_.application(),
            .again = retrying_};
}

// ------------------------------------------------------------------ upload

void SdoServer::upload(Outbox& out, Time now) {
    if (const auto refused = check_access(false); refused != Abort::none) return abort(refused, out);
    const auto* const hooks = object_->hooks;
    if (hooks != nullptr && hooks->before_read != nullptr) {
        const auto reply = hooks->before_read(access(now));
        if (reply.waits()) {
            transfer_ = Transfer::upload;
            return wait(reply.again, {}, now);
        }
        if (reply.abort != Abort::none) return abort(reply.abort, out);
    }
    upload_now(out, now);
}

// Whether the value may be read in pieces: the value never changes, or its author keeps the pieces consistent.
bool SdoServer::source_stays() const {
    if (entry_->storage != Storage::image && entry_->storage != Storage::provided) return true;
    return source_.size() > staging_.size() && object_->hooks != nullptr && object_->hooks->in_pieces;
}

void SdoServer::upload_now(Outbox& out, Time now) {
    if (complete_) {
        const auto all = gather(access(now), staging_);
        if (all.abort != Abort::none) return abort(all.abort, out);
        source_ = staging_.first(all.bytes);
    }
    const Guard guard(complete_ ? nullptr : dictionary_.lock());  // one value is copied as a whole
    if (!complete_) source_ = view_value(access(now), *entry_, scratch_);
    transfer_ = Transfer::none;
    const auto at = out.open();
    const auto size = source_.size();
    const unsigned flags = sdo::kSizeIndicated | (complete_ ? sdo::kCompleteAccess : 0u);
    if (size >= 1 && size <= coe::kExpeditedBytes) {
        const auto unused = static_cast<unsigned>(coe::kExpeditedBytes - size);
        answer(at,
               sdo::command(coe::response::kUpload, flags | sdo::kExpedited | (unused << sdo::kExpeditedUnusedShift)));
        std::copy(source_.begin(), source_.end(), at.begin() + SdoLayout::expedited_data);
        return out.commit(wire::MailboxType::coe, coe::kSdoBytes, address_);
    }
    const auto first = std::min(size, at.size() - SdoLayout::normal_data);
    // Copied, because the application may change the value during the transfer.
    if (first < size && !complete_ && !source_stays()) {
        if (size > staging_.size()) return abort(Abort::out_of_memory, out);
        std::copy(source_.begin(), source_.end(), staging_.begin());
        source_ = staging_.first(size);
    }
    answer(at, sdo::command(coe::response::kUpload, flags));
    SdoLayout::complete_size::store(at, static_cast<std::uint32_t>(size));
    std::copy_n(source_.begin(), first, at.begin() + SdoLayout::normal_data);
    out.commit(wire::MailboxType::coe, SdoLayout::normal_data + first, address_);
    source_ = source_.subspan(first);
    if (source_.empty()) return;
    transfer_ = Transfer::upload;
    toggle_ = false;
}

bool SdoServer::toggle_right(std::uint8_t command, Outbox& out) {
    if (((command & sdo::kToggle) != 0) == toggle_) return true;
    abort(Abort::toggle_not_changed, out);
    return false;
}

void SdoServer::upload_segment(std::uint8_t command, Outbox& out) {
    if (transfer_ != Transfer::upload) return abort(Abort::unknown_command, out);
    if (!toggle_right(command, out)) return;
    const Guard guard(dictionary_.lock());
    const auto at = out.open();
    const auto bytes = std::min(source_.size(), at.size() - coe::kSegmentHeaderBytes);
    const auto padded = std::max(bytes, coe::kMinSegmentDataBytes);
    const bool last = bytes == source_.size();
    const auto unused = static_cast<unsigned>(padded - bytes);
    coe::store_header(at, {0, coe::Service::sdo_response});
    SdoLayout::command::store(at, sdo::command(coe::response::kUploadSegment, (toggle_ ? sdo::kToggle : 0u) |
                                                                                  (unused << sdo::kSegmentUnusedShift) |
                                                                                  (last ? sdo::kLastSegment : 0u)));
    const auto data = at.subspan(coe::kSegmentHeaderBytes, padded);
    std::fill(std::copy_n(source_.begin(), bytes, data.begin()), data.end(), std::byte{0});
    out.commit(wire::MailboxType::coe, coe::kSegmentHeaderBytes + padded, address_);
    source_ = source_.subspan(bytes);
    toggle_ = !toggle_;
    if (last) transfer_ = Transfer::none;
}

// ------------------------------------------------------------------ download

void SdoServer::download(std::uint8_t command, Bytes data, Outbox& out, Time now) {
    Bytes value;
    if ((command & sdo::kExpedited) != 0) {
        // Without size indication, the object determines the length.
        const std::size_t unused = (command >> sdo::kExpeditedUnusedShift) & 3u;
        std::size_t size = coe::kExpeditedBytes;
        if ((command & sdo::kSizeIndicated) != 0) {
            size -= unused;
        } else if (!complete_ && entry_->bytes() != 0) {
            size = std::min<std::size_t>(size, entry_->bytes());
        }
        value = data.subspan(SdoLayout::expedited_data, size);
    } else {
        const std::size_t size = SdoLayout::complete_size::load(data);
        value = data.subspan(SdoLayout::normal_data);
        if (value.size() > size) return abort(Abort::length_mismatch, out);
        if (value.size() < size) return download_segmented(size, value, out);
    }
    const auto reply = store(value, now);
    if (reply.waits()) {
        transfer_ = Transfer::download;
        if (value.size() > staging_.size()) return abort(Abort::out_of_memory, out);
        return wait(reply.again, value, now);
    }
    if (reply.abort != Abort::none) return abort(reply.abort, out);
    confirm_download(out);
}

// Refuses an invalid length at once, before the segments are transferred.
Abort SdoServer::check_room(std::size_t size) {
    target_ = staging_;
    if (complete_) {
        if (size > complete_bytes(*object_, subindex_, object_->max_subindex())) return Abort::length_too_high;
        return size > staging_.size() ? Abort::out_of_memory : Abort::none;
    }
    MutableBytes memory = dictionary_.in_image(*object_, *entry_, subindex_);
    if (entry_->storage == Storage::provided) memory = object_->hooks->memory(access(Time{}, true, size));
    if (size > memory.size()) return Abort::length_too_high;
    if (size < memory.size() && !varies(entry_->type)) return Abort::length_too_low;
    if (size <= staging_.size()) return Abort::none;
    target_ = memory;
    return object_->hooks != nullptr && object_->hooks->in_pieces ? Abort::none : Abort::out_of_memory;
}

void SdoServer::download_segmented(std::size_t size, Bytes first, Outbox& out) {
    if (const auto wrong = check_room(size); wrong != Abort::none) return abort(wrong, out);
    target_ = target_.first(size);
    {
        const Guard guard(dictionary_.lock());  // the target may be the memory of the object
        std::copy(first.begin(), first.end(), target_.begin());
    }
    arrived_ = first.size();
    transfer_ = Transfer::download;
    toggle_ = false;
    confirm_download(out);
    by_segments_ = true;
}

void SdoServer::download_segment(std::uint8_t command, Bytes data, Outbox& out, Time now) {
    if (transfer_ != Transfer::download) return abort(Abort::unknown_command, out);
    if (!toggle_right(command, out)) return;
    // The state may have changed since the transfer began.
    if (const auto refused = check_access(true); refused != Abort::none) return abort(refused, out);
    auto segment = data.subspan(coe::kSegmentHeaderBytes);
    const std::size_t unused = (command >> sdo::kSegmentUnusedShift) & 7u;
    if (segment.size() == coe::kMinSegmentDataBytes) segment = segment.first(segment.size() - unused);
    const bool last = (command & sdo::kLastSegment) != 0;
    const auto left = target_.size() - arrived_;
    if (segment.size() > left) return abort(Abort::length_too_high, out);
    if (last && segment.size() < left) return abort(Abort::length_too_low, out);
    {
        const Guard guard(dictionary_.lock());
        std::copy(segment.begin(), segment.end(), target_.begin() + static_cast<std::ptrdiff_t>(arrived_));
    }
    arrived_ += segment.size();
    toggle_ = !toggle_;
    if (last) return finish_download(out, now);
    confirm_download(out);
}

// All data have arrived. They are in target_, or in the staging buffer while a hook delays the request.
void SdoServer::finish_download(Outbox& out, Time now) {
    const auto reply = store(target_, now);
    if (reply.waits()) return wait(reply.again, target_, now);
    if (reply.abort != Abort::none) return abort(reply.abort, out);
    confirm_download(out);
    transfer_ = Transfer::none;
}

HookAnswer SdoServer::store(Bytes data, Time now) {
    const auto what = access(now, true, data.size());
    if (const auto refused = check_access(true); refused != Abort::none) return refused;
    const auto wrong = complete_ ? check_complete(what, data) : check_value(what, *entry_, data);
    if (wrong != Abort::none) return wrong;
    const auto* const hooks = object_->hooks;
    if (hooks != nullptr && hooks->before_write != nullptr) {
        const auto reply = hooks->before_write(what, data);
        if (reply.waits() || reply.abort != Abort::none) return reply;
    }
    if (complete_) {
        scatter(what, data);
    } else {
        const Guard guard(dictionary_.lock());
        store_value(what, *entry_, data);
    }
    if (hooks != nullptr && hooks->after_write != nullptr) hooks->after_write(what);
    return Abort::none;
}

// ------------------------------------------------------------------ waiting and answering

void SdoServer::wait(Time again, Bytes data, Time now) {
    if (!retrying_) patience_ends_ = now + kPatience;
    if (transfer_ == Transfer::download && !(data.data() == target_.data() && by_segments_)) {
        target_ = staging_.first(data.size());
        std::copy(data.begin(), data.end(), target_.begin());
    }
    waiting_ = true;
    any_time_ = again == kNever;
    again_ = any_time_ ? patience_ends_ : again;
}

Time SdoServer::step(Outbox& out, Time now) {
    if (!waiting_) return kNever;
    if ((now < again_ && !any_time_) || out.open().empty()) return again_ > now ? again_ : kNever;
    waiting_ = false;
    if (now >= patience_ends_) {
        abort(Abort::timeout, out);
        return kNever;
    }
    retrying_ = true;
    if (transfer_ == Transfer::upload) {
        upload(out, now);
    } else {
        finish_download(out, now);
    }
    retrying_ = false;
    return waiting_ ? again_ : kNever;
}

void SdoServer::answer(MutableBytes at, std::uint8_t command) const {
    coe::store_header(at, {0, coe::Service::sdo_response});
    SdoLayout::command::store(at, command);
    SdoLayout::index::store(at, index_);
    SdoLayout::subindex::store(at, subindex_);
    std::fill_n(at.begin() + SdoLayout::expedited_data, coe::kExpeditedBytes, std::byte{0});
}

void SdoServer::confirm_download(Outbox& out) {
    const auto at = out.open();
    if (by_segments_) {
        // The response contains the toggle bit of the segment. toggle_ is already the value for the next segment.
        std::fill_n(at.begin(), coe::kSdoBytes, std::byte{0});
        coe::store_header(at, {0, coe::Service::sdo_response});
        SdoLayout::command::store(at, sdo::command(coe::response::kDownloadSegment, toggle_ ? 0u : sdo::kToggle));
    } else {
        answer(at, sdo::command(coe::response::kDownload, complete_ ? sdo::kCompleteAccess : 0u));
    }
    out.commit(wire::MailboxType::coe, coe::kSdoBytes, address_);
}

// An abort ends the transfer. The standard specifies that it is sent with service SDO request, also by a server.
void SdoServer::abort(Abort code, Outbox& out) {
    transfer_ = Transfer::none;
    const auto at = out.open();
    answer(at, sdo::command(coe::kAbortSpecifier));
    coe::store_header(at, {0, coe::Service::sdo_request});
    SdoLayout::complete_size::store(at, static_cast<std::uint32_t>(code));
    out.commit(wire::MailboxType::coe, coe::kSdoBytes, address_);
}

}  // namespace margay::subdevice
