#include "layers/include_check.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <regex>
#include <set>

namespace margay::layers {
namespace {

// A folder may include itself, the folders in its row, and the folders that these folders may include.
const std::map<std::string, std::vector<std::string>>& table() {
    static const std::map<std::string, std::vector<std::string>> rows = {
        {"include", {}},
        {"util", {"include"}},
        {"wire", {"util"}},
        {"osal contract", {"include"}},
        {"nic contract", {"include"}},
        {"osal", {"osal contract"}},
        {"osal/linux", {"osal", "util"}},
        {"osal/virtual", {"osal", "util"}},
        {"osal/posix", {"osal", "util"}},
        {"osal/bare", {"osal", "util"}},
        {"osal/freertos", {"osal", "util"}},
        {"oshw", {"nic contract", "osal contract", "wire"}},
        {"oshw/linux", {"oshw"}},
        {"oshw/xdp", {"oshw/linux"}},
        {"oshw/pcap", {"oshw"}},
        {"oshw/lan9118", {"oshw"}},
        {"oshw/filters", {"oshw"}},
        {"oshw/simulated", {"oshw", "sim"}},
        {"link", {"wire", "nic contract"}},
        {"station", {"link"}},
        {"mailbox", {"station"}},
        {"clock", {"util"}},
        {"network", {"mailbox", "clock"}},
        {"api", {"network", "osal contract"}},
        {"attach", {"api"}},
        {"gateway", {"attach", "subdevice"}},
        {"source",
         {"files", "sim", "osal/linux", "osal/virtual", "oshw/linux", "oshw/xdp", "oshw/pcap", "oshw/filters",
          "oshw/simulated"}},
        {"analyse", {"wire", "oshw/pcap"}},
        {"compat", {"source", "wire"}},
        {"subdevice", {"wire"}},
        {"sim", {"subdevice"}},
        {"files", {"wire"}},
        {"samples",
         {"files", "analyse", "api", "attach", "gateway", "source", "osal/posix", "osal/bare", "osal/freertos",
          "oshw/lan9118"}},
        {"test", {"samples", "compat"}},
    };
    return rows;
}

void add_reachable(const std::string& layer, std::set<std::string>& reached) {
    if (!reached.insert(layer).second) return;
    if (const auto row = table().find(layer); row != table().end())
        for (const auto& next : row->second) add_reachable(next, reached);
}

bool may_include(const std::string& from, const std::string& to) {
    std::set<std::string> reached;
    add_reachable(from, reached);
    return reached.count(to) != 0;
}

// Headers of the standard library that are usable without a heap, an operating system and exceptions.
const std::set<std::string>& freestanding_headers() {
    static const std::set<std::string> names = {
        "algorithm",  "array",    "atomic",   "bit",         "bitset",           "charconv", "chrono",      "climits",
        "cmath",      "compare",  "concepts", "coroutine",   "cstddef",          "cstdint",  "cstring",     "limits",
        "functional", "iterator", "memory",   "new",         "initializer_list", "numbers",  "numeric",     "optional",
        "ranges",     "span",     "tuple",    "string_view", "utility",          "variant",  "type_traits", "version",
    };
    return names;
}

// Returns "" when `layer` may include the external `header`, else the reason why not.
std::string outside_fault(const std::string& layer, const std::string& header) {
    const auto begins = [&](std::string_view with) { return header.compare(0, with.size(), with) == 0; };
    const bool leaf = layer == "samples" || layer == "test" || layer == "source" || layer == "compat";
    if (begins("gtest/") || begins("gmock/") || begins("benchmark/"))
        return layer == "test" ? "" : "belongs to test/ only";
    if (begins("fmt/") || begins("CLI/") || begins("nlohmann/") || begins("toml++/"))
        return leaf ? "" : "belongs to samples/ and test/ only";
    if (begins("pcap")) return layer == "oshw/pcap" ? "" : "belongs to oshw/pcap/ only";
    if (begins("xdp/") || begins("bpf/"))
        return layer == "oshw/xdp" || layer == "test" ? "" : "belongs to oshw/xdp/ only";
    if (begins("pugixml")) return layer == "files" || layer == "test" ? "" : "belongs to src/files/ only";
    if (layer == "compat") return "";
    if (leaf || layer == "files" || layer == "analyse" || layer == "attach" || layer == "gateway" ||
        layer == "osal/linux" || layer == "osal/posix" || layer == "oshw/linux" || layer == "oshw/xdp" ||
        layer == "oshw/pcap")
        return "";
    if (layer == "osal/freertos" && (header == "FreeRTOS.h" || header == "semphr.h" || header == "task.h")) return "";
    if (freestanding_headers().count(header) != 0) return "";
    // Code that builds objects from a description may use containers for this.
    static const std::set<std::string> containers = {"deque", "map", "set", "string", "vector"};
    if ((layer == "sim" || layer == "oshw/simulated") && containers.count(header) != 0) return "";
    return "needs more than core code may ask for";
}

// Public headers for systems with a heap. The library itself includes none of them.
bool is_hosted(const std::string& path, const std::string& header) {
    // Two headers include a smaller header of one standard library if this library has it.
    if (path == "include/margay/detail/chrono.hpp") return header == "bits/chrono.h";
    if (path == "include/margay/detail/ranges.hpp") return header == "bits/ranges_base.h";
    return path.starts_with("include/margay/host_") && (header == "deque" || header == "vector");
}

struct Include {
    std::size_t line;  // the first is 1
    std::string name;
    bool angled;
};

std::vector<Include> includes_of(const SourceFile& file) {
    static const std::regex form(R"(^\s*#\s*include\s*([<"])([^>"]*)[>"])");
    std::vector<Include> found;
    // In the stripped text an include outside a comment keeps its `#`, while an include in a comment loses it.
    const auto stripped = strip(file.text);
    const auto plain = lines_of(stripped);
    const auto lines = lines_of(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
        std::match_results<std::string_view::const_iterator> match;
        if (plain[i].find('#') == std::string_view::npos) continue;
        if (std::regex_search(lines[i].begin(), lines[i].end(), match, form))
            found.push_back({i + 1, match.str(2), match.str(1) == "<"});
    }
    return found;
}

using Graph = std::map<std::string, std::vector<std::string>>;

std::optional<std::string> resolve(const Graph& files, const std::string& from, const Include& include) {
    std::vector<std::string> tries = {"include/" + include.name};
    if (!include.angled) {
        tries.insert(tries.begin(), from.substr(0, from.rfind('/') + 1) + include.name);
        for (const auto* top : {"src/", "", "samples/", "test/"}) tries.push_back(top + include.name);
    }
    // Users include the headers of the parts by this path, because the build copies them to margay/parts.
    constexpr std::string_view kParts = "margay/parts/";
    if (include.name.starts_with(kParts))
        for (const auto* top : {"src/", ""}) tries.push_back(top + include.name.substr(kParts.size()));
    for (const auto& path : tries)
        if (files.count(path) != 0) return path;
    return {};
}

// Depth-first search. `path` contains the files of the current path. A file that occurs twice on the path closes a
// circle.
void find_circles(const Graph& graph, const std::string& file, std::vector<std::string>& path,
                  std::set<std::string>& done, Faults& faults) {
    if (const auto seen = std::find(path.begin(), path.end(), file); seen != path.end()) {
        std::string circle = *seen + ": includes itself through";
        for (auto step = seen + 1; step != path.end(); ++step) circle += " " + *step;
        faults.push_back(circle);
        return;
    }
    if (done.count(file) != 0) return;
    path.push_back(file);
    for (const auto& next : graph.at(file)) find_circles(graph, next, path, done, faults);
    path.pop_back();
    done.insert(file);
}

}  // namespace

Faults include_faults(const SourceTree& tree) {
    Faults faults;
    Graph graph;
    for (const auto& file : tree) graph[file.path];
    for (const auto& file : tree) {
        const auto layer = layer_of(file.path);
        if (table().count(layer) == 0) {
            faults.push_back(file.path + ":1: the table of layers has no row for this folder");
            continue;
        }
        for (const auto& include : includes_of(file)) {
            const auto where = file.path + ":" + std::to_string(include.line) + ": ";
            if (const auto target = resolve(graph, file.path, include)) {
                graph[file.path].push_back(*target);
                const auto to = layer_of(*target);
                if (!may_include(layer, to)) faults.push_back(where + layer + " may not include " + *target);
            } else if (!include.angled || include.name.compare(0, 7, "margay/") == 0) {
                faults.push_back(where + "there is no " + include.name + " in the project");
            } else if (const auto reason = outside_fault(layer, include.name);
                       !reason.empty() && !is_hosted(file.path, include.name)) {
                faults.push_back(where + "<" + include.name + "> " + reason);
            }
        }
    }
    std::vector<std::string> path;
    std::set<std::string> done;
    for (const auto& [file, unused] : graph) find_circles(graph, file, path, done, faults);
    return faults;
}

}  // namespace margay::layers
