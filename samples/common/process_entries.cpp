#include "common/process_entries.hpp"

#include "common/process_struct.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>

namespace margay::samples {
namespace {

// CoE's basic types (ETG.1000.6, "Base data types").
bool is_signed(std::uint8_t type) {
    return (type >= 0x02 && type <= 0x04) || type == 0x10 || (type >= 0x12 && type <= 0x15);
}
bool is_text(std::uint8_t type) { return type == 0x09 || type == 0x0A || type == 0x0B; }

// The template argument for the handle; empty when the entry has to be used as octets.
std::string value_type(const MapEntry& e) {
    if (e.bits == 1 || (e.data_type == 0x01 && e.bits <= 8)) return "bool";
    if (e.data_type == 0x08 && e.bits == 32) return "float";
    if (e.data_type == 0x11 && e.bits == 64) return "double";
    if (e.bits > 64 || is_text(e.data_type)) return {};
    const int width = e.bits <= 8 ? 8 : e.bits <= 16 ? 16 : e.bits <= 32 ? 32 : 64;
    return fmt::format("std::{}int{}_t", is_signed(e.data_type) ? "" : "u", width);
}

class Names {
  public:
    std::string unique(const MapEntry& e) {
        std::string name = identifier(e.pdo_name);
        if (const std::string own = identifier(e.name); !own.empty()) name += (name.empty() ? "" : "_") + own;
        if (name.empty()) name = fmt::format("x{:04x}_{:02x}", e.index, e.subindex);
        name = fmt::format("s{}_{}", e.slave, name);
        std::string candidate = name;
        for (int n = 2; !names_.insert(candidate).second; ++n) candidate = fmt::format("{}_{}", name, n);
        return candidate;
    }

  private:
    std::set<std::string> names_;
};

struct Declaration {
    std::string name;
    std::string text;  // empty: the entry has no declaration
};

std::vector<Declaration> declare(const ProcessMap& map) {
    std::vector<Declaration> all;
    Names names;
    std::set<std::tuple<std::uint16_t, Direction, std::uint16_t, std::uint8_t>> seen;
    for (const MapEntry& e : map.entries) {
        all.emplace_back();
        if (e.pdo == 0 || e.index == 0) continue;
        const std::string type = value_type(e);
        if (type.empty() && e.bits % 8 != 0) continue;
        // Each mapping of an object after the first one is addressed by its place in the PDOs.
        const bool first = seen.emplace(e.slave, e.direction, e.index, e.subindex).second;
        const std::string object = fmt::format("{}, 0x{:04X}, {}", e.slave, e.index, e.subindex);
        const std::string place = fmt::format("margay::EntryAddress::at({}, {}, {}, {})", e.slave, e.sync_manager,
                                              e.pdo_place, e.entry_place);
        const char* const kind = e.direction == Direction::outputs ? "Output" : "Input";
        all.back().name = names.unique(e);
        all.back().text =
            type.empty()
                ? fmt::format("margay::{}Octets {}{{{}, {}}};", kind, all.back().name,
                              first ? fmt::format("margay::EntryAddress::object({})", object) : place, e.bits / 8)
                : fmt::format("margay::{}<{}> {}{{{}}};", kind, type, all.back().name, first ? object : place);
    }
    return all;
}

}  // namespace

std::vector<std::string> entry_declarations(const ProcessMap& map) {
    std::vector<std::string> texts;
    for (Declaration& declaration : declare(map)) texts.push_back(std::move(declaration.text));
    return texts;
}

std::string entries_code(const ProcessMap& map) {
    std::string text;
    std::string list;
    for (const Declaration& declaration : declare(map)) {
        if (declaration.text.empty()) continue;
        text += declaration.text + "\n";
        list += (list.empty() ? "&" : ", &") + declaration.name;
    }
    if (list.empty()) return {};
    return text + fmt::format("margay::EntryHandle* const entries[] = {{{}}};\n", list);
}

}  // namespace margay::samples
