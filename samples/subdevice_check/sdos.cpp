// SDO requests that fit one message: forms of the responses, abort codes, writing.
#include "subdevice_check/check.hpp"
#include "subdevice_check/whole_object.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using coe::SdoLayout;
namespace sdo = coe::sdo;

constexpr std::string_view kUpload = "ETG.1000.6, SDO Upload Expedited";

void check_upload_response(Session& session) {
    begin_sdo_check(session);
    auto& bench = session.bench;
    const auto reply = session.sdo.ask(SdoClient::initiate(sdo::command(coe::request::kUpload), 0x1000, 0));
    if (!reply.ok()) {
        session.sdo.set_dead("object 0x1000 cannot be read (sdo.upload)");
        bench.fail(fmt::format("an upload of object 0x1000 ended with {}", abort_text(reply.abort)));
        return;
    }
    const auto service = coe::load_header(reply.message).service;
    if (service != coe::Service::sdo_response)
        bench.fail(fmt::format("the CoE service of the response is {}, expected 3", static_cast<unsigned>(service)),
                   "ETG.1000.6, CoE header");
    if (sdo::specifier(reply.command) != coe::response::kUpload)
        bench.fail(fmt::format("the response to an upload has the command 0x{:02x}", reply.command));
    const bool expedited = (reply.command & sdo::kExpedited) != 0;
    if ((reply.command & sdo::kSizeIndicated) == 0)
        bench.fail(expedited ? "an expedited response does not indicate its size (bit 0 of the command)"
                             : "a normal response does not indicate its size (bit 0 of the command)");
    if (!expedited) bench.remark("a value of four octets is sent by normal transfer; expedited transfer exists for it");
    const auto up = session.sdo.upload(0x1000, 0);
    if (!up.fault.empty()) bench.fail(up.fault);
    if (!up.expedited && up.announced != 0 && up.first_bytes == 0)
        bench.remark("the first response carries no data; all of it comes in segments",
                     "ETG.1000.6, SDO Upload Normal");
}

void expect_abort(Session& session, const std::string& what, const SdoReply& reply,
                  std::initializer_list<Abort> codes) {
    if (std::ranges::find(codes, reply.abort) != codes.end()) return;
    session.bench.fail(fmt::format("{}: {}, expected {}", what, abort_text(reply.abort), abort_text(*codes.begin())));
}

void check_aborts(Session& session) {
    begin_sdo_check(session);
    const auto upload = sdo::command(coe::request::kUpload);
    const auto download = [](unsigned unused) {
        return sdo::command(coe::request::kDownload,
                            sdo::kExpedited | sdo::kSizeIndicated | unused << sdo::kExpeditedUnusedShift);
    };
    auto& client = session.sdo;
    expect_abort(session, "an upload of object 0x5FFE, which does not exist",
                 client.ask(SdoClient::initiate(upload, 0x5FFE, 0)), {Abort::no_object});
    expect_abort(session, "a download to object 0x5FFE, which does not exist",
                 client.ask(SdoClient::initiate(download(0), 0x5FFE, 0)), {Abort::no_object});
    expect_abort(session, "an upload of 0x1018:c8, which does not exist",
                 client.ask(SdoClient::initiate(upload, 0x1018, 200)), {Abort::no_subindex});
    expect_abort(session, "an upload of 0x1000:01, which does not exist",
                 client.ask(SdoClient::initiate(upload, 0x1000, 1)), {Abort::no_subindex});
    expect_abort(session, "a download to object 0x1000, which is read only",
                 client.ask(SdoClient::initiate(download(0), 0x1000, 0)), {Abort::read_only});
    for (const std::uint8_t specifier : {std::uint8_t{5}, std::uint8_t{6}, std::uint8_t{7}})
        expect_abort(session, fmt::format("a request with the command specifier {}, which does not exist", specifier),
                     client.ask(SdoClient::initiate(sdo::command(specifier), 0x1000, 0)), {Abort::unknown_command});
}

void check_write_only(Session& session) {
    begin_sdo_check(session);
    const auto found = std::ranges::find_if(session.sdo.entries, [](const DictionaryEntry& entry) {
        return (entry.access & coe::access::kRead) == 0 && (entry.access & coe::access::kWrite) != 0;
    });
    if (found == session.sdo.entries.end()) session.bench.skip("the dictionary has no write-only entry");
    expect_abort(
        session, "an upload of the write-only entry " + object_text(found->index, found->subindex),
        session.sdo.ask(SdoClient::initiate(sdo::command(coe::request::kUpload), found->index, found->subindex)),
        {Abort::write_only});
}

// All read-only entries would take long on large dictionaries: the first ones of different objects.
void check_read_only(Session& session) {
    begin_sdo_check(session);
    constexpr std::size_t kMost = 20;
    std::size_t tried = 0;
    std::uint16_t last = 0x1000;  // sdo.aborts tries 0x1000
    for (const auto& entry : session.sdo.entries) {
        constexpr unsigned kWrite = coe::access::kWrite;
        const bool number = entry.bits == 8 || entry.bits == 16 || entry.bits == 32;
        if (!number || (entry.access & kWrite) != 0 || (entry.access & coe::access::kReadPreop) == 0) continue;
        if (entry.index == last && entry.subindex != 1) continue;
        last = entry.index;
        const auto value = session.sdo.upload(entry.index, entry.subindex);
        if (!value.ok() || value.data.size() != entry.bits / 8U) continue;
        const auto abort = session.sdo.download(entry.index, entry.subindex, value.data);
        if (abort != Abort::read_only)
            session.bench.fail(fmt::format("a download of its own value to {}, which is read only: {}, expected {}",
                                           object_text(entry.index, entry.subindex), abort_text(abort),
                                           abort_text(Abort::read_only)));
        if (++tried == kMost) break;
    }
    if (tried == 0) session.bench.skip("the dictionary has no read-only number");
}

