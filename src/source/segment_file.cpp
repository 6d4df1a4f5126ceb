#include "source/segment_file.hpp"

#include "source/ready_made.hpp"
#include "source/segment_chip.hpp"
#include "source/segment_line.hpp"
#include "source/sii_file.hpp"

#include "sim/devices.hpp"
#include "sim/library/quirks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

namespace margay::hosted {

namespace {

using sim::kMaxPorts;

// This segment is built into the program, so that "demo" needs no file.
constexpr const char* kDemo = R"(
title = "A coupler with digital and analogue terminals"

[[slave]]
name = "coupler"
device = "coupler"

[[slave]]
name = "inputs"
device = "digital_in_8"

[[slave]]
name = "outputs"
device = "digital_out_8"

[[slave]]
name = "measuring"
device = "analog_in_4"

[[slave]]
name = "setting"
device = "analog_out_2"
)";

bool exists(const sim::EscDescription& chip, unsigned port) {
    return port < kMaxPorts && chip.ports[port].kind >= wire::PortKind::ebus;
}

// Builds a segment from a parsed description.
class Builder : private DescriptionReader {
  public:
    Builder(std::string origin, std::filesystem::path folder, Time now)
        : DescriptionReader(std::move(origin)),
          folder_(std::move(folder)),
          now_(now),
          result_(std::make_unique<SimulatedSegment>()) {}

    LoadedSegment build(const toml::table& root) {
        if (const auto fault = run(root)) return LoadedSegment(fault->text);
        result_->segment.power_up(now_);
        apply_presets();
        apply_errors();
        if (noise_) result_->segment.set_noise(*noise_);
        for (const auto n : dark_) result_->segment.set_power(n, false, now_);
        for (const auto& late : result_->late) result_->segment.set_power(late.slave, false, now_);
        for (const auto& end : broken_) result_->segment.set_cable(end, false);
        return LoadedSegment(std::move(result_));
    }

  private:
    Fault run(const toml::table& root) {
        static constexpr std::string_view kKnown[] = {"title", "slave", "ring", "round_trip_us", "noise"};
        if (const auto fault = check_keys(root, kKnown, "the description")) return fault;
        if (const auto* node = root.get("round_trip_us")) {
            std::int64_t us = 0;
            if (const auto fault = integer(*node, "round_trip_us", 0, 1'000'000, us)) return fault;
            result_->round_trip = std::chrono::microseconds(us);
        }
        const auto* slaves = root.get_as<toml::array>("slave");
        if (slaves == nullptr || slaves->empty())
            return Failure{fmt::format("{}: there are no slaves: each is a [[slave]]", origin())};
        for (const auto& node : *slaves)
            if (const auto* table = node.as_table())
                if (const auto name = table->at_path("name").value<std::string>())
                    lines_.try_emplace(*name, node.source().begin.line);
        for (const auto& node : *slaves) {
            const auto* table = node.as_table();
            if (table == nullptr) return at(node, "a slave is a table: [[slave]]");
            if (const auto fault = slave(*table)) return fault;
        }
        if (const auto* node = root.get("noise"))
            if (const auto fault = noise(*node)) return fault;
        if (const auto* node = root.get("ring"))
            if (const auto fault = ring(*node)) return fault;
        return {};
    }

    Fault slave(const toml::table& table) {
        static constexpr std::string_view kKnown[] = {
            "name",        "device",         "sii",          "chip",
            "parent",      "port",           "enter",        "cable_ns",
            "serial",      "alias",          "drift_ppb",    "clock_start_ns",
            "fmmus",       "sync_managers",  "ram_kib",      "dc",
            "features",    "type",           "revision",     "build",
            "sii_read_us", "sii_write_us",   "sii_8_bytes",  "sii_status",
            "power",       "power_after_ms", "cable_broken", "emulated_eeprom",
            "station",     "preset",         "errors",       "ports",
            "firmware_us", "count",          "quirks",       "sii_write_busy_us"};
        if (const auto fault = check_keys(table, kKnown, "a slave")) return fault;
        std::int64_t count = 1;
        if (const auto fault = optional_integer(table, "count", 1, 65535, count)) return fault;
        if (count > 1)
            for (const auto* key : {"alias", "port", "station"})
                if (const auto* node = table.get(key))
                    return at(*node, fmt::format("'{}' is allowed for one slave only, but 'count' is {}", key, count));
        for (std::int64_t n = 0; n < count; ++n)
            if (const auto fault = one_of(table, n, count)) return fault;
        return {};
    }

