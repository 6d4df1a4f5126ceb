#include "common/service_configuration.hpp"

#include "common/counted.hpp"
#include "common/cycle_plan.hpp"
#include "common/listen_address.hpp"
#include "common/source.hpp"
#include "source/description_reader.hpp"
#include "source/interface_nic.hpp"

#include <margay/files/eni.hpp>
#include <margay/gateway/mailbox_gateway.hpp>

#include <grp.h>
#include <net/if.h>
#include <pwd.h>
#include <sys/sysinfo.h>
#include <sys/un.h>

#include <map>

namespace margay::samples {
namespace {

namespace fs = std::filesystem;

// The place of a value of a master in a file, for errors about two masters.
struct Place {
    std::string file{};
    std::uint32_t line = 0;
};
std::string to_text(const Place& place) { return fmt::format("{}: line {}", place.file, place.line); }
std::string there(const Place& place, const std::string& file) {
    return place.file == file ? fmt::format("in line {}", place.line)
                              : fmt::format("in {}, line {}", place.file, place.line);
}

struct PlacedMaster {
    MasterConfiguration master{};
    Place at{};
    Place source{};
    std::vector<Place> eoe{};  // of the elements of eoe_named
    bool has_number = false;
};

// A name of a master, which is a part of the path of its socket.
bool is_name(std::string_view text) {
    const auto fits = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    };
    return !text.empty() && text.size() <= 64 && text.front() != '.' && std::ranges::all_of(text, fits);
}

bool is_interface_name(std::string_view text) {
    // The kernel refuses ':', and replaces '%' by numbers.
    return !text.empty() && text.size() < IFNAMSIZ && text.find_first_of("/:% \t") == std::string_view::npos &&
           text != "." && text != "..";
}

constexpr std::size_t kMostOctets = std::size_t{1} << 20;  // of a TOML file

// The content of a file. A folder, a FIFO or a device is an error, because reading it may never end, and a reload must
// not prevent the end of the service.
files::FileContent regular_file(const fs::path& path, std::size_t most) {
    std::error_code error;
    const auto status = fs::status(path, error);
    if (error) return {.error = fmt::format("{}: cannot be read: {}", path.string(), error.message())};
    if (!fs::is_regular_file(status)) return {.error = path.string() + ": is no file"};
    if (fs::file_size(path, error) == 0 && !error) return {};
    return files::read_file(path.string(), most);
}

// The first name in the list of a simulated segment that exists and is not a file; empty: none.
std::string odd_file(std::string_view names) {
    while (!names.empty()) {
        const auto comma = std::min(names.find(','), names.size());
        const std::string name(names.substr(0, comma));
        std::error_code error;
        const auto status = fs::status(name, error);
        if (!error && fs::exists(status) && !fs::is_regular_file(status)) return name + ": is no file";
        names.remove_prefix(std::min(comma + 1, names.size()));
    }
    return {};
}

// Reads the masters of one file.
class FileReader {
  public:
    FileReader(const fs::path& file, ConfigurationCheck check, ServiceConfiguration& into,
               std::vector<PlacedMaster>& masters)
        : file_(file),
          reader_(file.string()),
          whole_(check == ConfigurationCheck::whole),
          into_(into),
          masters_(masters) {}

    void read() {
        const auto content = regular_file(file_, kMostOctets);
        if (!content.error.empty()) {
            into_.errors.push_back(content.error);
            into_.unreadable = true;
            return;
        }
        try {
            masters(toml::parse(content.octets));
        } catch (const toml::parse_error& error) {
            into_.errors.push_back(
                fmt::format("{}: line {}: {}", file_.string(), error.source().begin.line, error.description()));
        }
    }

  private:
    // A file with `source` is one master; in other files each table is one.
    void masters(const toml::table& root) {
        if (root.contains("source")) return master(root, file_.stem().string());
        if (root.empty()) return note(reader_.at(root, "the file describes no master: `source` is missing"));
        for (const auto& [key, node] : root) {
            if (const auto* table = node.as_table())
                master(*table, std::string(key.str()));
            else
                note(reader_.at(node,
                                fmt::format("'{}' is no master: masters are tables ([line1]), or the whole file is "
                                            "one master and has the key `source`",
                                            key.str())));
        }
    }

