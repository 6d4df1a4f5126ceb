// The commands crc and graph, which show the ports of the slaves.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"
#include "ethercat/link_health.hpp"

#include "common/slave_report.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <map>

namespace margay::ethercat {
namespace {

bool has_port(const SlaveFacts& slave, std::size_t port) {
    return slave.ports[port].type != PortType::not_implemented || slave.ports[port].link;
}

std::string next_text(const Port& port) {
    return port.neighbour == 0 ? std::string("-") : fmt::to_string(port.neighbour - 1);
}

std::string crc_line(const SlaveFacts& slave, const ErrorCounters& counters) {
    std::string line = fmt::format("{:>5}", slave.position);
    for (std::size_t port = 0; port < 4; ++port)
        line += has_port(slave, port)
                    ? fmt::format(" | {:>3} {:>3} {:>3} {:>3}", counters.invalid_frames[port], counters.rx_errors[port],
                                  counters.forwarded[port], next_text(slave.ports[port]))
                    : std::string(" |   -   -   -   -");
    return line + "\n";
}

nlohmann::ordered_json counters_json(const SlaveFacts& slave, const ErrorCounters& counters) {
    auto ports = nlohmann::ordered_json::array();
    for (std::size_t port = 0; port < 4; ++port)
        ports.push_back(
            {{"crc", counters.invalid_frames[port]},
             {"phy", counters.rx_errors[port]},
             {"forwarded", counters.forwarded[port]},
             {"lost_links", counters.lost_links[port]},
             {"next", slave.ports[port].neighbour == 0 ? nlohmann::ordered_json(nullptr)
                                                       : nlohmann::ordered_json(slave.ports[port].neighbour - 1)}});
    return {{"position", slave.position},
            {"ports", ports},
            {"processing_unit", counters.processing_unit},
            {"pdi", counters.pdi}};
}

Answer<> add_counters(const Call& call, Master& master, Output& output) {
    const auto selected = call.selected(master);
    if (!selected) return selected.problem();
    output.text = "      | Port 0          | Port 1          | Port 2          | Port 3\nSlave";
    for (int port = 0; port < 4; ++port) output.text += " | CRC PHY FWD NXT";
    output.text += "\n";
    output.json["slaves"] = nlohmann::ordered_json::array();
    return Call::each_slave(*selected, output, [&](const SlaveFacts& slave) -> Answer<> {
        const auto counters = master.session->error_counters(slave.position);
        if (!counters) return counters.problem();
        output.text += crc_line(slave, *counters);
        output.json["slaves"].push_back(counters_json(slave, *counters));
        return {};
    });
}

Answer<> reset_counters(const Call& call, Master& master, Output& output) {
    const auto selected = call.some_selected(master);
    if (!selected) return selected.problem();
    output.json["reset"] = nlohmann::ordered_json::array();
    return Call::each_slave(*selected, output, [&](const SlaveFacts& slave) -> Answer<> {
        const auto done = master.session->reset_error_counters(slave.position);
        if (done) output.json["reset"].push_back(slave.position);
        return done;
    });
}

// ------------------------------------------------------------------ graph

enum class Info : std::uint8_t { none, dc, crc };

struct End {
    const ErrorCounters* counters = nullptr;
    std::size_t port = 0;
};

std::string_view colour(const End& near, const End& far) {
    auto health = LinkHealth::good;
    for (const End& end : {near, far})
        if (end.counters != nullptr) health = std::max(health, link_health(*end.counters, end.port));
    return health == LinkHealth::bad ? "red" : health == LinkHealth::doubtful ? "orange" : "darkgreen";
}

std::string dot_text(std::string_view text) {
    std::string out;
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
    return out;
}

std::string counters_label(const End& end) {
    if (end.counters == nullptr) return "";
    return fmt::format("\\nCRC {} PHY {} FWD {}", end.counters->invalid_frames[end.port],
                       end.counters->rx_errors[end.port], end.counters->forwarded[end.port]);
}

std::string_view medium(PortType type) { return type == PortType::ebus ? "E-bus" : type == PortType::mii ? "MII" : ""; }

class Graph {
  public:
    Graph(Master& master, Info info) : master_(master), info_(info) {}

    Answer<> run(Output& output) {
        const auto slaves = master_.session->slaves();
        if (!slaves) return slaves.problem();
        const auto read = Call::each_slave(*slaves, output, [&](const SlaveFacts& slave) -> Answer<> {
            const auto counters = master_.session->error_counters(slave.position);
            if (!counters) return counters.problem();
            counters_.emplace(slave.position, *counters);
            return {};
        });
        if (!read && read.problem().code == samples::exit_code::kSystem) return read;
        text_ =
            "digraph bus {\n    rankdir=\"LR\";\n    node [fontname=\"Helvetica\" shape=\"box\"];\n"
            "    edge [fontname=\"Helvetica\" fontsize=\"10\" dir=\"both\"];\n";
        text_ += fmt::format("    master [label=\"EtherCAT\\nMaster {}\" shape=\"ellipse\"];\n", master_.index);
        output.json["nodes"] = nlohmann::ordered_json::array();
        output.json["links"] = nlohmann::ordered_json::array();
        for (const SlaveFacts& slave : *slaves) {
            const auto added = add_node(slave, output);
            if (!added) return added;
            add_link(slave, output);
        }
        output.text = text_ + "}\n";
        return read;
    }