    // Adds the n-th of `count` equal slaves. Each is connected to the slave before it.
    Fault one_of(const toml::table& table, std::int64_t n, std::int64_t count) {
        sim::Device device;
        if (const auto fault = make(table, device)) return fault;
        if (const auto fault = quirks(table, device)) return fault;
        if (const auto fault = adjust_image(*this, table, device.sii)) return fault;
        if (const auto fault = adjust_chip(*this, table, device.chip)) return fault;

        const auto number = static_cast<std::uint32_t>(result_->segment.size());
        std::string name = fmt::format("slave{}", number + 1);
        if (const auto* node = table.get("name")) {
            if (const auto fault = text(*node, "name", name)) return fault;
            if (count > 1) name += fmt::format("{}", n + 1);
            if (const auto found = numbers_.find(name); found != numbers_.end())
                return at(*node, fmt::format("there is a slave '{}' already", name));
        }
        const auto parent_fault = connect(table, n == 0, std::move(device), number);
        if (parent_fault) return parent_fault;
        numbers_[name] = number;
        result_->names.push_back(name);

        if (const auto fault = presets(table, number)) return fault;
        if (const auto fault = counted_errors(table, number)) return fault;
        if (const auto* node = table.get("power")) {
            const auto on = node->value_exact<bool>();
            if (!on) return at(*node, "'power' must be true or false");
            if (!*on) dark_.push_back(number);
        }
        std::int64_t after_ms = -1;
        if (const auto fault = optional_integer(table, "power_after_ms", 0, 1'000'000'000, after_ms)) return fault;
        if (after_ms >= 0) result_->late.push_back({number, later(now_, std::chrono::milliseconds(after_ms))});
        return {};
    }

    // Reads the register values that an earlier master wrote: station = 0x1001, preset = [[0x0120, 0x02]]. A preset is
    // an address and the octets from this address.
    Fault presets(const toml::table& table, std::uint32_t number) {
        std::int64_t station = -1;
        if (const auto fault = optional_integer(table, "station", 0, 0xFFFF, station)) return fault;
        if (station >= 0) presets_.push_back({number, 0x0010, {std::byte(station & 0xFF), std::byte(station >> 8)}});
        const auto* node = table.get("preset");
        if (node == nullptr) return {};
        const auto* list = node->as_array();
        if (list == nullptr) return at(*node, "'preset' is a list of lists: [[0x0120, 0x02], …]");
        for (const auto& entry : *list) {
            const auto* numbers = entry.as_array();
            if (numbers == nullptr || numbers->size() < 2)
                return at(entry, "a preset is an address followed by octets");
            Preset preset{number, 0, {}};
            for (std::size_t i = 0; i < numbers->size(); ++i) {
                std::int64_t value = 0;
                if (const auto fault = integer((*numbers)[i], "preset", 0, i == 0 ? 0xFFFF : 0xFF, value)) return fault;
                if (i == 0)
                    preset.address = static_cast<std::uint16_t>(value);
                else
                    preset.octets.push_back(static_cast<std::byte>(value));
            }
            presets_.push_back(std::move(preset));
        }
        return {};
    }

    // Writes the presets as a master would: each in a separate frame, with time for the firmware between two frames.
    void apply_presets() {
        for (const auto& preset : presets_) {
            auto& esc = result_->segment.slave(preset.slave);
            (void)esc.ecat_write(preset.address, preset.octets, now_);
            esc.frame_end({.good = true, .at = now_, .processing = now_});
            esc.advance(now_);
        }
        if (!presets_.empty()) result_->segment.reconsider();
    }

    // Reads errors that were counted before: errors = [[0, 14, 1]], a port with its damaged frames and lost links.
    Fault counted_errors(const toml::table& table, std::uint32_t number) {
        const auto* node = table.get("errors");
        if (node == nullptr) return {};
        const auto* list = node->as_array();
        if (list == nullptr) return at(*node, "'errors' is a list of lists: [[0, 14, 1], …]");
        for (const auto& entry : *list) {
            const auto* numbers = entry.as_array();
            if (numbers == nullptr || numbers->size() != 3)
                return at(entry, "an entry of 'errors' is a port, its damaged frames and its lost links");
            std::array<std::int64_t, 3> values{};
            for (std::size_t i = 0; i < values.size(); ++i)
                if (const auto fault = integer((*numbers)[i], "errors", 0, i == 0 ? 3 : 255, values[i])) return fault;
            errors_.push_back({number, static_cast<unsigned>(values[0]), values[1], values[2]});
        }
        return {};
    }

    void apply_errors() {
        for (const auto& errors : errors_) {
            auto& esc = result_->segment.slave(errors.slave);
            for (std::int64_t n = 0; n < errors.damaged; ++n) esc.count_rx_error(errors.port, false);
            for (std::int64_t n = 0; n < errors.lost_links; ++n) esc.count_lost_link(errors.port);
        }
    }

    Fault make(const toml::table& table, sim::Device& device) const {
        const auto* by_name = table.get("device");
        const auto* by_image = table.get("sii");
        if ((by_name == nullptr) == (by_image == nullptr))
            return at(table, "a slave is made by either 'device' or 'sii'");
        std::string what;
        if (by_image != nullptr) {
            if (const auto fault = text(*by_image, "sii", what)) return fault;
            std::vector<std::byte> image;
            if (const auto fault = load_image(folder_ / what, image); !fault.empty()) return at(*by_image, fault);
            device = sim::device_from_sii(std::move(image));
            return {};
        }
        if (const auto fault = text(*by_name, "device", what)) return fault;
        auto made = sim::make_device(what);
        if (!made)
            return at(*by_name, fmt::format("there is no device '{}' in the library; there are: {}", what,
                                            fmt::join(sim::device_names(), ", ")));
        device = std::move(*made);
        return {};
    }

    // quirks = ["replies_twice", …]
    Fault quirks(const toml::table& table, sim::Device& device) const {
        const auto* node = table.get("quirks");
        if (node == nullptr) return {};
        const auto* list = node->as_array();
        if (list == nullptr) return at(*node, "'quirks' is a list of names: [\"replies_twice\", …]");
        for (const auto& entry : *list) {
            std::string name;
            if (const auto fault = text(entry, "quirks", name)) return fault;
            if (sim::add_quirk(device, name)) continue;
            const auto all = sim::quirks();
            if (std::any_of(all.begin(), all.end(), [&](const auto& q) { return q.name == name; }))
                return at(entry,
                          fmt::format("'{}' is a quirk of the slave stack, but this device has no slave stack", name));
            std::string names;
            for (const auto& quirk : all) names += fmt::format("{}{}", names.empty() ? "" : ", ", quirk.name);
            return at(entry, fmt::format("there is no quirk '{}'; there are: {}", name, names));
        }
        return {};
    }

    // Finds the parent's port for the slave and plugs the cable in.
    Fault connect(const toml::table& table, bool first, sim::Device device, std::uint32_t number) {
        std::int64_t cable_ns = 5;
        std::int64_t enter = 0;
        if (const auto fault = optional_integer(table, "cable_ns", 0, 1'000'000, cable_ns)) return fault;
        if (const auto fault = optional_integer(table, "enter", 0, kMaxPorts - 1, enter)) return fault;
        bool broken = false;
        if (const auto fault = boolean(table, "cable_broken", broken)) return fault;
        const auto chip = device.chip;
        if (!exists(chip, static_cast<unsigned>(enter)))
            return at(table, fmt::format("the slave has no port {}", enter));
        auto& segment = result_->segment;
        const sim::PortRef own{number, static_cast<std::uint8_t>(enter)};
        if (broken) broken_.push_back(own);
        if (number == 0) {
            if (const auto* node = table.get("parent"))
                return at(*node, "the first slave is connected to the master and has no parent");
            segment.add(std::move(device).assemble());
            (void)segment.connect_master(own, 0, Duration(cable_ns));
            used_[{number, own.port}] = true;
            return {};
        }
        std::uint32_t parent = number - 1;
        if (const auto* node = first ? table.get("parent") : nullptr)
            if (const auto fault = find_parent(*node, parent)) return fault;
        std::int64_t port = -1;
        if (const auto fault = optional_integer(table, "port", 0, kMaxPorts - 1, port)) return fault;
        const auto& parent_chip = segment.slave(parent).description();
        if (port < 0) {  // the next free port, ports of the same kind first
            const auto kind = chip.ports[static_cast<std::size_t>(enter)].kind;
            for (const bool same : {true, false})
                for (const std::int64_t candidate : {1, 2, 3, 0})
                    if (port < 0 && exists(parent_chip, static_cast<unsigned>(candidate)) &&
                        !used_.contains({parent, candidate}) &&
                        (!same || parent_chip.ports[static_cast<std::size_t>(candidate)].kind == kind))
                        port = candidate;
            if (port < 0) return at(table, fmt::format("the slave '{}' has no free port", result_->names[parent]));
        }
        const auto& where = table.contains("port") ? *table.get("port") : static_cast<const toml::node&>(table);
        if (!exists(parent_chip, static_cast<unsigned>(port)))
            return at(where, fmt::format("the slave '{}' has no port {}", result_->names[parent], port));
        if (used_.contains({parent, port}))
            return at(where, fmt::format("port {} of the slave '{}' is taken already", port, result_->names[parent]));
        segment.add(std::move(device).assemble());
        (void)segment.connect({parent, static_cast<std::uint8_t>(port)}, own, Duration(cable_ns));
        used_[{parent, port}] = true;
        used_[{number, own.port}] = true;
        return {};
    }

    Fault find_parent(const toml::node& node, std::uint32_t& parent) const {
        std::string name;
        if (const auto fault = text(node, "parent", name)) return fault;
        if (const auto found = numbers_.find(name); found != numbers_.end()) {
            parent = found->second;
            return {};
        }
        if (const auto line = lines_.find(name); line != lines_.end())
            return at(node, fmt::format("the parent '{}' is defined later, in line {}: define a parent before its "
                                        "children, so that cables cannot form a loop",
                                        name, line->second));
        return at(node, fmt::format("there is no slave '{}'", name));
    }

    // ring = { slave = "name", port = 1 }: the port that the master's second NIC is connected to.
    Fault ring(const toml::node& node) {
        const auto* table = node.as_table();
        if (table == nullptr) return at(node, "'ring' is a table: { slave = \"name\", port = 1 }");
        static constexpr std::string_view kKnown[] = {"slave", "port"};
        if (const auto fault = check_keys(*table, kKnown, "a ring")) return fault;
        std::string name = result_->names.back();
        if (const auto* slave_node = table->get("slave"))
            if (const auto fault = text(*slave_node, "slave", name)) return fault;
        const auto found = numbers_.find(name);
        const auto number =
            found != numbers_.end() ? found->second : static_cast<std::uint32_t>(result_->names.size() - 1);
        if (found == numbers_.end() && name != result_->names.back())
            return at(node, fmt::format("there is no slave '{}'", name));
        std::int64_t port = 1;
        if (const auto fault = optional_integer(*table, "port", 0, kMaxPorts - 1, port)) return fault;
        if (!result_->segment.connect_master({number, static_cast<std::uint8_t>(port)}, 1))
            return at(node, fmt::format("port {} of the slave '{}' does not exist or is taken already", port, name));
        return {};
    }

    // noise = { lost = 0.01, corrupted = 0.001, seed = 1 }
    Fault noise(const toml::node& node) {
        const auto* table = node.as_table();
        if (table == nullptr) return at(node, "'noise' is a table: { lost = 0.01, corrupted = 0.0, seed = 1 }");
        static constexpr std::string_view kKnown[] = {"lost", "corrupted", "seed"};
        if (const auto fault = check_keys(*table, kKnown, "noise")) return fault;
        sim::Segment::Noise noise;
        for (const auto& [name, field] : {std::pair{"lost", &noise.lost}, std::pair{"corrupted", &noise.corrupted}}) {
            const auto* value_node = table->get(name);
            if (value_node == nullptr) continue;
            const auto value = value_node->value<double>();
            if (!value || *value < 0 || *value > 1)
                return at(*value_node, fmt::format("'{}' is a number from 0 to 1", name));
            *field = *value;
        }
        if (const auto fault = optional_integer(*table, "seed", 1, INT64_MAX, noise.seed)) return fault;
        noise_ = noise;
        return {};
    }

    std::filesystem::path folder_;
    Time now_;
    std::unique_ptr<SimulatedSegment> result_;
    std::map<std::string, std::uint32_t> numbers_;
    std::map<std::string, std::uint32_t> lines_;  // the line of each name, also of names that are read later
    std::map<std::pair<std::uint32_t, std::int64_t>, bool> used_;
    struct Preset {
        std::uint32_t slave = 0;
        std::uint16_t address = 0;
        std::vector<std::byte> octets;
    };
    std::vector<Preset> presets_;
    struct Errors {
        std::uint32_t slave = 0;
        unsigned port = 0;
        std::int64_t damaged = 0, lost_links = 0;
    };
    std::vector<Errors> errors_;
    std::vector<std::uint32_t> dark_;
    std::vector<sim::PortRef> broken_;
    std::optional<sim::Segment::Noise> noise_;
};

}  // namespace

LoadedSegment parse_segment(const std::string& text, const std::string& origin, const std::string& folder, Time now) {
    try {
        return Builder(origin, folder, now).build(toml::parse(text));
    } catch (const toml::parse_error& error) {
        return LoadedSegment(fmt::format("{}: line {}: {}", origin, error.source().begin.line, error.description()));
    }
}

LoadedSegment load_segment(const std::string& what, Time now) {
    if (what == "demo") return parse_segment(kDemo, "demo", ".", now);
    const auto ready_made = ready_made_file(what);
    const std::filesystem::path path(ready_made.empty() ? what : ready_made);
    if (path.extension() == ".toml") {
        if (auto odd = odd_file(path); !odd.empty()) return LoadedSegment(std::move(odd));
        std::ifstream in(path, std::ios::binary);
        if (!in)
            return LoadedSegment(
                fmt::format("cannot read the segment description '{}': {}", path.string(), std::strerror(errno)));
        return parse_segment(std::string(std::istreambuf_iterator<char>(in), {}), path.string(),
                             path.has_parent_path() ? path.parent_path().string() : ".", now);
    }
    if (what.empty())
        return LoadedSegment(
            std::string("the name of the segment is missing: \"demo\", a description (*.toml), or devices and SII "
                        "images separated by commas"));
    auto line = describe_line(what);
    if (!line.error.empty()) return LoadedSegment(std::move(line.error));
    return parse_segment(line.description, what, ".", now);
}

void SimulatedSegment::switch_on_late(Time now) noexcept {
    std::erase_if(late, [&](const Late& one) {
        if (now < one.at) return false;
        segment.set_power(one.slave, true, now);
        return true;
    });
}

}  // namespace margay::hosted
