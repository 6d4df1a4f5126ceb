// SDO transfers of several messages: segments, toggle bits, and transfers that end early.
#include "subdevice_check/check.hpp"

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using coe::SdoLayout;
namespace sdo = coe::sdo;

constexpr std::string_view kSegments = "ETG.1000.6, Upload SDO Segment";
constexpr std::string_view kAborts = "ETG.1000.6, table SDO Abort Codes";

void enter(Session& session) {
    session.sdo.needs_sdo();
    session.bench.enter(AlState::preop);
}

// An entry that does not fit one message.
DictionaryEntry needs_large(Session& session) {
    enter(session);
    if (!session.sdo.large) session.bench.skip("no value of the dictionary needs segments");
    return *session.sdo.large;
}

// Begins an upload. Returns false when the first response has the whole value.
bool begin_upload(Session& session, const DictionaryEntry& entry) {
    const auto reply =
        session.sdo.ask(SdoClient::initiate(sdo::command(coe::request::kUpload), entry.index, entry.subindex));
    if (!reply.ok()) session.bench.skip(object_text(entry.index, entry.subindex) + " cannot be read");
    return (reply.command & sdo::kExpedited) == 0 &&
           SdoLayout::complete_size::load(reply.message) > reply.message.size() - SdoLayout::normal_data;
}

// Tries the candidates again, because information.entries does not run on every slave.
void check_upload(Session& session) {
    enter(session);
    auto& bench = session.bench;
    std::optional<Upload> up;
    std::string name;
    if (session.sdo.large) {
        name = object_text(session.sdo.large->index, session.sdo.large->subindex);
        up = session.sdo.upload(session.sdo.large->index, session.sdo.large->subindex);
    } else {
        for (const auto& entry : session.sdo.entries) {
            if (entry.bits / 8U + coe::kSdoBytes + wire::kMailboxHeaderBytes <= session.mail.in_bytes()) continue;
            name = object_text(entry.index, entry.subindex);
            up = session.sdo.upload(entry.index, entry.subindex);
            break;
        }
    }
    if (!up) bench.skip("no value of the dictionary needs segments");
    if (!up->fault.empty()) bench.fail(fmt::format("{}: {}", name, up->fault));
    if (up->abort != Abort::none)
        bench.fail(fmt::format("{}: the transfer ended after {} of {} octets with {}", name, up->data.size(),
                               up->announced, abort_text(up->abort)));
    if (!up->ok() || up->segments == 0) return;
    const auto room = session.mail.in_bytes() - wire::kMailboxHeaderBytes - coe::kSegmentHeaderBytes;
    const auto needed = (up->announced - up->first_bytes + room - 1) / room;
    if (up->segments > needed)
        bench.remark(fmt::format("{} came in {} segments; the mailbox has room for {}", name, up->segments, needed));
}

void check_toggle(Session& session) {
    const auto entry = needs_large(session);
    if (!begin_upload(session, entry)) session.bench.skip("no value of the dictionary needs segments");
    const auto reply = session.sdo.ask(SdoClient::segment_request(true));  // the first segment has toggle 0
    if (reply.abort != Abort::toggle_not_changed)
        session.bench.fail(fmt::format("a segment request with the wrong toggle bit: {}, expected {}",
                                       abort_text(reply.abort), abort_text(Abort::toggle_not_changed)));
    // The transfer is over now.
    const auto next = session.sdo.ask(SdoClient::segment_request(false));
    if (next.ok()) session.bench.fail("after the abort of a transfer a segment of it is still sent");
}

void check_without_begin(Session& session) {
    enter(session);
    for (const std::uint8_t specifier : {coe::request::kUploadSegment, coe::request::kDownloadSegment}) {
        const auto reply = session.sdo.ask(SdoClient::initiate(sdo::command(specifier), 0, 0));
        if (reply.abort != Abort::unknown_command)
            session.bench.fail(
                fmt::format("a segment request (command specifier {}) without a transfer: {}, "
                            "expected {}",
                            specifier, abort_text(reply.abort), abort_text(Abort::unknown_command)));
    }
}

