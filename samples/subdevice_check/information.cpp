// The object dictionary: compares the SDO information service with the objects and with the SII.
#include "subdevice_check/check.hpp"

#include <algorithm>
#include <iterator>
#include <set>

namespace margay::samples::conformance {
namespace {

using coe::InfoLayout;
using coe::InfoOpcode;
using coe::ListType;

constexpr std::string_view kInformation = "ETG.1000.6, SDO Information";

// The data of a response from its service data on, of all fragments.
struct InfoReply {
    Abort abort = Abort::none;
    std::string fault{};
    std::vector<std::byte> data{};
    [[nodiscard]] bool ok() const { return abort == Abort::none && fault.empty(); }
};

std::vector<std::byte> request(InfoOpcode opcode, std::size_t bytes) {
    std::vector<std::byte> data(bytes);
    coe::store_header(data, {0, coe::Service::sdo_information});
    InfoLayout::opcode::store(data, static_cast<std::uint8_t>(opcode));
    return data;
}

bool is_information(const Mail& mail) {
    return mail.header.type == wire::MailboxType::error ||
           (mail.header.type == wire::MailboxType::coe && mail.data.size() >= coe::kInfoHeaderBytes &&
            coe::load_header(mail.data).service == coe::Service::sdo_information);
}

InfoReply ask(Session& session, Bytes message, InfoOpcode expected) {
    InfoReply reply;
    auto mail = session.mail.ask(wire::MailboxType::coe, message, is_information);
    std::optional<unsigned> left;
    for (;;) {
        if (mail.header.type == wire::MailboxType::error) {
            reply.fault = "a mailbox error, " + hex(mail.data);
            return reply;
        }
        const auto opcode = InfoLayout::opcode::load(mail.data);
        if (static_cast<InfoOpcode>(opcode & ~coe::kInfoIncomplete) == InfoOpcode::error) {
            reply.abort =
                mail.data.size() >= coe::kInfoErrorBytes ? InfoLayout::abort::load(mail.data) : Abort::general;
            return reply;
        }
        if (static_cast<InfoOpcode>(opcode & ~coe::kInfoIncomplete) != expected) {
            reply.fault = fmt::format("the opcode of the response is {}", opcode & ~coe::kInfoIncomplete);
            return reply;
        }
        const unsigned fragments = InfoLayout::fragments_left::load(mail.data);
        if (left && fragments + 1 != *left) reply.fault = fmt::format("{} fragments left after {}", fragments, *left);
        if (((opcode & coe::kInfoIncomplete) != 0) != (fragments != 0))
            reply.fault = fmt::format("{} fragments left, and the bit incomplete says something else", fragments);
        left = fragments;
        reply.data.insert(reply.data.end(), mail.data.begin() + coe::kInfoHeaderBytes, mail.data.end());
        if (fragments == 0 || !reply.fault.empty()) return reply;
        auto next = session.mail.take(MailBench::kResponse);
        while (next && !is_information(*next)) {
            session.mail.unasked(*next);
            next = session.mail.take(MailBench::kResponse);
        }
        if (!next) {
            reply.fault = fmt::format("{} fragments are missing", fragments);
            return reply;
        }
        mail = *std::move(next);
    }
}

InfoReply list(Session& session, ListType type) {
    auto message = request(InfoOpcode::list_request, coe::kListRequestBytes);
    InfoLayout::list_type::store(message, static_cast<std::uint16_t>(type));
    return ask(session, message, InfoOpcode::list_response);
}
InfoReply object(Session& session, std::uint16_t index) {
    auto message = request(InfoOpcode::object_request, coe::kObjectRequestBytes);
    InfoLayout::index::store(message, index);
    return ask(session, message, InfoOpcode::object_response);
}
InfoReply entry(Session& session, std::uint16_t index, std::uint8_t subindex, std::uint8_t value_info = 0) {
    auto message = request(InfoOpcode::entry_request, coe::kEntryRequestBytes);
    InfoLayout::index::store(message, index);
    InfoLayout::entry_subindex::store(message, subindex);
    InfoLayout::entry_value_info::store(message, value_info);
    return ask(session, message, InfoOpcode::entry_response);
}

std::vector<std::uint16_t> indices_of(const InfoReply& reply) {
    std::vector<std::uint16_t> indices;
    for (std::size_t at = 2; at + 2 <= reply.data.size(); at += 2)
        indices.push_back(load_le<std::uint16_t>(reply.data, at));
    return indices;
}

void begin_information_check(Session& session) {
    session.sdo.needs_sdo();
    if ((session.bench.slave().coe_details & coe_detail::kSdoInformation) == 0)
        session.bench.skip("the SII does not announce SDO information");
    session.bench.enter(AlState::preop);
}

void check_object_lists(Session& session) {
    begin_information_check(session);
    auto& bench = session.bench;
    const auto lengths = list(session, ListType::lengths);
    if (!lengths.ok() || lengths.data.size() < 12) {
        bench.fail(fmt::format("the lengths of the lists cannot be read: {}, {} octets",
                               reason_text(lengths.fault, lengths.abort), lengths.data.size()));
        return;
    }
    std::set<std::uint16_t> all;
    for (std::uint16_t type = 1; type <= coe::kLastListType; ++type) {
        const auto reply = list(session, static_cast<ListType>(type));
        const auto announced = load_le<std::uint16_t>(lengths.data, 2U * type);
        if (!reply.ok()) {
            bench.fail(fmt::format("list {} cannot be read: {}", type, reason_text(reply.fault, reply.abort)));
            continue;
        }
        if (reply.data.size() >= 2 && load_le<std::uint16_t>(reply.data, 0) != type)
            bench.fail(fmt::format("a request for list {} is answered with list {}", type,
                                   load_le<std::uint16_t>(reply.data, 0)),
                       "ETG.1000.6, Get OD List Response");
        const auto indices = indices_of(reply);
        if (indices.size() != announced)
            bench.fail(fmt::format("list {} has {} objects, and the list of lengths says {}", type, indices.size(),
                                   announced));
        if (!std::ranges::is_sorted(indices)) bench.remark(fmt::format("list {} is not in ascending order", type));
        if (type == 1) all.insert(indices.begin(), indices.end());
        for (const auto index : indices)
            if (all.count(index) == 0)
                bench.fail(fmt::format("object 0x{:04x} of list {} is not in the list of all objects", index, type));
    }
    for (const std::uint16_t index : {std::uint16_t{0x1000}, std::uint16_t{0x1018}})
        if (all.count(index) == 0)
            bench.fail(fmt::format("the mandatory object 0x{:04x} is not in the list of all objects", index),
                       "ETG.1000.6, Object Dictionary");
}

// The size of a number; nullopt: the type has no size of its own, or devices do not agree about it (BOOLEAN).
std::optional<unsigned> bits_of(coe::DataType type) {
    using enum coe::DataType;
    switch (type) {
        case integer8:
        case unsigned8: return 8;
        case integer16:
        case unsigned16: return 16;
        case integer32:
        case unsigned32:
        case real32: return 32;
        case integer64:
        case unsigned64:
        case real64: return 64;
        default: return std::nullopt;
    }
}

// One entry: compares its description by the service with an upload.
struct EntryCheck {
    Session& session;
    std::size_t findings = 0;