    void master(const toml::table& table, std::string name) {
        PlacedMaster placed;
        placed.at = place(table);
        MasterConfiguration& m = placed.master;
        if (!is_name(name))
            note(
                reader_.at(table, fmt::format("'{}' is no name of a master: letters, digits, '_', '-' and '.'", name)));
        m.name = std::move(name);
        check_keys(table, "");
        if (const auto* source = table.get("source"))
            placed.source = place(*source);
        else
            note(reader_.at(table, fmt::format("the master '{}' has no `source`", m.name)));
        placed.has_number = table.contains("number");
        read_source(table, m);
        read_numbers(table, m);
        m.state = state(table, "state", m.state, true);
        m.end_state = state(table, "end_state", m.end_state, false);
        if (m.end_state > m.state)
            note(reader_.at(*table.get(table.contains("end_state") ? "end_state" : "state"),
                            "'end_state' is above 'state': the end of the service would raise slaves"));
        note(reader_.boolean(table, "take_over", m.take_over));
        read_tolerance(table, m);
        read_eni(table, m);
        if (const auto* socket = part(table, "socket")) read_socket(*socket, m.socket);
        read_eoe(table, m, placed.eoe);
        if (const auto* gateway = part(table, "gateway")) read_gateway(*gateway, m);
        masters_.push_back(std::move(placed));
    }

