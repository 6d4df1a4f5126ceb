#include "subdevice_check/sdo_client.hpp"

#include <algorithm>

namespace margay::samples::conformance {

using coe::SdoLayout;
namespace sdo = coe::sdo;

std::string abort_text(Abort abort) {
    return abort == Abort::none
               ? std::string("no abort")
               : fmt::format("abort 0x{:08x} ({})", static_cast<std::uint32_t>(abort), coe::to_text(abort));
}

std::string reason_text(const std::string& fault, Abort abort) { return fault.empty() ? abort_text(abort) : fault; }

std::string object_text(std::uint16_t index, std::uint8_t subindex) {
    return fmt::format("0x{:04x}:{:02x}", index, subindex);
}

void SdoClient::needs_sdo() {
    mail_.needs_protocol(mailbox_protocol::kCoE, "CoE");
    if (!dead_.empty()) bench().skip(dead_);
}

SdoReply SdoClient::ask(Bytes message) {
    const auto specifier = sdo::specifier(SdoLayout::command::load(message));
    const bool segment = specifier == coe::request::kDownloadSegment || specifier == coe::request::kUploadSegment;
    const auto is_reply = [&](const Mail& mail) {
        if (mail.header.type == wire::MailboxType::error) return true;
        if (mail.header.type != wire::MailboxType::coe || mail.data.size() < coe::kSdoBytes) return false;
        const auto service = coe::load_header(mail.data).service;
        if (service != coe::Service::sdo_response && service != coe::Service::sdo_request) return false;
        const auto kind = sdo::specifier(SdoLayout::command::load(mail.data));
        // Segments have no index. The response to another initiate request is no response to a segment.
        if (segment) return kind != coe::response::kUpload && kind != coe::response::kDownload;
        return SdoLayout::index::load(mail.data) == SdoLayout::index::load(message) &&
               SdoLayout::subindex::load(mail.data) == SdoLayout::subindex::load(message);
    };
    auto mail = mail_.ask(wire::MailboxType::coe, message, is_reply);
    if (mail.header.type == wire::MailboxType::error)
        bench().skip("an SDO was answered by a mailbox error, " + hex(mail.data));
    note_oddities(message, mail.data);
    SdoReply reply{.command = SdoLayout::command::load(mail.data), .message = std::move(mail.data)};
    if (sdo::specifier(reply.command) == coe::kAbortSpecifier)
        reply.abort = static_cast<Abort>(SdoLayout::complete_size::load(reply.message));
    return reply;
}

// A fault in the header of a response that does not affect its content.
void SdoClient::note_oddities(Bytes request, Bytes response) {
    const auto asked = SdoLayout::command::load(request);
    const auto command = SdoLayout::command::load(response);
    const auto kind = sdo::specifier(command);
    if (kind == coe::kAbortSpecifier) {
        if (coe::load_header(response).service != coe::Service::sdo_request)
            mail_.note(Oddity::abort_service, hex(response));
        return;
    }
    const auto initiate = sdo::specifier(asked);
    const bool answers = (initiate == coe::request::kUpload && kind == coe::response::kUpload) ||
                         (initiate == coe::request::kDownload && kind == coe::response::kDownload);
    if (answers && ((command ^ asked) & sdo::kCompleteAccess) != 0) mail_.note(Oddity::complete_bit, hex(response));
}

std::vector<std::byte> SdoClient::initiate(std::uint8_t command, std::uint16_t index, std::uint8_t subindex,
                                           std::uint32_t number) {
    std::vector<std::byte> message(coe::kSdoBytes);
    coe::store_header(message, {0, coe::Service::sdo_request});
    SdoLayout::command::store(message, command);
    SdoLayout::index::store(message, index);
    SdoLayout::subindex::store(message, subindex);
    SdoLayout::complete_size::store(message, number);
    return message;
}

std::vector<std::byte> SdoClient::segment_request(bool toggle) {
    auto message = initiate(sdo::command(coe::request::kUploadSegment, toggle ? sdo::kToggle : 0U), 0, 0);
    return message;
}

std::vector<std::byte> SdoClient::segment(bool toggle, Bytes data, bool last) {
    const auto padded = std::max(data.size(), coe::kMinSegmentDataBytes);
    const auto unused = static_cast<unsigned>(padded - data.size());
    auto message = initiate(
        sdo::command(coe::request::kDownloadSegment, (toggle ? sdo::kToggle : 0U) | (last ? sdo::kLastSegment : 0U) |
                                                         unused << sdo::kSegmentUnusedShift),
        0, 0);
    message.resize(coe::kSegmentHeaderBytes + padded);
    std::copy(data.begin(), data.end(), message.begin() + coe::kSegmentHeaderBytes);
    return message;
}

Upload SdoClient::upload(std::uint16_t index, std::uint8_t subindex, bool complete) {
    const auto reply =
        ask(initiate(sdo::command(coe::request::kUpload, complete ? sdo::kCompleteAccess : 0U), index, subindex));
    Upload up{.abort = reply.abort};
    if (!reply.ok()) return up;
    if (sdo::specifier(reply.command) != coe::response::kUpload) {
        up.fault = fmt::format("the response has the command 0x{:02x}", reply.command);
        return up;
    }
    up.size_indicated = (reply.command & sdo::kSizeIndicated) != 0;
    up.expedited = (reply.command & sdo::kExpedited) != 0;
    if (up.expedited) {
        const std::size_t unused = up.size_indicated ? reply.command >> sdo::kExpeditedUnusedShift & 3U : 0U;
        up.announced = up.first_bytes = coe::kExpeditedBytes - unused;
        const auto data = Bytes(reply.message).subspan(SdoLayout::expedited_data, up.first_bytes);
        up.data.assign(data.begin(), data.end());
        return up;
    }
    up.announced = SdoLayout::complete_size::load(reply.message);
    const auto data = Bytes(reply.message).subspan(SdoLayout::normal_data);
    up.first_bytes = std::min(data.size(), up.announced);
    up.data.assign(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(up.first_bytes));
    if (data.size() > up.announced)
        up.fault = fmt::format("the response carries {} octets and announces {}", data.size(), up.announced);
    if (up.fault.empty() && up.data.size() < up.announced) read_segments(up);
    return up;
}

void SdoClient::read_segments(Upload& up) {
    for (bool toggle = false; up.data.size() < up.announced; toggle = !toggle) {
        const auto reply = ask(segment_request(toggle));
        up.abort = reply.abort;
        if (!reply.ok()) return;
        ++up.segments;
        if (sdo::specifier(reply.command) != coe::response::kUploadSegment) {
            up.fault = fmt::format("segment {} has the command 0x{:02x}", up.segments, reply.command);
            return;
        }
        if (((reply.command & sdo::kToggle) != 0) != toggle) {
            up.fault = fmt::format("the toggle bit of segment {} is not that of the request", up.segments);
            return;
        }
        auto data = Bytes(reply.message).subspan(coe::kSegmentHeaderBytes);
        const std::size_t unused = reply.command >> sdo::kSegmentUnusedShift & 7U;
        if (data.size() == coe::kMinSegmentDataBytes) data = data.first(data.size() - std::min(unused, data.size()));
        up.data.insert(up.data.end(), data.begin(), data.end());
        const bool last = (reply.command & sdo::kLastSegment) != 0;
        if (data.empty() && !last) {
            up.fault = fmt::format("segment {} carries no data", up.segments);
            return;
        }
        if (last && up.data.size() < up.announced) {
            up.fault = fmt::format("the last segment ends after {} of {} octets", up.data.size(), up.announced);
            return;
        }
        if (!last && up.data.size() >= up.announced) {
            up.fault = fmt::format("all {} octets have come, and segment {} is not marked as the last", up.announced,
                                   up.segments);
            return;
        }
    }
    if (up.data.size() > up.announced)
        up.fault = fmt::format("{} octets have come, and {} were announced", up.data.size(), up.announced);
}

std::optional<std::uint32_t> SdoClient::number(std::uint16_t index, std::uint8_t subindex) {
    const auto up = upload(index, subindex);
    if (!up.ok() || up.data.empty() || up.data.size() > 4) return std::nullopt;
    std::uint32_t number = 0;
    for (std::size_t n = up.data.size(); n-- > 0;) number = number << 8 | std::to_integer<std::uint32_t>(up.data[n]);
    return number;
}

Abort SdoClient::download(std::uint16_t index, std::uint8_t subindex, Bytes data, bool complete) {
    auto message = initiate(0, index, subindex);
    bool segments = false;
    const unsigned flag = complete ? sdo::kCompleteAccess : 0U;
    if (!data.empty() && data.size() <= coe::kExpeditedBytes) {
        const auto unused = static_cast<unsigned>(coe::kExpeditedBytes - data.size());
        SdoLayout::command::store(message,
                                  sdo::command(coe::request::kDownload, flag | sdo::kExpedited | sdo::kSizeIndicated |
                                                                            (unused << sdo::kExpeditedUnusedShift)));
        std::copy(data.begin(), data.end(), message.begin() + SdoLayout::expedited_data);
    } else {
        SdoLayout::command::store(message, sdo::command(coe::request::kDownload, flag | sdo::kSizeIndicated));
        SdoLayout::complete_size::store(message, static_cast<std::uint32_t>(data.size()));
        const auto room = mail_.out_bytes() - wire::kMailboxHeaderBytes - message.size();
        const auto first = data.first(std::min(room, data.size()));
        message.insert(message.end(), first.begin(), first.end());
        data = data.subspan(first.size());
        segments = !data.empty();
    }
    const auto reply = ask(message);
    if (reply.ok() && sdo::specifier(reply.command) != coe::response::kDownload)
        bench().fail(fmt::format("the response to a download has the command 0x{:02x}", reply.command),
                     "ETG.1000.6, SDO Download Expedited");
    return reply.ok() && segments ? write_segments(data) : reply.abort;
}

Abort SdoClient::write_segments(Bytes data) {
    const auto room = mail_.out_bytes() - wire::kMailboxHeaderBytes - coe::kSegmentHeaderBytes;
    for (bool toggle = false; !data.empty(); toggle = !toggle) {
        const auto part = data.first(std::min(room, data.size()));
        data = data.subspan(part.size());
        const auto reply = ask(segment(toggle, part, data.empty()));
        if (!reply.ok()) return reply.abort;
        if (sdo::specifier(reply.command) != coe::response::kDownloadSegment ||
            ((reply.command & sdo::kToggle) != 0) != toggle)
            bench().fail(fmt::format("the response to a segment of a download with toggle bit {} has the command "
                                     "0x{:02x}",
                                     toggle ? 1 : 0, reply.command),
                         "ETG.1000.6, Download SDO Segment");
    }
    return Abort::none;
}

}  // namespace margay::samples::conformance
