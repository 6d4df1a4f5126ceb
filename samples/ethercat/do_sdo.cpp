// The commands sdos, upload, download.
#include "common/program.hpp"
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"
#include "ethercat/values.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace margay::ethercat {
namespace {

// "rwr-r-": readable and writable in PREOP, SAFEOP, OP.
std::string rights_text(std::uint16_t access) {
    std::string text;
    for (unsigned state = 0; state < 3; ++state) {
        text += (access & (1U << state)) != 0 ? 'r' : '-';
        text += (access & (8U << state)) != 0 ? 'w' : '-';
    }
    return text;
}

bool has_coe(const SlaveFacts& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0;
}

// A hint for new users of a simulated segment.
std::string hint(const Call& call) {
    const auto source = call.value("source");
    return source.starts_with("sim:") && source != "sim:drives" ? "; --source sim:drives has slaves with one" : "";
}

Answer<> check_coe(const Call& call, const SlaveFacts& slave) {
    if (has_coe(slave)) return {};
    return Problem{fmt::format("position {}: the slave has no object dictionary: its mailbox does not support CoE{}",
                               slave.position, hint(call))};
}

// The one slave of a command for an object.
Answer<SelectedSlave> slave_with_objects(Call& call) {
    const auto slave = call.one_slave();
    if (!slave) return slave;
    if (const auto checked = check_coe(call, slave->slave); !checked) return checked.problem();
    return slave;
}

struct Place {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete = false;
};

Answer<Place> place_of(const std::vector<std::string>& words, std::size_t count) {
    const auto index = Call::number("INDEX", words[0], 0xFFFF);
    if (!index) return index.problem();
    Place place{.index = static_cast<std::uint16_t>(*index), .complete = count == 1};
    if (count == 1) return place;
    const auto subindex = Call::number("SUBINDEX", words[1], 0xFF);
    if (!subindex) return subindex.problem();
    place.subindex = static_cast<std::uint8_t>(*subindex);
    return place;
}

// Without SUBINDEX, an object of one value is read as its subindex 0. In other objects, subindex 0 is the number of
// entries, with 8 bits.
Place place_to_read(const SelectedSlave& slave, Place place) {
    if (!place.complete) return place;
    const auto entry = [&](std::uint8_t subindex) {
        return slave.session().dictionary_entry(slave.position(), place.index, subindex);
    };
    const auto first = entry(0);
    place.complete = !first || (first->bits <= 8 && (entry(1) || entry(2)));  // subindex 1 may be a gap
    return place;
}

Answer<const DataType*> type_of(const Call& call, const SelectedSlave& slave, const Place& place) {
    const auto named = named_type(call);
    if (!named || *named != nullptr) return named;
    if (place.complete) return type_by_name("octet_string");
    const auto entry = slave.session().dictionary_entry(slave.position(), place.index, place.subindex);
    if (!entry)
        return Problem{fmt::format("the type of the entry is not known: {}; with --type the dictionary is not asked",
                                   entry.problem().text)};
    const auto* type = type_by_code(entry->data_type);
    if (type == nullptr)
        return Problem{fmt::format("entry 0x{:04x}:{:02x} has {} of the standard, which has no name here: use --type",
                                   place.index, place.subindex, type_text(entry->data_type))};
    return type;
}

Answer<> add_dictionary(const Call& call, const SelectedSlave& slave, Output& output) {
    const auto objects = slave.session().dictionary(slave.position(), !call.has("quiet"));
    if (!objects) return objects.problem();
    auto all = nlohmann::ordered_json::array();
    for (const auto& object : *objects) {
        output.text += fmt::format("SDO 0x{:04x}, \"{}\"\n", object.index, object.name);
        auto entries = nlohmann::ordered_json::array();
        for (const auto& entry : object.entries) {
            output.text += fmt::format("  0x{:04x}:{:02x}, {}, {}, {} bit, \"{}\"\n", object.index, entry.subindex,
                                       rights_text(entry.access), type_text(entry.data_type), entry.bits, entry.name);
            entries.push_back({{"subindex", entry.subindex},
                               {"access", rights_text(entry.access)},
                               {"type", type_text(entry.data_type)},
                               {"data_type", entry.data_type},
                               {"bits", entry.bits},
                               {"name", entry.name}});
        }
        nlohmann::ordered_json json{{"index", object.index}, {"name", object.name}};
        if (!call.has("quiet")) json["entries"] = entries;
        all.push_back(std::move(json));
    }
    output.json["slaves"].push_back({{"position", slave.position()}, {"objects", all}});
    return {};
}

}  // namespace

int run_sdos(Call& call) {
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto selected = call.selected(master);
        if (!selected) return selected.problem();
        output.json["slaves"] = nlohmann::ordered_json::array();
        if (selected->size() > 1 && std::ranges::none_of(*selected, has_coe))
            call.warn(fmt::format("no slave of master {} has an object dictionary (CoE){}", master.index, hint(call)));
        return Call::each_slave(*selected, output, [&](const SlaveFacts& slave) -> Answer<> {
            if (!has_coe(slave) && selected->size() > 1) return {};
            if (const auto checked = check_coe(call, slave); !checked) return checked;
            if (selected->size() > 1) output.text += slave_heading(master, slave);
            return add_dictionary(call, {&master, slave}, output);
        });
    });
}

int run_upload(Call& call) {
    const auto named = place_of(call.words(), call.words().size());
    if (!named) return call.fail(named.problem());
    const auto slave = slave_with_objects(call);
    if (!slave) return call.fail(slave.problem());
    const Place place = place_to_read(*slave, *named);
    const auto type = type_of(call, *slave, place);
    if (!type) return call.fail(type.problem());
    const auto value = slave->session().upload(slave->position(), place.index, place.subindex, place.complete);
    if (!value && place.complete)
        return call.fail(Problem{value.problem().text + " (without SUBINDEX all entries are read together; 0 is the "
                                                        "SUBINDEX of an object of one value)",
                                 value.problem().code});
    if (!value) return call.fail(value.problem());
    Output output;
    output.json = place_json(*slave);
    output.json["index"] = place.index;
    output.json["subindex"] = place.complete ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(place.subindex);
    output.json["type"] = (*type)->name;
    output.json["value"] = value_json(**type, *value);
    output.json["octets"] = hex(*value);
    if (call.has("output-file")) return call.print(output, *value);
    const auto text = value_text(**type, *value);
    if (!text) return call.fail(text.problem());
    output.text = *text + "\n";
    return call.print(output);
}

int run_download(Call& call) {
    const auto place = place_of(call.words(), call.words().size() - 1);
    if (!place) return call.fail(place.problem());
    const auto slave = slave_with_objects(call);
    if (!slave) return call.fail(slave.problem());
    const auto type = type_of(call, *slave, *place);
    if (!type) return call.fail(type.problem());
    const auto octets = value_argument(**type, call.words().back());
    if (!octets) return call.fail(octets.problem());
    const auto done =
        slave->session().download(slave->position(), place->index, place->subindex, place->complete, *octets);
    if (!done) {
        auto problem = done.problem();
        if (place->complete)
            problem.text +=
                " (without SUBINDEX the command writes the whole object by complete access, where subindex 0 "
                "takes two octets; an object of one value has subindex 0)";
        return call.fail(std::move(problem));
    }
    if (!call.json()) return samples::exit_code::kWell;
    Output output;
    output.json = place_json(*slave);
    output.json["index"] = place->index;
    output.json["written"] = hex(*octets);
    return call.print(output);
}

}  // namespace margay::ethercat