    void read_numbers(const toml::table& table, MasterConfiguration& m) {
        note(reader_.optional_integer(table, "number", 0, 63, m.number));
        note(reader_.optional_integer(table, "cycle_us", 50, 1'000'000, m.cycle_us));
        note(reader_.optional_integer(table, "priority", 0, 99, m.priority));
        note(reader_.optional_integer(table, "cpu", 0, 1023, m.cpu));
        if (whole_ && m.cpu >= ::get_nprocs_conf())
            warn_at(*table.get("cpu"),
                    fmt::format("there is no processor {}: this machine has {}", m.cpu,
                                counted(static_cast<std::uint64_t>(::get_nprocs_conf()), "processor")));
        note(reader_.optional_integer(table, "spin_us", 0, 1'000'000, m.spin_us));
        note(reader_.optional_integer(table, "in_sync_us", 1, 100'000, m.in_sync_us));
        note(reader_.optional_integer(table, "debug", 0, 2, m.debug));
    }

    void read_source(const toml::table& table, MasterConfiguration& m) {
        const auto* node = table.get("source");
        if (node == nullptr) return;
        if (const auto fault = reader_.text(*node, "source", m.source)) return note(fault);
        if (m.source.empty()) return note(reader_.at(*node, "'source' is empty"));
        if (m.source.starts_with("pcap:")) return note(reader_.at(*node, "a recording cannot be run by a service"));
        if (m.source.starts_with("sim:")) {
            if (!whole_) return;
            if (const auto odd = odd_file(m.source.substr(4)); !odd.empty()) return note(reader_.at(*node, odd));
            if (const auto loaded = load_segment(m.source.substr(4)); !loaded)
                note(reader_.at(*node, fmt::format("{}: {}", m.source, loaded.error())));
            return;
        }
        const auto names = hosted::interfaces_of(m.source);
        if (names.size() > 2) note(reader_.at(*node, "a ring has two interfaces"));
        if (names.size() == 2 && names[0] == names[1])
            note(reader_.at(*node, fmt::format("'{}': both interfaces are the same, a ring needs two", m.source)));
        for (const auto& name : names) {
            if (!is_interface_name(name))
                note(reader_.at(*node, fmt::format("'{}' is no name of an interface (1 to 15 characters)", name)));
            else if (whole_ && ::if_nametoindex(name.c_str()) == 0)
                warn_at(*node, fmt::format("there is no interface {} now", name));
        }
    }

    AlState state(const toml::table& table, std::string_view name, AlState standard, bool op) {
        const auto* node = table.get(name);
        if (node == nullptr) return standard;
        std::string text;
        if (const auto fault = reader_.text(*node, name, text)) {
            note(fault);
            return standard;
        }
        for (const auto& [word, value] : {std::pair{"INIT", AlState::init}, std::pair{"PREOP", AlState::preop},
                                          std::pair{"SAFEOP", AlState::safeop}, std::pair{"OP", AlState::op}})
            if (text == word && (op || value != AlState::op)) return value;
        note(reader_.at(*node, fmt::format("'{}' is \"{}\", it must be one of INIT, PREOP, SAFEOP{}", name, text,
                                           op ? ", OP" : "")));
        return standard;
    }

    void read_tolerance(const toml::table& table, MasterConfiguration& m) {
        const auto* node = table.get("tolerate");
        if (node == nullptr) return;
        const auto* list = node->as_array();
        if (list == nullptr) return note(reader_.at(*node, "'tolerate' must be a list of strings"));
        for (const auto& each : *list) {
            const auto word = each.value_exact<std::string>();
            if (word == "missing")
                m.tolerate_missing = true;
            else if (word == "other")
                m.tolerate_other = true;
            else if (word == "unexpected")
                m.tolerate_unexpected = true;
            else
                note(reader_.at(each, "'tolerate' has \"missing\", \"other\" and \"unexpected\" only"));
        }
    }

    void read_eni(const toml::table& table, MasterConfiguration& m) {
        std::optional<files::EniConfiguration> eni;
        if (const auto* node = table.get("eni")) {
            std::string path;
            if (const auto fault = reader_.text(*node, "eni", path)) return note(fault);
            if (path.empty()) return note(reader_.at(*node, "'eni' is empty"));
            m.eni = file_.parent_path() / path;
            if (!whole_) return;
            auto content = regular_file(m.eni, files::kMostFileBytes);
            if (content.octets.empty() && content.error.empty()) content.error = m.eni.string() + ": the file is empty";
            if (!content.error.empty()) return note(reader_.at(*node, content.error));
            m.eni_text = std::move(content.octets);
            auto read = files::read_eni(m.eni_text);
            for (const auto& remark : read.remarks)
                into_.warnings.push_back(fmt::format("{}: {}", m.eni.string(), files::to_text(remark)));
            if (!read) {
                into_.errors.push_back(fmt::format("{}: {}", m.eni.string(), files::to_text(read.problem)));
                return;
            }
            eni = std::move(*read);
        }
        const auto plan = plan_cycles(eni ? &*eni : nullptr, std::chrono::microseconds(m.cycle_us));
        const auto* at = table.get(m.cycle_us != 0 ? "cycle_us" : table.contains("eni") ? "eni" : "source");
        if (at == nullptr) return;
        if (!plan.error.empty()) note(reader_.at(*at, plan.error));
        if (!plan.remark.empty()) warn_at(*at, plan.remark);
        const auto cycle = std::chrono::duration_cast<std::chrono::microseconds>(plan.period).count();
        if (m.spin_us != 0 && static_cast<std::int64_t>(m.spin_us) >= cycle && table.contains("spin_us"))
            warn_at(
                *table.get("spin_us"),
                fmt::format("'spin_us' is {}, and a cycle has {} µs: a processor does nothing else", m.spin_us, cycle));
    }

    void warn_at(const toml::node& node, const std::string& text) {
        into_.warnings.push_back(fmt::format("{}: {}", to_text(place(node)), text));
    }

    void read_socket(const toml::table& table, SocketConfiguration& s) {
        optional_text(table, "path", s.path);
        if (table.contains("path") && (s.path.empty() || s.path.front() != '/'))
            note(reader_.at(*table.get("path"), "'path' must begin with '/'"));
        else if (s.path.ends_with('/') || s.path.find('\0') != std::string::npos)
            note(reader_.at(*table.get("path"), "'path' must be the name of a file"));
        optional_text(table, "owner", s.owner);
        optional_text(table, "group", s.group);
        if (whole_ && !s.owner.empty() && ::getpwnam(s.owner.c_str()) == nullptr)
            note(reader_.at(*table.get("owner"), fmt::format("there is no user '{}'", s.owner)));
        if (whole_ && !s.group.empty() && ::getgrnam(s.group.c_str()) == nullptr)
            note(reader_.at(*table.get("group"), fmt::format("there is no group '{}'", s.group)));
        std::string mode;
        optional_text(table, "mode", mode);
        if (!mode.empty()) {
            if (mode.size() <= 4 && mode.find_first_not_of("01234567") == std::string::npos &&
                std::stoul(mode, nullptr, 8) <= 0777)
                s.mode = static_cast<unsigned>(std::stoul(mode, nullptr, 8));
            else
                note(reader_.at(*table.get("mode"),
                                fmt::format("'mode' is \"{}\", it must be octal, as \"0660\"", mode)));
        }
        note(reader_.boolean(table, "read_only", s.read_only));
        note(reader_.optional_integer(table, "clients", 1, 32, s.clients));
    }

    void read_eoe(const toml::table& table, MasterConfiguration& m, std::vector<Place>& places) {
        const auto* node = table.get("eoe");
        if (node == nullptr) return;
        if (node->is_boolean()) return note(reader_.boolean(table, "eoe", m.eoe));
        const auto* list = node->as_array();
        if (list == nullptr) return note(reader_.at(*node, "'eoe' must be true, false or a list of tables"));
        m.eoe = true;
        for (const auto& each : *list) {
            const auto* one = each.as_table();
            if (one == nullptr) return note(reader_.at(each, "an element of 'eoe' must be a table"));
            check_keys(*one, "eoe");
            EoeInterface wanted;
            number_into(*one, "position", 0, wanted.position);
            number_into(*one, "alias", 1, wanted.alias);
            if (one->contains("position") == one->contains("alias"))
                note(reader_.at(each, "an element of 'eoe' has either `position` or `alias`"));
            optional_text(*one, "name", wanted.name);
            if (one->contains("name") && !is_interface_name(wanted.name))
                note(reader_.at(*one->get("name"),
                                fmt::format("'{}' is no name of an interface (1 to 15 characters)", wanted.name)));
            if (wanted.name == "lo") note(reader_.at(each, "'lo' is the interface of the machine itself"));
            if (std::ranges::any_of(m.eoe_named, [&](const EoeInterface& other) {
                    return other.position == wanted.position && other.alias == wanted.alias;
                }))
                note(reader_.at(each, "a second element of 'eoe' for the same slave"));
            m.eoe_named.push_back(std::move(wanted));
            places.push_back(place(each));
        }
        if (list->empty()) m.eoe = false;
    }

    void read_gateway(const toml::table& table, MasterConfiguration& m) {
        optional_text(table, "listen", m.gateway);
        const auto* node = table.get("listen");
        if (node == nullptr) return note(reader_.at(table, "'gateway' has no `listen`"));
        const auto where = parse_listen_address(m.gateway, MailboxGatewaySettings::kPort);
        if (!where) return note(reader_.at(*node, fmt::format("'{}' is no ADDRESS:PORT", m.gateway)));
        if (!is_ip_address(where->address))
            return note(reader_.at(*node, fmt::format("'{}' is no IP address in digits", where->address)));
        note(reader_.boolean(table, "read_only", m.gateway_read_only));
    }

    // ------------------------------------------------------------------ values

    void note(const hosted::Failure& failure) { into_.errors.push_back(failure.text); }
    void note(const hosted::Fault& fault) {
        if (fault) into_.errors.push_back(fault->text);
    }
    [[nodiscard]] Place place(const toml::node& node) const { return {file_.string(), node.source().begin.line}; }

    const toml::table* part(const toml::table& table, std::string_view name) {
        const auto* node = table.get(name);
        if (node == nullptr) return nullptr;
        const auto* inner = node->as_table();
        if (inner == nullptr)
            note(reader_.at(*node, fmt::format("'{}' must be a table: {} = {{ ... }}", name, name)));
        else
            check_keys(*inner, name);
        return inner;
    }
    void optional_text(const toml::table& table, std::string_view name, std::string& into) {
        if (const auto* node = table.get(name)) note(reader_.text(*node, name, into));
    }
    void number_into(const toml::table& table, std::string_view name, std::int64_t least,
                     std::optional<std::uint16_t>& into) {
        std::uint16_t value = 0;
        const auto fault = reader_.optional_integer(table, name, least, 0xFFFF, value);
        note(fault);
        if (table.contains(name) && !fault) into = value;
    }

    // All keys that are not in the table of keys. `inside`: the name of the table; empty: of a master.
    void check_keys(const toml::table& table, std::string_view inside) {
        std::vector<std::string_view> known;
        for (const ServiceKey& key : service_keys()) {
            const auto dot = key.name.find('.');
            if (inside.empty() && dot == std::string_view::npos) known.push_back(key.name);
            if (!inside.empty() && dot != std::string_view::npos && key.name.substr(0, dot) == inside)
                known.push_back(key.name.substr(dot + 1));
        }
        for (const auto& [key, node] : table)
            if (std::ranges::find(known, key.str()) == known.end())
                note(reader_.at(node, fmt::format("{} has no key '{}'; its keys are: {}",
                                                  inside.empty() ? "a master" : fmt::format("'{}'", inside), key.str(),
                                                  fmt::join(known, ", "))));
    }

    fs::path file_;
    hosted::DescriptionReader reader_;
    bool whole_;
    ServiceConfiguration& into_;
    std::vector<PlacedMaster>& masters_;
};

// The values that two masters must not share.
class Shared {
  public:
    explicit Shared(std::vector<std::string>& errors) : errors_(errors) {}
    void use(const std::string& kind, const std::string& what, const Place& at) { use(kind, what, what, at); }
    // `same`: equal for two values that differ only in notation.
    void use(const std::string& kind, const std::string& what, const std::string& same, const Place& at) {
        const auto [found, fresh] = used_.try_emplace(kind + "\n" + same, at);
        if (!fresh)
            errors_.push_back(fmt::format("{}: {} is used {} already", to_text(at), fmt::format("{} {}", kind, what),
                                          there(found->second, at.file)));
    }

  private:
    std::vector<std::string>& errors_;
    std::map<std::string, Place> used_;
};

// A path without "..", "//" and links, as far as its folders are there.
std::string plain(const fs::path& path) {
    std::error_code error;
    const auto whole = fs::absolute(path, error);
    const auto found = fs::weakly_canonical(whole, error);
    return (error ? whole.lexically_normal() : found).string();
}

void check_together(const std::vector<PlacedMaster>& masters, const std::string& sockets,
                    std::vector<std::string>& errors) {
    Shared shared(errors);
    std::vector<ListenAddress> gateways;
    for (const auto& [m, at, source, eoe, has_number] : masters) {
        shared.use("the name", m.name, at);
        const auto socket = socket_path(m, sockets);
        shared.use("the socket", socket, plain(socket), at);
        constexpr std::size_t kMostPath = sizeof(sockaddr_un::sun_path) - 1;
        if (socket.size() > kMostPath)
            errors.push_back(
                fmt::format("{}: the path of the socket has more than {} octets: {}", to_text(at), kMostPath, socket));
        const auto gateway = parse_listen_address(m.gateway, MailboxGatewaySettings::kPort);
        if (gateway) {
            // The text of the first gateway that conflicts with this gateway is used for both.
            const auto first =
                std::ranges::find_if(gateways, [&](const ListenAddress& other) { return clash(other, *gateway); });
            const auto& same = first == gateways.end() ? *gateway : *first;
            if (gateway->port != 0) shared.use("the gateway", to_text(*gateway), to_text(same), at);
            gateways.push_back(*gateway);
        }
        if (has_number) shared.use("the number", std::to_string(m.number), at);
        for (const auto& name : hosted::interfaces_of(m.source)) shared.use("the interface", name, source);
        for (std::size_t n = 0; n < m.eoe_named.size(); ++n)
            if (!m.eoe_named[n].name.empty()) shared.use("the interface", m.eoe_named[n].name, eoe[n]);
    }
}

// Masters without a number get the first free numbers, in their order.
void give_numbers(std::vector<PlacedMaster>& masters) {
    const auto is_used = [&](unsigned n) {
        return std::ranges::any_of(masters, [n](const auto& m) { return m.has_number && m.master.number == n; });
    };
    for (auto& placed : masters) {
        if (placed.has_number) continue;
        placed.master.number = 0;
        while (is_used(placed.master.number)) ++placed.master.number;
        placed.has_number = true;
    }
}

}  // namespace

ServiceConfiguration read_service_configuration(const fs::path& folder, ConfigurationCheck check,
                                                const std::string& sockets) {
    ServiceConfiguration all;
    std::vector<fs::path> found;
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        if (entry->path().extension() == ".toml") found.push_back(entry->path());
    if (error) {
        all.errors.push_back(fmt::format("{}: cannot be read: {}", folder.string(), error.message()));
        all.unreadable = true;
        return all;
    }
    std::ranges::sort(found);
    std::vector<PlacedMaster> masters;
    for (const auto& file : found) FileReader(file, check, all, masters).read();
    check_together(masters, sockets, all.errors);
    give_numbers(masters);
    std::ranges::stable_sort(masters, {}, [](const PlacedMaster& m) { return m.master.number; });
    for (auto& placed : masters) all.masters.push_back(std::move(placed.master));
    return all;
}

std::string socket_path(const MasterConfiguration& master, const std::string& folder) {
    return master.socket.path.empty() ? folder + "/" + master.name + ".sock" : master.socket.path;
}

}  // namespace margay::samples
