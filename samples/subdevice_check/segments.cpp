// SDO transfers of several messages: segments, toggle bits, and transfers that end early.
#include "subdevice_check/check.hpp"
#include "subdevice_check/whole_object.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using coe::SdoLayout;
namespace sdo = coe::sdo;

constexpr std::string_view kSegments = "ETG.1000.6, Upload SDO Segment";

std::string name_of(const LargeValue& value) {
    return value.complete ? fmt::format("0x{:04x} by complete access", value.index)
                          : object_text(value.index, value.subindex);
}

constexpr std::size_t kMostTried = 16;

// A value may be large that no description announces: texts, and objects by complete access.
std::vector<LargeValue> found_by_trying(Session& session) {
    std::vector<LargeValue> candidates{{0x1008, 0}, {0x1009, 0}, {0x100A, 0}};
    if ((session.bench.slave().coe_details & coe_detail::kCompleteAccess) != 0)
        for (const auto index : whole_objects(session)) {
            const auto bits = summary_of(session, index).bits;
            if (bits == 0 || bits / 8 + coe::kSdoBytes + wire::kMailboxHeaderBytes > session.mail.in_bytes())
                candidates.push_back({index, 0, true});
        }
    if (candidates.size() > kMostTried) candidates.resize(kMostTried);
    std::erase_if(candidates, [&](LargeValue& value) {
        value.segments = session.sdo.upload(value.index, value.subindex, value.complete).segments;
        return value.segments == 0;
    });
    return candidates;
}

// The values that do not fit one message, that with the most segments first. The check of the information service,
// which looks for them, does not run on every slave.
std::vector<LargeValue> large_values(Session& session) {
    begin_sdo_check(session);
    return session.sdo.large.empty() ? found_by_trying(session) : session.sdo.large;
}
LargeValue needs_large(Session& session) {
    const auto values = large_values(session);
    if (values.empty()) session.bench.skip("no value of the device needs segments");
    return values.front();
}

// Begins an upload, and reads the first segments of it. At least one more is left.
void begin_upload(Session& session, const LargeValue& value, std::size_t segments = 0) {
    const unsigned flags = value.complete ? sdo::kCompleteAccess : 0U;
    const auto reply =
        session.sdo.ask(SdoClient::initiate(sdo::command(coe::request::kUpload, flags), value.index, value.subindex));
    if (!reply.ok()) session.bench.skip(name_of(value) + " cannot be read");
    if ((reply.command & sdo::kExpedited) != 0 ||
        SdoLayout::complete_size::load(reply.message) <= reply.message.size() - SdoLayout::normal_data)
        session.bench.skip("no value of the device needs segments");
    for (std::size_t n = 0; n < segments; ++n)
        if (!session.sdo.ask(SdoClient::segment_request(n % 2 != 0)).ok())
            session.bench.skip(name_of(value) + " cannot be read to its end (segments.upload)");
}
// A fault may begin only behind the first segment: the numbers of segments that come before what a check does.
std::vector<std::size_t> places_in(const LargeValue& value) {
    return value.segments > 1 ? std::vector<std::size_t>{0, 1} : std::vector<std::size_t>{0};
}
std::string place_text(std::size_t segments) { return segments == 0 ? "" : fmt::format(" after {} segment", segments); }

void check_whole_upload(Session& session, const LargeValue& value) {
    auto& bench = session.bench;
    const auto name = name_of(value);
    const auto up = session.sdo.upload(value.index, value.subindex, value.complete);
    if (!up.fault.empty()) bench.fail(fmt::format("{}: {}", name, up.fault));
    if (up.abort != Abort::none)
        bench.fail(fmt::format("{}: the transfer ended after {} of {} octets with {}", name, up.data.size(),
                               up.announced, abort_text(up.abort)));
    if (!up.ok() || up.segments == 0) return;
    const auto room = session.mail.in_bytes() - wire::kMailboxHeaderBytes - coe::kSegmentHeaderBytes;
    const auto needed = (up.announced - up.first_bytes + room - 1) / room;
    if (up.segments > needed)
        bench.remark(fmt::format("{} came in {} segments; the mailbox has room for {}", name, up.segments, needed));
}

