#include "common/dictionary_report.hpp"

#include "common/counted.hpp"
#include "common/slave_report.hpp"
#include "wire/coe.hpp"

#include <margay/margay.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <bit>
#include <iterator>

namespace margay::samples {
namespace {

using wire::coe::DataType;
using wire::coe::ObjectCode;

std::string code_text(std::uint8_t code) {
    switch (static_cast<ObjectCode>(code)) {
        case ObjectCode::null: return "NULL";
        case ObjectCode::domain: return "DOMAIN";
        case ObjectCode::deftype: return "DEFTYPE";
        case ObjectCode::defstruct: return "DEFSTRUCT";
        case ObjectCode::variable: return "VAR";
        case ObjectCode::array: return "ARRAY";
        case ObjectCode::record: return "RECORD";
    }
    return fmt::format("code {}", code);
}

std::string type_text(std::uint16_t type) {
    const auto text = wire::coe::to_text(static_cast<DataType>(type));
    return text.empty() || text == "unknown data type" ? fmt::format("{:#06x}", type) : std::string(text);
}

// Access rights as text, with the states in which they apply: PREOP, SAFEOP, OP.
std::string access_text(std::uint16_t access) {
    std::string text =
        (access & 0x38) == 0 ? ((access & 0x07) == 0 ? "--" : "ro") : ((access & 0x07) == 0 ? "wo" : "rw");
    const unsigned reads = access & 7U;
    const unsigned writes = (access >> 3) & 7U;
    if (writes != 0 && writes != 7)
        text += fmt::format(" (w:{}{}{})", (writes & 1U) != 0 ? "P" : "", (writes & 2U) != 0 ? "S" : "",
                            (writes & 4U) != 0 ? "O" : "");
    if (reads != 0 && reads != 7)
        text += fmt::format(" (r:{}{}{})", (reads & 1U) != 0 ? "P" : "", (reads & 2U) != 0 ? "S" : "",
                            (reads & 4U) != 0 ? "O" : "");
    if ((access & 0x40) != 0) text += " RxPDO";
    if ((access & 0x80) != 0) text += " TxPDO";
    return text;
}

std::uint64_t number(std::span<const std::byte> value) {
    std::uint64_t out = 0;
    for (std::size_t i = 0; i < value.size() && i < 8; ++i)
        out |= std::uint64_t{std::to_integer<std::uint8_t>(value[i])} << (8 * i);
    return out;
}

std::int64_t signed_number(std::span<const std::byte> value) {
    const std::uint64_t bits = number(value);
    const unsigned unused = 64 - 8 * static_cast<unsigned>(std::min<std::size_t>(value.size(), 8));
    return unused >= 64 ? 0 : static_cast<std::int64_t>(bits << unused) >> unused;
}

std::string hex(std::span<const std::byte> value) {
    std::string text;
    for (const std::byte b : value) text += fmt::format("{:02x}", std::to_integer<unsigned>(b));
    return text;
}

std::string printable(std::span<const std::byte> value) {
    std::string text;
    for (const std::byte b : value) {
        const auto c = static_cast<unsigned char>(b);
        if (c == 0) break;
        text += c >= 0x20 && c < 0x7F ? std::string(1, static_cast<char>(c)) : fmt::format("\\x{:02x}", c);
    }
    return text;
}

enum class Kind { unsigned_number, signed_number, real, text, octets };

Kind kind_of(std::uint16_t data_type, std::size_t bytes) {
    using enum DataType;
    switch (static_cast<DataType>(data_type)) {
        case visible_string: return Kind::text;
        case integer8:
        case integer16:
        case integer24:
        case integer32:
        case integer40:
        case integer48:
        case integer56:
        case integer64: return bytes <= 8 ? Kind::signed_number : Kind::octets;
        case real32: return bytes == 4 ? Kind::real : Kind::octets;
        case real64: return bytes == 8 ? Kind::real : Kind::octets;
        case octet_string:
        case unicode_string:
        case domain:
        case guid: return Kind::octets;
        default: return bytes >= 1 && bytes <= 8 ? Kind::unsigned_number : Kind::octets;
    }
}

double real(std::span<const std::byte> value) {
    if (value.size() == 4) return std::bit_cast<float>(static_cast<std::uint32_t>(number(value)));
    return std::bit_cast<double>(number(value));
}

void read_value(Context& ctx, std::uint16_t slave, DictionaryEntry& entry) {
    if ((entry.description.access & wire::coe::access::kReadPreop) == 0) {
        entry.problem = entry.description.readable() ? "not readable in PREOP" : "not readable";
        return;
    }
    std::vector<std::byte> buffer(std::max<std::size_t>((entry.description.bit_length + std::size_t{7}) / 8, 256));
    auto read = SDOread(ctx, slave, entry.description.index, entry.description.subindex, false, buffer);
    // The value is longer than its description in the dictionary. The error contains the real length.
    if (!read && read.error().code == Errc::capacity) {
        buffer.resize(read.error().expected);
        read = SDOread(ctx, slave, entry.description.index, entry.description.subindex, false, buffer);
    }
    if (!read) {
        entry.problem = read.error().code == Errc::sdo_abort ? std::string(sdo_abort_text(read.error().detail))
                                                             : sentence(read.error());
        return;
    }
    buffer.resize(*read);
    entry.value = std::move(buffer);
}

DictionaryObject read_object(Context& ctx, std::uint16_t slave, std::uint16_t index) {
    DictionaryObject object;
    const auto described = read_object_description(ctx, slave, index);
    if (!described) {
        object.description.index = index;
        object.problem = sentence(described.error());
        return object;
    }
    object.description = *described;
    for (unsigned n = 0; n <= described->max_subindex; ++n) {
        DictionaryEntry entry;
        const auto found = read_entry_description(ctx, slave, index, static_cast<std::uint8_t>(n));
        if (!found && found.error().code == Errc::sdo_abort) continue;  // a gap: the object has no such subindex
        if (!found) {
            object.problem = sentence(found.error());
            break;
        }
        entry.description = *found;
        read_value(ctx, slave, entry);
        object.entries.push_back(std::move(entry));
    }
    return object;
}

nlohmann::ordered_json value_json(const DictionaryEntry& entry) {
    if (!entry.problem.empty()) return nullptr;
    switch (kind_of(entry.description.data_type, entry.value.size())) {
        case Kind::unsigned_number: return number(entry.value);
        case Kind::signed_number: return signed_number(entry.value);
        case Kind::real: return real(entry.value);
        case Kind::text: return printable(entry.value);
        case Kind::octets: break;
    }
    return hex(entry.value);
}

}  // namespace

Dictionary read_dictionary(Context& ctx, std::uint16_t slave) {
    Dictionary dictionary;
    std::vector<std::uint16_t> indices;
    const auto listed = read_object_list(
        ctx, slave, ObjectList::all,
        [](std::span<const std::uint16_t> some, void* user) {
            auto& all = *static_cast<std::vector<std::uint16_t>*>(user);
            all.insert(all.end(), some.begin(), some.end());
        },
        &indices);
    if (!listed) {
        dictionary.problem = sentence(listed.error());
        return dictionary;
    }
    for (const std::uint16_t index : indices) dictionary.objects.push_back(read_object(ctx, slave, index));
    return dictionary;
}

std::string value_text(std::uint16_t data_type, std::span<const std::byte> value) {
    constexpr std::size_t kMostOctets = 32;
    switch (kind_of(data_type, value.size())) {
        case Kind::unsigned_number: {
            const auto n = number(value);
            return n < 10 ? fmt::format("{}", n) : fmt::format("{} (0x{:0{}x})", n, n, 2 * value.size());
        }
        case Kind::signed_number: return fmt::format("{}", signed_number(value));
        case Kind::real: return fmt::format("{}", real(value));
        case Kind::text: return fmt::format("\"{}\"", printable(value));
        case Kind::octets: break;
    }
    if (value.empty()) return "(empty)";
    if (value.size() <= kMostOctets) return hex(value);
    return fmt::format("{} … ({})", hex(value.first(kMostOctets)), counted(value.size(), "octet"));
}

std::string dictionary_text(const Dictionary& dictionary) {
    if (!dictionary.problem.empty()) return fmt::format("  Dictionary        none: {}\n", dictionary.problem);
    std::string text = fmt::format("  Dictionary        {}\n", counted(dictionary.objects.size(), "object"));
    for (const DictionaryObject& object : dictionary.objects) {
        const auto& d = object.description;
        text += fmt::format("    {:#06x}     {:<9} {}\n", d.index, code_text(d.object_code), words_of_slave(d.name()));
        for (const DictionaryEntry& entry : object.entries) {
            const auto& e = entry.description;
            text += fmt::format(
                "      :{:<3}     {:<16} {:>4} bit  {:<8} {} = {}\n", e.subindex, type_text(e.data_type), e.bit_length,
                access_text(e.access), words_of_slave(e.name()),
                entry.problem.empty() ? value_text(e.data_type, entry.value) : fmt::format("({})", entry.problem));
        }
        if (!object.problem.empty()) text += fmt::format("      ({})\n", object.problem);
    }
    return text;
}

nlohmann::ordered_json dictionary_json(const Dictionary& dictionary) {
    auto objects = nlohmann::ordered_json::array();
    for (const DictionaryObject& object : dictionary.objects) {
        auto entries = nlohmann::ordered_json::array();
        for (const DictionaryEntry& entry : object.entries) {
            const auto& e = entry.description;
            entries.push_back({{"subindex", e.subindex},
                               {"name", words_of_slave(e.name())},
                               {"data_type", e.data_type},
                               {"data_type_text", type_text(e.data_type)},
                               {"bit_length", e.bit_length},
                               {"access", e.access},
                               {"access_text", access_text(e.access)},
                               {"value", value_json(entry)},
                               {"octets", entry.problem.empty() ? nlohmann::ordered_json(hex(entry.value))
                                                                : nlohmann::ordered_json(nullptr)},
                               {"problem", entry.problem.empty() ? nlohmann::ordered_json(nullptr)
                                                                 : nlohmann::ordered_json(entry.problem)}});
        }
        objects.push_back({{"index", object.description.index},
                           {"name", words_of_slave(object.description.name())},
                           {"object_code", code_text(object.description.object_code)},
                           {"data_type", object.description.data_type},
                           {"max_subindex", object.description.max_subindex},
                           {"problem", object.problem.empty() ? nlohmann::ordered_json(nullptr)
                                                              : nlohmann::ordered_json(object.problem)},
                           {"entries", entries}});
    }
    return {{"problem",
             dictionary.problem.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(dictionary.problem)},
            {"objects", objects}};
}

}  // namespace margay::samples
