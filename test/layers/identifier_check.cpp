#include "layers/identifier_check.hpp"

#include <algorithm>
#include <regex>
#include <set>

namespace margay::layers {
namespace {

struct Rule {
    // A line without any of these words is skipped, because regular expressions are slow.
    std::vector<std::string_view> words;
    std::regex form;
    const char* what;
    const std::set<std::string>* layers;  // the layers in which the rule applies
};

const std::set<std::string>& core_layers() {
    static const std::set<std::string> names = {"include",      "util", "wire",    "osal contract",
                                                "nic contract", "link", "station", "mailbox",
                                                "network",      "api",  "clock",   "subdevice"};
    return names;
}

const std::set<std::string>& wire_layers() {
    static const auto names = [] {
        auto all = core_layers();
        all.erase("util");
        return all;
    }();
    return names;
}

const std::set<std::string>& timeless_layers() {
    static const auto names = [] {
        auto all = core_layers();
        all.insert({"sim", "osal", "osal/virtual", "osal/bare", "osal/freertos", "oshw", "oshw/simulated",
                    "oshw/filters", "oshw/lan9118"});
        return all;
    }();
    return names;
}

const std::set<std::string>& library_layers() {
    static const auto names = [] {
        auto all = timeless_layers();
        all.insert({"osal/linux", "osal/posix", "oshw/linux", "oshw/xdp", "oshw/pcap"});
        return all;
    }();
    return names;
}

const std::vector<Rule>& rules() {
    static const std::vector<Rule> all = {
        {{"throw", "try", "catch"}, std::regex(R"(\b(throw|try|catch)\b)"), "an exception", &library_layers()},
        {{"dynamic_cast", "typeid"}, std::regex(R"(\b(dynamic_cast|typeid)\b)"), "RTTI", &library_layers()},
        {{"std::"},
         std::regex(R"(\bstd::(function|any|regex|locale)\b)"),
         "a type that hides a heap",
         &library_layers()},
        {{"pack"},
         std::regex(R"(\bpragma\s+pack\b|\bpacked\b\s*\)|gnu::packed)"),
         "a packed struct",
         &library_layers()},
        {{"cout", "cerr", "clog", "stream", "printf"},
         std::regex(R"(\b(cout|cerr|clog|(i|o|io|f|if|of|string|istring|ostring)stream|v?[fsd]?n?printf)\b)"),
         "printing",
         &timeless_layers()},
        {{"clock", "timeofday", "sleep", "this_thread"},
         std::regex(R"(\b(steady_clock|system_clock|high_resolution_clock|clock_gettime|gettimeofday)"
                    R"(|clock_nanosleep|nanosleep|usleep|this_thread)\b)"),
         "a clock",
         &timeless_layers()},
        {{"alloc", "strdup"}, std::regex(R"(\b(malloc|calloc|realloc|strdup)\s*\()"), "the heap", &core_layers()},
        {{"::free"}, std::regex(R"((\bstd::|[^\w:]::)free\s*\()"), "the heap", &core_layers()},
        // Allowed: placement new, `operator new` of a class, `= delete`.
        {{"new"}, std::regex(R"(\bnew\b(\s+[\w:]|\s*\(\s*std::nothrow))"), "the heap", &core_layers()},
        {{"delete"}, std::regex(R"(\bdelete\b\s*(\[\s*\]\s*)?[\w(*:])"), "the heap", &core_layers()},
        {{"unique", "shared"},
         std::regex(R"(\b(unique_ptr|shared_ptr|make_unique|make_shared)\b)"),
         "the heap",
         &core_layers()},
        // Casts of octets to octets or characters are allowed, because they are not casts to a wire format. util
        // builds objects in memory blocks.
        {{"reinterpret_cast"},
         std::regex(
             R"(\breinterpret_cast\s*<\s*)"
             R"((?!(const\s+)?(char|unsigned char|std::byte|std::uint8_t)(\s+const)?\s*\*\s*>|std::uintptr_t\s*>))"),
         "a cast of a pointer",
         &wire_layers()},
    };
    return all;
}

bool has_any(const std::string& line, const std::vector<std::string_view>& words) {
    return std::any_of(words.begin(), words.end(),
                       [&](std::string_view word) { return line.find(word) != std::string::npos; });
}

// A class may define `operator new` and `operator delete` for its own arena.
std::string without_operators(const std::string& line) {
    if (line.find("operator") == std::string::npos && line.find("delete") == std::string::npos) return line;
    static const std::regex form(R"(\boperator\s+(new|delete)\s*(\[\s*\])?|=\s*delete\b)");
    return std::regex_replace(line, form, "");
}

}  // namespace

Faults identifier_faults(const SourceTree& tree) {
    Faults faults;
    for (const auto& file : tree) {
        if (file.path == "include/margay/host_context.hpp") continue;  // the only public header for systems with a heap
        const auto layer = layer_of(file.path);
        const auto stripped = strip(file.text);
        const auto lines = lines_of(stripped);
        for (std::size_t i = 0; i < lines.size(); ++i) {
            const auto first = lines[i].find_first_not_of(" \t");
            if (first == std::string_view::npos) continue;
            if (lines[i][first] == '#' && lines[i].find("include") != std::string_view::npos) continue;
            const auto line = without_operators(std::string(lines[i]));
            std::smatch match;
            for (const auto& rule : rules())
                if (rule.layers->count(layer) != 0 && has_any(line, rule.words) &&
                    std::regex_search(line, match, rule.form))
                    faults.push_back(file.path + ":" + std::to_string(i + 1) + ": " + rule.what + ": " + match.str());
        }
    }
    return faults;
}

}  // namespace margay::layers