    void fail(std::string text) {
        if (++findings <= kMostFindings) session.bench.fail(std::move(text));
    }
    void check(std::uint16_t index, std::uint8_t subindex, std::uint8_t code);
    void compare(const DictionaryEntry& entry, bool list);
};

// The subindices of a list that is filled at run time (0x1003, 0x10F3) exist up to the count in subindex 0.
bool beyond_count(Session& session, const DictionaryEntry& entry, Abort abort) {
    if (entry.subindex == 0 || abort == Abort::none) return false;
    const auto count = session.sdo.number(entry.index, 0);
    return count && entry.subindex > *count;
}

void EntryCheck::check(std::uint16_t index, std::uint8_t subindex, std::uint8_t code) {
    const auto reply = entry(session, index, subindex);
    if (!reply.ok()) {
        // The subindices of a record may have gaps.
        const bool gap = reply.abort == Abort::no_subindex && subindex != 0 &&
                         code != static_cast<std::uint8_t>(coe::ObjectCode::variable);
        if (!gap)
            fail(fmt::format("{}: no description, {}", object_text(index, subindex),
                             reason_text(reply.fault, reply.abort)));
        return;
    }
    if (reply.data.size() < coe::kEntryResponseBytes - coe::kInfoHeaderBytes) {
        fail(fmt::format("{}: the description has {} octets", object_text(index, subindex), reply.data.size()));
        return;
    }
    // The offsets of the layout count from the CoE header.
    const auto word = [&](std::size_t at) { return load_le<std::uint16_t>(reply.data, at - coe::kInfoHeaderBytes); };
    if (word(6) != index || std::to_integer<std::uint8_t>(reply.data[2]) != subindex)
        fail(fmt::format("{}: the response describes 0x{:04x}", object_text(index, subindex), word(6)));
    const DictionaryEntry described{index, subindex, static_cast<coe::DataType>(word(10)), word(12), word(14)};
    if (const auto bits = bits_of(described.type); bits && *bits != described.bits)
        fail(fmt::format("{} has {} bits by its description, and its data type {} has {}", object_text(index, subindex),
                         described.bits, coe::to_text(described.type), *bits));
    session.sdo.entries.push_back(described);
    compare(described, code != static_cast<std::uint8_t>(coe::ObjectCode::variable));
}

void EntryCheck::compare(const DictionaryEntry& entry, bool list) {
    const auto name = object_text(entry.index, entry.subindex);
    const auto up = session.sdo.upload(entry.index, entry.subindex);
    if ((entry.access & coe::access::kReadPreop) == 0) {
        if (up.ok()) fail(fmt::format("{} is not readable in PREOP by its description, and was read", name));
        return;
    }
    if (list && beyond_count(session, entry, up.abort)) return;
    if (!up.ok()) {
        fail(fmt::format("{} is readable by its description, and an upload ended with {}", name,
                         reason_text(up.fault, up.abort)));
        return;
    }
    const bool text = entry.type == coe::DataType::visible_string || entry.type == coe::DataType::octet_string ||
                      entry.type == coe::DataType::unicode_string || entry.type == coe::DataType::domain;
    const std::size_t bytes = (entry.bits + 7U) / 8U;
    if (!text && up.size_indicated && up.data.size() != bytes)
        fail(fmt::format("{} has {} bits by its description, and an upload returned {} octets", name, entry.bits,
                         up.data.size()));
    if (up.segments == 0) return;
    auto& large = session.sdo.large;
    const auto at = std::ranges::find_if(large, [&](const LargeValue& one) { return one.segments < up.segments; });
    large.insert(at, {entry.index, entry.subindex, false, up.segments});
}

void check_entries(Session& session) {
    begin_information_check(session);
    const auto reply = list(session, ListType::all);
    if (!reply.ok()) session.bench.skip("the list of all objects cannot be read (information.lists)");
    EntryCheck check{session};
    session.sdo.entries.clear();
    session.sdo.large.clear();
    session.sdo.entries_complete = false;
    for (const auto index : indices_of(reply)) {
        const auto described = object(session, index);
        if (!described.ok() || described.data.size() < coe::kObjectResponseBytes - coe::kInfoHeaderBytes) {
            check.fail(
                fmt::format("0x{:04x}: no description, {}", index, reason_text(described.fault, described.abort)));
            continue;
        }
        if (const auto other = load_le<std::uint16_t>(described.data, 0); other != index)
            check.fail(fmt::format("0x{:04x}: the response describes 0x{:04x}", index, other));
        const auto top = std::to_integer<unsigned>(described.data[4]);
        const auto code = std::to_integer<std::uint8_t>(described.data[5]);
        if (code == static_cast<std::uint8_t>(coe::ObjectCode::variable) && top != 0)
            check.fail(fmt::format("0x{:04x} is a variable with {} subindices", index, top));
        if (index < 0x1000) continue;  // definitions of types have no values
        for (unsigned n = 0; n <= top; ++n) check.check(index, static_cast<std::uint8_t>(n), code);
    }
    session.sdo.entries_complete = true;
    if (check.findings > kMostFindings)
        session.bench.fail(
            fmt::format("{} more entries do not agree with their descriptions", check.findings - kMostFindings));
}

bool is_signed(coe::DataType type) {
    using enum coe::DataType;
    return type == integer8 || type == integer16 || type == integer32 || type == integer64;
}

// A number of up to eight octets, in the order of the type: signed numbers with their sign bit inverted.
std::uint64_t ordered_number(Bytes octets, coe::DataType type) {
    std::uint64_t number = 0;
    for (std::size_t n = 0; n < octets.size(); ++n) number |= std::to_integer<std::uint64_t>(octets[n]) << (8 * n);
    return is_signed(type) ? number ^ std::uint64_t{1} << (8 * octets.size() - 1) : number;
}
std::string number_text(Bytes octets, coe::DataType type) {
    const auto ordered = ordered_number(octets, type);
    if (!is_signed(type)) return fmt::format("{}", ordered);
    return fmt::format("{}", static_cast<std::int64_t>(ordered - (std::uint64_t{1} << (8 * octets.size() - 1))));
}

// The value of an entry against the limits that its description has.
void check_entry_limits(Session& session, const DictionaryEntry& described) {
    using enum coe::DataType;
    const auto size = bits_of(described.type);
    if (!size || *size != described.bits || described.type == real32 || described.type == real64) return;
    constexpr std::uint8_t kBoth = coe::value_info::kMinimum | coe::value_info::kMaximum;
    const auto reply = entry(session, described.index, described.subindex, kBoth);
    const std::size_t bytes = *size / 8U;
    const std::size_t head = coe::kEntryResponseBytes - coe::kInfoHeaderBytes;
    if (!reply.ok() || reply.data.size() < head + 2 * bytes) return;  // information.entries has checked the head
    if ((std::to_integer<unsigned>(reply.data[3]) & 0x78U) != kBoth) return;
    const Bytes minimum = Bytes(reply.data).subspan(head, bytes);
    const Bytes maximum = Bytes(reply.data).subspan(head + bytes, bytes);
    const auto order = [&](Bytes octets) { return ordered_number(octets, described.type); };
    const auto text = [&](Bytes octets) { return number_text(octets, described.type); };
    const auto name = object_text(described.index, described.subindex);
    if (order(minimum) > order(maximum))
        return session.bench.fail(fmt::format("{}: no value is possible from the minimum {} to the maximum {}", name,
                                              text(minimum), text(maximum)));
    if ((described.access & coe::access::kReadPreop) == 0) return;
    const auto up = session.sdo.upload(described.index, described.subindex);
    if (!up.ok() || up.data.size() != bytes) return;
    if (order(up.data) < order(minimum) || order(up.data) > order(maximum))
        session.bench.fail(fmt::format("{} is {}, outside of its own limits {} to {}", name, text(up.data),
                                       text(minimum), text(maximum)));
}

void check_limits(Session& session) {
    begin_information_check(session);
    if (!session.sdo.entries_complete) session.bench.skip("the entries were not read (information.entries)");
    const auto entries = session.sdo.entries;
    for (const auto& described : entries) check_entry_limits(session, described);
}

// The lists of objects that can be mapped, stored and set, against the access bits of the entries.
void check_uses(Session& session) {
    begin_information_check(session);
    if (!session.sdo.entries_complete) session.bench.skip("the entries were not read (information.entries)");
    constexpr std::pair<ListType, std::uint16_t> kLists[] = {{ListType::rx_mappable, coe::access::kRxMappable},
                                                             {ListType::tx_mappable, coe::access::kTxMappable},
                                                             {ListType::backup, coe::access::kBackup},
                                                             {ListType::settings, coe::access::kSettings}};
    for (const auto& [type, access] : kLists) {
        const auto reply = list(session, type);
        if (!reply.ok()) continue;  // information.lists reports it
        std::set<std::uint16_t> listed;
        for (const auto index : indices_of(reply))
            if (index >= 0x1000) listed.insert(index);
        std::set<std::uint16_t> described;
        for (const auto& entry : session.sdo.entries)
            if ((entry.access & access) != 0) described.insert(entry.index);
        const auto number = static_cast<unsigned>(type);
        if (listed.empty() && !described.empty()) {
            session.bench.remark(
                fmt::format("list {} is empty, and {} objects have the access bit 0x{:04x} of it by their descriptions",
                            number, described.size(), access));
            continue;
        }
        std::vector<std::uint16_t> wrong;
        std::ranges::set_symmetric_difference(listed, described, std::back_inserter(wrong));
        if (wrong.size() > kMostFindings) wrong.resize(kMostFindings);
        for (const auto index : wrong)
            session.bench.fail(
                fmt::format("object 0x{:04x} is {}in list {}, and by its description it has the access "
                            "bit 0x{:04x} {}",
                            index, listed.contains(index) ? "" : "not ", number, access,
                            described.contains(index) ? "in an entry" : "in no entry"));
    }
}

// Subindex 0 of records and arrays is the highest subindex that exists now; the description has the highest possible.
void check_subindices(Session& session) {
    begin_information_check(session);
    const auto reply = list(session, ListType::all);
    if (!reply.ok()) session.bench.skip("the list of all objects cannot be read (information.lists)");
    for (const auto index : indices_of(reply)) {
        if (index < 0x1000) continue;  // definitions of types
        const auto described = object(session, index);
        if (!described.ok() || described.data.size() < coe::kObjectResponseBytes - coe::kInfoHeaderBytes) continue;
        const auto top = std::to_integer<unsigned>(described.data[4]);
        if (std::to_integer<std::uint8_t>(described.data[5]) == static_cast<std::uint8_t>(coe::ObjectCode::variable))
            continue;
        const auto count = session.sdo.number(index, 0);
        if (count && *count > top)
            session.bench.fail(fmt::format(
                "0x{:04x} has at most {} subindices by its description, and subindex 0 is {}", index, top, *count));
        else if (count && *count < top && index == 0x1018)  // the others may be lists that grow
            session.bench.fail(
                fmt::format("0x1018 has {} subindices by its description, and subindex 0 is {}", top, *count));
    }
}

void check_errors(Session& session) {
    begin_information_check(session);
    const auto absent = object(session, 0x5FFE);
    if (absent.abort != Abort::no_object)
        session.bench.fail(fmt::format("the description of object 0x5FFE, which does not exist: {}, expected {}",
                                       reason_text(absent.fault, absent.abort), abort_text(Abort::no_object)));
    const auto subindex = entry(session, 0x1018, 200);
    if (subindex.abort != Abort::no_subindex && subindex.abort != Abort::no_object)
        session.bench.fail(fmt::format("the description of 0x1018:c8, which does not exist: {}, expected {}",
                                       reason_text(subindex.fault, subindex.abort), abort_text(Abort::no_subindex)));
    if (list(session, static_cast<ListType>(0x7F)).ok())
        session.bench.remark("list 127, which does not exist, is answered without an error");
}

// 0x1018 and 0x1000 against the SII: a master identifies the device by both.
void check_identity(Session& session) {
    begin_sdo_check(session);
    auto& bench = session.bench;
    const auto& identity = bench.slave().identity;
    const struct {
        std::uint8_t subindex;
        std::string_view name;
        std::uint32_t sii;
    } kParts[] = {{1, "vendor", identity.vendor},
                  {2, "product code", identity.product},
                  {3, "revision", identity.revision},
                  {4, "serial number", identity.serial}};
    for (const auto& part : kParts) {
        const auto up = session.sdo.upload(0x1018, part.subindex);
        if (part.subindex > 1 && up.abort == Abort::no_subindex) continue;
        if (!up.ok() || up.data.size() != 4) {
            bench.fail(fmt::format("{} ({}) cannot be read: {}", object_text(0x1018, part.subindex), part.name,
                                   reason_text(up.fault, up.abort)));
            continue;
        }
        const auto value = load_le<std::uint32_t>(up.data, 0);
        if (value == part.sii) continue;
        const auto text =
            fmt::format("the {} is 0x{:08x} in object 0x1018 and 0x{:08x} in the SII", part.name, value, part.sii);
        if (part.subindex <= 2)
            bench.fail(text);
        else
            bench.remark(text);
    }
    if (const auto type = session.sdo.upload(0x1000, 0); !type.ok() || type.data.size() != 4)
        bench.fail(
            fmt::format("the device type 0x1000 cannot be read as 32 bits: {}", reason_text(type.fault, type.abort)));
}

constexpr Check kInformationChecks[] = {
    {"information.identity", "objects 0x1000 and 0x1018 exist and agree with the SII", "ETG.1000.6, Object Dictionary",
     check_identity},
    {"information.lists", "the lists of objects agree with their lengths", kInformation, check_object_lists},
    {"information.entries", "each entry is what its description says", kInformation, check_entries},
    {"information.limits", "each value is within the limits of its description", kInformation, check_limits},
    {"information.uses", "the lists of mappable and stored objects agree with the descriptions", kInformation,
     check_uses},
    {"information.subindices", "subindex 0 agrees with the description of its object", kInformation, check_subindices},
    {"information.errors", "what does not exist is refused with its abort code", kInformation, check_errors},
};

}  // namespace

std::span<const Check> information_checks() { return kInformationChecks; }

}  // namespace margay::samples::conformance