// Tries also the values that information.entries could not read to their end.
void check_upload_segments(Session& session) {
    constexpr std::size_t kMost = 8;
    auto values = large_values(session);
    for (const auto& entry : session.sdo.entries) {
        const bool large = entry.bits / 8U + coe::kSdoBytes + wire::kMailboxHeaderBytes > session.mail.in_bytes();
        const auto same = [&](const LargeValue& one) {
            return one.index == entry.index && one.subindex == entry.subindex;
        };
        if (large && (entry.access & coe::access::kReadPreop) != 0 && std::ranges::none_of(values, same))
            values.insert(values.begin(), {entry.index, entry.subindex});
    }
    if (values.empty()) session.bench.skip("no value of the device needs segments");
    if (values.size() > kMost) values.resize(kMost);
    for (const auto& value : values) check_whole_upload(session, value);
}

void check_toggle(Session& session) {
    const auto value = needs_large(session);
    for (const auto before : places_in(value)) {
        begin_upload(session, value, before);
        const bool right = before % 2 != 0;  // the first segment has toggle 0
        const auto reply = session.sdo.ask(SdoClient::segment_request(!right));
        if (reply.abort != Abort::toggle_not_changed)
            session.bench.fail(fmt::format("a segment request with the wrong toggle bit{}: {}, expected {}",
                                           place_text(before), abort_text(reply.abort),
                                           abort_text(Abort::toggle_not_changed)));
        // The transfer is over now.
        if (session.sdo.ask(SdoClient::segment_request(right)).ok())
            session.bench.fail("after the abort of a transfer a segment of it is still sent");
    }
}

void check_without_begin(Session& session) {
    begin_sdo_check(session);
    for (const std::uint8_t specifier : {coe::request::kUploadSegment, coe::request::kDownloadSegment}) {
        const auto reply = session.sdo.ask(SdoClient::initiate(sdo::command(specifier), 0, 0));
        if (reply.abort != Abort::unknown_command)
            session.bench.fail(
                fmt::format("a segment request (command specifier {}) without a transfer: {}, "
                            "expected {}",
                            specifier, abort_text(reply.abort), abort_text(Abort::unknown_command)));
    }
}

// An abort of the master, to which there is no reply.
void abort_transfer(Session& session, std::uint16_t index, std::uint8_t subindex) {
    session.mail.put(wire::MailboxType::coe, SdoClient::initiate(sdo::command(coe::kAbortSpecifier), index, subindex,
                                                                 static_cast<std::uint32_t>(Abort::general)));
    while (const auto mail = session.mail.take(150ms)) {
        const bool answer = mail->header.type == wire::MailboxType::coe && mail->data.size() >= coe::kSdoBytes &&
                            coe::load_header(mail->data).service != coe::Service::emergency;
        if (answer) session.bench.fail("an abort of the master was answered: " + hex(mail->data));
        if (answer) break;
    }
}

// The master ends a transfer, and the slave must discard it.
void check_client_abort(Session& session) {
    const auto value = needs_large(session);
    for (const auto before : places_in(value)) {
        begin_upload(session, value, before);
        abort_transfer(session, value.index, value.subindex);
        if (session.sdo.ask(SdoClient::segment_request(before % 2 != 0)).ok())
            session.bench.fail(fmt::format("after an abort of the master{} a segment of the transfer is still sent",
                                           place_text(before)));
        if (!session.sdo.upload(0x1000, 0).ok())
            session.bench.fail("after an abort of the master object 0x1000 cannot be read");
    }
}

// A new request ends the transfer before it.
void check_new_request(Session& session) {
    const auto value = needs_large(session);
    for (const auto before : places_in(value)) {
        begin_upload(session, value, before);
        bool answered = false;
        try {
            answered = session.sdo.upload(0x1000, 0).ok();
        } catch (const NotJudged&) {  // no reply at all
        }
        if (!answered) session.bench.fail("during a transfer in segments a new request is not answered");
    }
}

// A value that is written back in segments: the first message has no data.
struct Download {
    std::string name{};
    LargeValue value{};
    std::vector<std::byte> data{};
    std::vector<Bytes> pieces{};
    bool must = false;  // it does not fit one message

    void cut(std::size_t room) {
        must = data.size() + coe::kSdoBytes > room;
        // A smaller value comes in the smallest segments, so that there are several.
        const auto piece = must ? room - coe::kSegmentHeaderBytes : coe::kMinSegmentDataBytes;
        for (Bytes rest = data; !rest.empty(); rest = rest.subspan(std::min(piece, rest.size())))
            pieces.push_back(rest.first(std::min(piece, rest.size())));
    }
};