// The master ends a transfer: no reply to the abort, and nothing is left of the transfer.
void check_client_abort(Session& session) {
    const auto entry = needs_large(session);
    if (!begin_upload(session, entry)) session.bench.skip("no value of the dictionary needs segments");
    session.mail.put(wire::MailboxType::coe,
                     SdoClient::initiate(sdo::command(coe::kAbortSpecifier), entry.index, entry.subindex,
                                         static_cast<std::uint32_t>(Abort::general)));
    while (const auto mail = session.mail.take(150ms)) {
        const bool sdo = mail->header.type == wire::MailboxType::coe && mail->data.size() >= coe::kSdoBytes &&
                         coe::load_header(mail->data).service != coe::Service::emergency;
        if (sdo) session.bench.fail("an abort of the master was answered: " + hex(mail->data));
        if (sdo) break;
    }
    if (session.sdo.ask(SdoClient::segment_request(false)).ok())
        session.bench.fail("after an abort of the master a segment of the transfer is still sent");
    if (!session.sdo.upload(0x1000, 0).ok())
        session.bench.fail("after an abort of the master object 0x1000 cannot be read");
}

// A new request ends the transfer before it.
void check_new_request(Session& session) {
    const auto entry = needs_large(session);
    if (!begin_upload(session, entry)) session.bench.skip("no value of the dictionary needs segments");
    bool answered = false;
    try {
        answered = session.sdo.upload(0x1000, 0).ok();
    } catch (const NotJudged&) {  // no reply at all
    }
    if (!answered) session.bench.fail("during a transfer in segments a new request is not answered");
}

// A download whose first message has no data: all octets come in one segment.
struct Download {
    std::string name{};
    std::vector<std::byte> data{};
    bool begun = false;
};
Download begin_download(Session& session) {
    enter(session);
    const auto entries = harmless_entries(session);
    if (entries.empty()) session.bench.skip("the dictionary has no writable entry that the check may write back");
    const auto& entry = entries.front();
    Download download{.name = object_text(entry.index, entry.subindex)};
    auto value = session.sdo.upload(entry.index, entry.subindex);
    if (!value.ok()) session.bench.skip(download.name + " cannot be read");
    value.data.resize(entry.bits / 8U);
    download.data = std::move(value.data);
    const auto reply =
        session.sdo.ask(SdoClient::initiate(sdo::command(coe::request::kDownload, sdo::kSizeIndicated), entry.index,
                                            entry.subindex, static_cast<std::uint32_t>(download.data.size())));
    download.begun = reply.ok() && sdo::specifier(reply.command) == coe::response::kDownload;
    return download;
}

void check_download(Session& session) {
    auto& bench = session.bench;
    const auto download = begin_download(session);
    if (!download.begun) {
        bench.remark(fmt::format("{}: a download of {} octets is refused when they come in a segment", download.name,
                                 download.data.size()));
        return;
    }
    const auto reply = session.sdo.ask(SdoClient::last_segment(false, download.data));
    if (!reply.ok())
        bench.fail(
            fmt::format("{}: the segment of a download was refused with {}", download.name, abort_text(reply.abort)));
    else if (sdo::specifier(reply.command) != coe::response::kDownloadSegment || (reply.command & sdo::kToggle) != 0)
        bench.fail(fmt::format("{}: the response to the first segment of a download has the command 0x{:02x}",
                               download.name, reply.command));
}

void check_download_toggle(Session& session) {
    auto& bench = session.bench;
    const auto download = begin_download(session);
    if (!download.begun) bench.skip("a small value is not taken in a segment (segments.download)");
    const auto reply = session.sdo.ask(SdoClient::last_segment(true, download.data));  // the first one has toggle 0
    if (reply.abort != Abort::toggle_not_changed)
        bench.fail(fmt::format("{}: a segment of a download with the wrong toggle bit: {}, expected {}", download.name,
                               abort_text(reply.abort), abort_text(Abort::toggle_not_changed)));
    if (session.sdo.ask(SdoClient::last_segment(false, download.data)).ok())
        bench.fail(fmt::format("{}: after the abort of a download a segment of it is still taken", download.name));
}

constexpr Check kChecks[] = {
    {"segments.upload", "a large value comes in segments with toggle bits", kSegments, check_upload},
    {"segments.toggle", "a wrong toggle bit of the master ends the transfer with 0x05030000", kAborts, check_toggle},
    {"segments.download", "a value can be written in segments", "ETG.1000.6, Download SDO Segment", check_download},
    {"segments.download_toggle", "a wrong toggle bit ends a download with 0x05030000", kAborts, check_download_toggle},
    {"segments.without_begin", "a segment without a transfer is refused with 0x05040001", kAborts, check_without_begin},
    {"segments.client_abort", "an abort of the master ends the transfer without a reply",
     "ETG.1000.6, Abort SDO Transfer", check_client_abort},
    {"segments.new_request", "a new request ends the transfer before it", kSegments, check_new_request},
};

}  // namespace

std::span<const Check> segment_checks() { return kChecks; }

}  // namespace margay::samples::conformance