  private:
    Answer<> add_node(const SlaveFacts& slave, Output& output) {
        const auto name = slave.name.empty()
                              ? fmt::format("{:#010x}:{:#010x}", slave.identity.vendor, slave.identity.product)
                              : slave.name;
        std::string label = fmt::format("{}: {}", slave.position, dot_text(name));
        if (slave.alias != 0) label += fmt::format("\\nalias {}", slave.alias);
        label += fmt::format("\\n{}", samples::al_text(slave.al));
        nlohmann::ordered_json json{{"position", slave.position}, {"name", name}, {"state", to_text(slave.al.state)}};
        if (info_ == Info::dc) {
            const auto clock = master_.session->clock(slave.position);
            if (!clock) return clock.problem();
            label += !clock->runs       ? "\\nno clock"
                     : clock->reference ? "\\nreference clock"
                                        : fmt::format("\\ndelay {} ns", clock->delay_ns);
            json["delay_ns"] = clock->runs ? nlohmann::ordered_json(clock->delay_ns) : nlohmann::ordered_json(nullptr);
            json["reference_clock"] = clock->reference;
        }
        if (info_ == Info::crc && counters_.contains(slave.position))
            label += fmt::format("\\nPU {} PDI {}", counters_.at(slave.position).processing_unit,
                                 counters_.at(slave.position).pdi);
        text_ += fmt::format("    slave{} [label=\"{}\"{}];\n", slave.position, label,
                             slave.problem.empty() && !slave.al.error ? "" : " color=\"red\"");
        output.json["nodes"].push_back(std::move(json));
        return {};
    }

    void add_link(const SlaveFacts& slave, Output& output) {
        const auto end_at = [this](std::uint16_t position, std::size_t port) {
            const auto found = counters_.find(position);
            return found == counters_.end() ? End{} : End{&found->second, port};
        };
        const End far = end_at(slave.position, slave.entry_port);
        const End near = slave.parent ? end_at(*slave.parent, slave.parent_port) : End{};
        const bool show = info_ == Info::crc;
        const auto shade = colour(near, far);
        const auto from = slave.parent ? fmt::format("slave{}", *slave.parent) : std::string("master");
        const auto kind = medium(slave.ports[slave.entry_port].type);
        text_ += fmt::format("    {} -> slave{} [color=\"{}\" label=\"{}\"{} taillabel=\"{}{}\" headlabel=\"{}{}\"];\n",
                             from, slave.position, shade, kind, kind == "E-bus" ? " style=\"bold\"" : "",
                             slave.parent ? fmt::to_string(slave.parent_port) : "", show ? counters_label(near) : "",
                             slave.entry_port, show ? counters_label(far) : "");
        output.json["links"].push_back(
            {{"from", slave.parent ? nlohmann::ordered_json(*slave.parent) : nlohmann::ordered_json(nullptr)},
             {"from_port", slave.parent_port},
             {"to", slave.position},
             {"to_port", slave.entry_port},
             {"medium", kind},
             {"colour", shade}});
    }

    Master& master_;
    Info info_;
    std::map<std::uint16_t, ErrorCounters> counters_{};  // by position; of slaves that could be read
    std::string text_{};
};

}  // namespace

int run_crc(Call& call) {
    if (!call.words().empty()) {
        if (call.words()[0] != "reset")
            return call.fail({fmt::format("'{}': crc has the argument reset, or none", call.words()[0]),
                              samples::exit_code::kUsage});
        return call.each_master([&](Master& master, Output& output) { return reset_counters(call, master, output); });
    }
    return call.repeat([&] {
        return call.each_master([&](Master& master, Output& output) { return add_counters(call, master, output); });
    });
}

int run_graph(Call& call) {
    auto info = Info::none;
    if (!call.words().empty()) {
        const auto& word = call.words()[0];
        if (word != "DC" && word != "CRC")
            return call.fail(
                {fmt::format("'{}' is no information for the graph: DC or CRC", word), samples::exit_code::kUsage});
        info = word == "DC" ? Info::dc : Info::crc;
    }
    if (call.masters().size() > 1 && !call.json())
        return call.fail({"a graph has one master: use --master", samples::exit_code::kUsage});
    return call.each_master([&](Master& master, Output& output) { return Graph(master, info).run(output); });
}

}  // namespace margay::ethercat