std::optional<Download> own_value(Session& session, const LargeValue& value, std::optional<std::size_t> bytes = {}) {
    auto up = session.sdo.upload(value.index, value.subindex, value.complete);
    if (!up.ok()) return std::nullopt;
    if (bytes) up.data.resize(*bytes);  // without an indicated size there may be more octets
    if (up.data.empty()) return std::nullopt;
    Download download{.name = name_of(value), .value = value, .data = std::move(up.data)};
    download.cut(session.mail.out_bytes() - wire::kMailboxHeaderBytes);
    return download;
}

// A parameter that a master stores and writes back, and that does not fit one message.
bool is_large_parameter(Session& session, const DictionaryEntry& entry) {
    constexpr unsigned kBoth = coe::access::kReadPreop | coe::access::kWritePreop;
    constexpr unsigned kParameter = coe::access::kBackup | coe::access::kSettings;
    return (entry.access & kBoth) == kBoth && (entry.access & kParameter) != 0 &&
           entry.bits / 8U + coe::kSdoBytes + wire::kMailboxHeaderBytes > session.mail.out_bytes();
}

// Values that may be written back: a small one, whose only segment is the last, and one of several segments.
std::vector<Download> downloads(Session& session) {
    begin_sdo_check(session);
    std::vector<Download> found;
    const auto add = [&](std::optional<Download> download) {
        if (download) found.push_back(*std::move(download));
        return download.has_value();
    };
    for (const auto& entry : harmless_entries(session))
        if (add(own_value(session, {entry.index, entry.subindex}, entry.bits / 8U))) break;
    const auto& entries = session.sdo.entries;
    const auto large =
        std::ranges::find_if(entries, [&](const auto& entry) { return is_large_parameter(session, entry); });
    if (large != entries.end() && add(own_value(session, {large->index, large->subindex}))) return found;
    if ((session.bench.slave().coe_details & coe_detail::kCompleteAccess) == 0) return found;
    std::optional<Download> longest;
    for (const auto index : writable_objects(session)) {
        auto one = own_value(session, {index, 0, true});
        if (one && (!longest || one->data.size() > longest->data.size())) longest = std::move(one);
    }
    if (longest && longest->pieces.size() > 1) found.push_back(*std::move(longest));
    return found;
}
std::vector<Download> needs_downloads(Session& session) {
    auto all = downloads(session);
    if (all.empty()) session.bench.skip("the device has no value that the check may write back");
    return all;
}

bool begin_download(Session& session, const Download& download, std::size_t announced) {
    const unsigned flags = sdo::kSizeIndicated | (download.value.complete ? sdo::kCompleteAccess : 0U);
    const auto reply =
        session.sdo.ask(SdoClient::initiate(sdo::command(coe::request::kDownload, flags), download.value.index,
                                            download.value.subindex, static_cast<std::uint32_t>(announced)));
    return reply.ok() && sdo::specifier(reply.command) == coe::response::kDownload;
}
SdoReply send_piece(Session& session, const Download& download, std::size_t n, bool toggle) {
    return session.sdo.ask(SdoClient::segment(toggle, download.pieces[n], n + 1 == download.pieces.size()));
}
// Begins a download and sends the first segments. False: the device refuses it, which segments.download reports.
bool begin_download(Session& session, const Download& download, std::size_t announced, std::size_t segments) {
    bool accepted = begin_download(session, download, announced);
    for (std::size_t n = 0; accepted && n < segments; ++n) accepted = send_piece(session, download, n, n % 2 != 0).ok();
    return accepted;
}

void expect_value(Session& session, const Download& download, std::string_view what) {
    const auto after = session.sdo.upload(download.value.index, download.value.subindex, download.value.complete);
    const auto bytes = std::min(after.data.size(), download.data.size());
    if (!after.ok() || after.data.size() < download.data.size() ||
        !std::ranges::equal(Bytes(after.data).first(bytes), Bytes(download.data)))
        session.bench.fail(fmt::format("{} has another value after {}", download.name, what));
}

// Returns whether all segments were taken.
bool write_all(Session& session, const Download& download) {
    for (std::size_t n = 0; n < download.pieces.size(); ++n) {
        const bool toggle = n % 2 != 0;
        const auto reply = send_piece(session, download, n, toggle);
        if (!reply.ok()) {
            session.bench.fail(fmt::format("{}: segment {} of a download was refused with {}", download.name, n + 1,
                                           abort_text(reply.abort)));
            return false;
        }
        if (sdo::specifier(reply.command) != coe::response::kDownloadSegment ||
            ((reply.command & sdo::kToggle) != 0) != toggle) {
            session.bench.fail(fmt::format("{}: the response to segment {} of a download has the command 0x{:02x}",
                                           download.name, n + 1, reply.command));
            return false;
        }
    }
    return true;
}