void check_entry_write(Session& session) {
    begin_sdo_check(session);
    auto& bench = session.bench;
    const auto entries = harmless_entries(session);
    if (entries.empty()) bench.skip("the dictionary has no writable entry that the check may write back");
    const auto* const entry = entries.data();
    const auto name = object_text(entry->index, entry->subindex);
    auto before = session.sdo.upload(entry->index, entry->subindex);
    if (!before.ok()) bench.skip(name + " cannot be read");
    before.data.resize(entry->bits / 8U);  // without an indicated size there may be more octets
    if (const auto abort = session.sdo.download(entry->index, entry->subindex, before.data); abort != Abort::none)
        bench.fail(fmt::format("{} is writable by its description; its own value was refused with {}", name,
                               abort_text(abort)),
                   "ETG.1000.6, SDO Download");
    // A wrong length must be refused and must not change the value.
    std::vector<std::byte> longer = before.data;
    longer.insert(longer.end(), 2, std::byte{0});
    auto abort = session.sdo.download(entry->index, entry->subindex, longer);
    if (abort != Abort::length_too_high && abort != Abort::length_mismatch)
        bench.fail(fmt::format("two octets too many for {}: {}, expected {}", name, abort_text(abort),
                               abort_text(Abort::length_too_high)));
    if (before.data.size() > 1) {
        abort = session.sdo.download(entry->index, entry->subindex, Bytes(before.data).first(1));
        if (abort != Abort::length_too_low && abort != Abort::length_mismatch)
            bench.fail(fmt::format("one octet for {}, which has {}: {}, expected {}", name, before.data.size(),
                                   abort_text(abort), abort_text(Abort::length_too_low)));
    }
    if (const auto after = session.sdo.upload(entry->index, entry->subindex);
        !after.ok() ||
        !std::ranges::equal(Bytes(after.data).first(std::min(after.data.size(), before.data.size())), before.data))
        bench.fail(fmt::format("a download that was refused has changed {}", name));
}

// Rights that end with PREOP: a download in SAFEOP and OP is refused.
void check_rights(Session& session) {
    session.sdo.needs_sdo();
    auto& bench = session.bench;
    auto entries = harmless_entries(session);
    std::erase_if(entries, [](const DictionaryEntry& entry) {
        return (entry.access & (coe::access::kWrite & ~coe::access::kWritePreop)) != 0;
    });
    constexpr std::size_t kMost = 8;
    if (entries.size() > kMost) entries.resize(kMost);
    if (entries.empty()) bench.skip("the dictionary has no entry with rights for PREOP only that may be written back");
    for (const auto state : {AlState::safeop, AlState::op}) {
        bench.enter(state);
        const auto frames = bench.frames_in(state);
        for (const auto& entry : entries) {
            const auto value = session.sdo.upload(entry.index, entry.subindex);
            if (!value.ok() || value.data.size() != entry.bits / 8U) continue;
            if (session.sdo.download(entry.index, entry.subindex, value.data) != Abort::none) continue;
            bench.fail(fmt::format("{} is writable in PREOP only by its description, and was written in {}",
                                   object_text(entry.index, entry.subindex), state_text(state)));
        }
    }
}

constexpr Check kSdoChecks[] = {
    {"sdo.upload", "the response to an upload has the form of the standard", kUpload, check_upload_response},
    {"sdo.aborts", "wrong requests end with the abort code of the standard", kAbortCodes, check_aborts},
    {"sdo.write_only", "a write-only entry cannot be read", kAbortCodes, check_write_only},
    {"sdo.write", "a value of the right length can be written, one of a wrong length cannot", kAbortCodes,
     check_entry_write},
    {"sdo.read_only", "read-only entries cannot be written", kAbortCodes, check_read_only},
    {"sdo.rights", "an entry that is writable in PREOP only is not written in SAFEOP and OP",
     "ETG.1000.6, SDO Information (object access)", check_rights},
};

}  // namespace

std::span<const Check> sdo_checks() { return kSdoChecks; }

void begin_sdo_check(Session& session) {
    session.sdo.needs_sdo();
    session.bench.enter(AlState::preop);
}

std::vector<DictionaryEntry> harmless_entries(const Session& session) {
    std::vector<DictionaryEntry> entries;
    for (const auto& entry : session.sdo.entries) {
        const bool harmless = entry.index == 0x10F1 || (entry.index == 0x10F3 && entry.subindex == 5) ||
                              (entry.index >= 0x1C32 && entry.index <= 0x1C4F) || is_pdo_assignment(entry.index);
        const bool number = entry.bits == 8 || entry.bits == 16 || entry.bits == 32;
        constexpr unsigned kBoth = coe::access::kReadPreop | coe::access::kWritePreop;
        if (harmless && number && (entry.access & kBoth) == kBoth) entries.push_back(entry);
    }
    return entries;
}

}  // namespace margay::samples::conformance
