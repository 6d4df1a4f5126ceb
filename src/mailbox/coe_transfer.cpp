#include "mailbox/coe_transfer.hpp"

#include <algorithm>

namespace margay {

namespace coe = wire::coe;
namespace sdo = wire::coe::sdo;
using coe::Abort;
using coe::SdoLayout;

// ------------------------------------------------------------------ upload and download

void SdoTransfer::fail(const Error& error, Abort reason) {
    error_ = error;
    abort_code_ = reason;
    phase_ = Phase::over;
}

void SdoTransfer::finish() {
    slave_open_ = false;
    phase_ = Phase::over;
}

bool SdoTransfer::restart() {
    phase_ = Phase::initiate;
    toggle_ = asked_ = slave_open_ = false;
    done_ = 0;
    return true;
}

void SdoTransfer::write_initiate(MutableBytes data, std::uint8_t command) const {
    coe::store_header(data, {0, coe::Service::sdo_request});
    SdoLayout::command::store(data, command);
    SdoLayout::index::store(data, object_.index);
    SdoLayout::subindex::store(data, object_.subindex);
}

std::array<std::byte, SdoTransfer::kAbortBytes> SdoTransfer::abort_message() const {
    std::array<std::byte, kAbortBytes> data{};
    write_initiate(data, sdo::command(coe::kAbortSpecifier));
    SdoLayout::complete_size::store(data, static_cast<std::uint32_t>(abort_code_));
    return data;
}

// Some slaves abort a segment with index 0.
bool SdoTransfer::read_abort(Bytes data) {
    if (data.size() < coe::kSdoBytes) {
        fail(Errc::protocol, coe::kSdoBytes, data.size());
        return true;
    }
    const bool ours =
        SdoLayout::index::load(data) == object_.index && SdoLayout::subindex::load(data) == object_.subindex;
    if (!ours && phase_ == Phase::initiate) return false;
    fail(Errc::sdo_abort);
    error_.detail = SdoLayout::complete_size::load(data);
    slave_open_ = false;
    return true;
}

MailClient::Taken SdoTransfer::accept(const wire::MailboxMessage& mail) {
    if (!is_ours(mail.data)) return Taken::no;
    asked_ = false;
    return Taken::all;
}

bool SdoTransfer::is_ours(Bytes data) {
    if (phase_ == Phase::over || data.size() < coe::kHeaderBytes) return false;
    const auto service = coe::load_header(data).service;
    if (service != coe::Service::sdo_response && service != coe::Service::sdo_request) return false;
    if (data.size() < coe::kSegmentHeaderBytes) {
        fail(Errc::protocol, coe::kSdoBytes, data.size());
        return true;
    }
    const auto command = SdoLayout::command::load(data);
    const auto specifier = sdo::specifier(command);
    if (specifier == coe::kAbortSpecifier)
        return read_abort(data);  // most slaves send it as a request, some as a response
    if (service != coe::Service::sdo_response) return false;
    if (phase_ == Phase::segments) {
        if (specifier != segment_) return false;
        if (((command & sdo::kToggle) != 0) != toggle_)
            fail(Errc::protocol, toggle_ ? 1 : 0, toggle_ ? 0 : 1, Abort::toggle_not_changed);
        else
            read_segment(command, data);
        return true;
    }
    if (specifier != initiated_) return false;
    if (data.size() < coe::kSdoBytes) {
        fail(Errc::protocol, coe::kSdoBytes, data.size());
        return true;
    }
    if (SdoLayout::index::load(data) != object_.index || SdoLayout::subindex::load(data) != object_.subindex)
        return false;
    read_initiated(command, data);
    return true;
}

// ------------------------------------------------------------------ upload

std::size_t SdoUploading::compose(MutableBytes data) {
    if (data.size() < coe::kSdoBytes) return 0;
    std::ranges::fill(data.first(coe::kSdoBytes), std::byte{0});
    asked_ = phase_ == Phase::initiate;
    if (asked_) {
        write_initiate(data, sdo::command(coe::request::kUpload, object_.complete ? sdo::kCompleteAccess : 0U));
    } else {
        coe::store_header(data, {0, coe::Service::sdo_request});
        SdoLayout::command::store(data, sdo::command(coe::request::kUploadSegment, toggle_ ? sdo::kToggle : 0U));
    }
    return coe::kSdoBytes;
}

void SdoUploadTransfer::store(Bytes part) {
    std::ranges::copy(part, into_.begin() + static_cast<std::ptrdiff_t>(done_));
}

void SdoUploading::keep(Bytes part) {
    store(part);
    done_ += part.size();
}

void SdoUploading::read_initiated(std::uint8_t command, Bytes data) {
    if ((command & sdo::kExpedited) != 0) {
        const std::size_t unused = (command >> sdo::kExpeditedUnusedShift) & 3U;
        const bool indicated = (command & sdo::kSizeIndicated) != 0;
        // If the size is not indicated, the value has the size of the buffer, because the caller knows the object.
        const std::size_t size = indicated ? coe::kExpeditedBytes - unused : std::min(coe::kExpeditedBytes, room_);
        if (size > room_) return fail(Errc::capacity, size, room_);
        keep(data.subspan(SdoLayout::expedited_data, size));
        return finish();
    }
    size_ = SdoLayout::complete_size::load(data);
    const auto first = data.subspan(SdoLayout::normal_data);
    slave_open_ = first.size() < size_;
    if (size_ > room_) return fail(Errc::capacity, size_, room_, Abort::out_of_memory);
    keep(first.first(std::min(first.size(), size_)));  // some slaves fill the rest of the mailbox
    if (slave_open_)
        phase_ = Phase::segments;
    else
        finish();
}

void SdoUploading::read_segment(std::uint8_t command, Bytes data) {
    auto part = data.subspan(coe::kSegmentHeaderBytes);
    const std::size_t unused = (command >> sdo::kSegmentUnusedShift) & 7U;
    if (part.size() == coe::kMinSegmentDataBytes) part = part.first(part.size() - unused);
    const bool last = (command & sdo::kLastSegment) != 0;
    const std::size_t left = size_ - done_;
    if (part.size() > left) return fail(Errc::protocol, size_, done_ + part.size(), Abort::length_too_high);
    if (part.empty() && !last) return fail(Errc::protocol, size_, done_);  // the transfer would never end
    keep(part);
    toggle_ = !toggle_;
    if (!last) return;
    slave_open_ = false;
    if (done_ < size_) return fail(Errc::protocol, size_, done_);
    finish();
}

// ------------------------------------------------------------------ download

void SdoDownloadTransfer::load(MutableBytes part) const {
    std::ranges::copy(value_.subspan(done_, part.size()), part.begin());
}

std::size_t SdoDownloading::next_part(std::size_t room) const {
    const bool segment = phase_ == Phase::segments;
    const bool expedited = !segment && size_ <= coe::kExpeditedBytes;
    const std::size_t header = segment ? coe::kSegmentHeaderBytes : std::size_t{SdoLayout::normal_data};
    return expedited ? size_ : std::min(size_ - done_, room - header);
}

std::size_t SdoDownloading::compose(MutableBytes data) {
    if (data.size() < coe::kSdoBytes) return 0;
    under_way_ = next_part(data.size());
    if (phase_ == Phase::segments) return compose_segment(data);
    asked_ = true;
    std::ranges::fill(data.first(coe::kSdoBytes), std::byte{0});
    const unsigned flags = sdo::kSizeIndicated | (object_.complete ? sdo::kCompleteAccess : 0U);
    if (size_ != 0 && size_ <= coe::kExpeditedBytes) {
        const auto unused = static_cast<unsigned>(coe::kExpeditedBytes - size_);
        write_initiate(data, sdo::command(coe::request::kDownload,
                                          flags | sdo::kExpedited | (unused << sdo::kExpeditedUnusedShift)));
        load(data.subspan(SdoLayout::expedited_data, size_));
        return coe::kSdoBytes;
    }
    write_initiate(data, sdo::command(coe::request::kDownload, flags));
    SdoLayout::complete_size::store(data, static_cast<std::uint32_t>(size_));
    load(data.subspan(SdoLayout::normal_data, under_way_));
    return SdoLayout::normal_data + under_way_;
}

std::size_t SdoDownloading::compose_segment(MutableBytes data) {
    const std::size_t padded = std::max(under_way_, coe::kMinSegmentDataBytes);
    const auto unused = static_cast<unsigned>(padded - under_way_);
    coe::store_header(data, {0, coe::Service::sdo_request});
    SdoLayout::command::store(data, sdo::command(coe::request::kDownloadSegment,
                                                 (toggle_ ? sdo::kToggle : 0U) | (unused << sdo::kSegmentUnusedShift) |
                                                     (done_ + under_way_ == size_ ? sdo::kLastSegment : 0U)));
    const auto at = data.subspan(coe::kSegmentHeaderBytes, padded);
    load(at.first(under_way_));
    std::ranges::fill(at.subspan(under_way_), std::byte{0});
    return coe::kSegmentHeaderBytes + padded;
}

void SdoDownloading::acknowledge() {
    done_ += under_way_;
    under_way_ = 0;
    slave_open_ = done_ < size_;
    if (!slave_open_) finish();
}

void SdoDownloading::read_initiated(std::uint8_t, Bytes) {
    phase_ = Phase::segments;
    acknowledge();
}

void SdoDownloading::read_segment(std::uint8_t, Bytes) {
    toggle_ = !toggle_;
    acknowledge();
}

}  // namespace margay