void check_download_segments(Session& session) {
    for (const auto& download : needs_downloads(session)) {
        if (begin_download(session, download, download.data.size())) {
            if (write_all(session, download))
                expect_value(session, download, "a download of its own value in segments");
            continue;
        }
        auto text = fmt::format("{}: a download of {} octets is refused when they come in segments", download.name,
                                download.data.size());
        if (download.must)
            session.bench.fail(std::move(text));
        else
            session.bench.remark(std::move(text));
    }
}

void check_download_toggle(Session& session) {
    auto& bench = session.bench;
    for (const auto& download : needs_downloads(session))
        for (std::size_t before = 0; before < std::min<std::size_t>(2, download.pieces.size()); ++before) {
            if (!begin_download(session, download, download.data.size(), before)) break;
            const bool right = before % 2 != 0;  // the first one has toggle 0
            const auto reply = send_piece(session, download, before, !right);
            if (reply.abort != Abort::toggle_not_changed)
                bench.fail(fmt::format("{}: a segment of a download with the wrong toggle bit{}: {}, expected {}",
                                       download.name, place_text(before), abort_text(reply.abort),
                                       abort_text(Abort::toggle_not_changed)));
            if (send_piece(session, download, before, right).ok())
                bench.fail(
                    fmt::format("{}: after the abort of a download a segment of it is still taken", download.name));
        }
}

void check_download_abort(Session& session) {
    bool any = false;
    for (const auto& download : needs_downloads(session)) {
        if (download.pieces.size() < 2 || !begin_download(session, download, download.data.size(), 1)) continue;
        any = true;
        abort_transfer(session, download.value.index, download.value.subindex);
        if (send_piece(session, download, 1, true).ok())
            session.bench.fail(fmt::format("{}: after an abort of the master a segment of the download is still taken",
                                           download.name));
        expect_value(session, download, "a download that the master has aborted");
    }
    if (!any) session.bench.skip("no value that the check may write back has several segments");
}

// The announced length and the length that comes must be equal.
void check_download_length(Session& session) {
    auto& bench = session.bench;
    for (const auto& download : needs_downloads(session)) {
        const auto last = download.pieces.size() - 1;
        if (!begin_download(session, download, download.data.size(), last)) continue;
        const auto shorter = download.pieces[last].first(download.pieces[last].size() - 1);
        if (session.sdo.ask(SdoClient::segment(last % 2 != 0, shorter, true)).ok())
            bench.fail(fmt::format("{}: a download of {} octets was accepted, and {} were announced", download.name,
                                   download.data.size() - 1, download.data.size()));
        if (download.data.size() > 1 && begin_download(session, download, download.data.size() - 1, last) &&
            send_piece(session, download, last, last % 2 != 0).ok())
            bench.fail(fmt::format("{}: a download of {} octets was accepted, and {} were announced", download.name,
                                   download.data.size(), download.data.size() - 1));
        expect_value(session, download, "downloads of a wrong length");
    }
}

constexpr Check kSegmentChecks[] = {
    {"segments.upload", "a large value comes in segments with toggle bits", kSegments, check_upload_segments},
    {"segments.toggle", "a wrong toggle bit of the master ends the transfer with 0x05030000", kAbortCodes,
     check_toggle},
    {"segments.download", "a value can be written in segments", "ETG.1000.6, Download SDO Segment",
     check_download_segments},
    {"segments.download_toggle", "a wrong toggle bit ends a download with 0x05030000", kAbortCodes,
     check_download_toggle},
    {"segments.download_abort", "an abort of the master ends a download", "ETG.1000.6, Abort SDO Transfer",
     check_download_abort},
    {"segments.download_length", "a download is as long as announced", kAbortCodes, check_download_length},
    {"segments.without_begin", "a segment without a transfer is refused with 0x05040001", kAbortCodes,
     check_without_begin},
    {"segments.client_abort", "an abort of the master ends the transfer without a reply",
     "ETG.1000.6, Abort SDO Transfer", check_client_abort},
    {"segments.new_request", "a new request ends the transfer before it", kSegments, check_new_request},
};

}  // namespace

std::span<const Check> segment_checks() { return kSegmentChecks; }

}  // namespace margay::samples::conformance
