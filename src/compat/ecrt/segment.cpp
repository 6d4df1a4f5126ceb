#include "compat/ecrt/segment.hpp"

#include <cstdlib>
#include <fstream>
#include <string_view>

namespace margay::compat::ecrt {
namespace {

std::string trimmed(std::string_view text) {
    constexpr std::string_view kBlank = " \t\r\"";
    const auto first = text.find_first_not_of(kBlank);
    if (first == std::string_view::npos) return {};
    return std::string(text.substr(first, text.find_last_not_of(kBlank) - first + 1));
}

// A # behind a blank begins a comment. A # without a blank before it belongs to the source: drive#16.
std::string_view without_comment(std::string_view line) {
    for (std::size_t n = 0; n < line.size(); ++n)
        if (line[n] == '#' && (n == 0 || line[n - 1] == ' ' || line[n - 1] == '\t')) return line.substr(0, n);
    return line;
}

std::string source_in_file(const char* file, const std::string& key) {
    std::ifstream in(file);
    for (std::string text; std::getline(in, text);) {
        const auto line = without_comment(text);
        const auto equals = line.find('=');
        if (equals == std::string_view::npos) continue;
        if (trimmed(line.substr(0, equals)) == key) return trimmed(line.substr(equals + 1));
    }
    return {};
}

}  // namespace

std::string bound_source(unsigned index) {
    const std::string key = "MARGAY_MASTER" + std::to_string(index);
    if (const char* bound = std::getenv(key.c_str()); bound != nullptr && *bound != '\0') return bound;
    const char* file = std::getenv("MARGAY_MASTERS");
    return source_in_file(file != nullptr ? file : "/etc/margay/masters.conf", key);
}

hosted::OpenedSource open_segment(const std::string& source) {
    if (source.starts_with("pcap:"))
        return hosted::OpenedSource(source +
                                    ": a recording has a time of its own; programs for ecrt.h run in real time");
    return hosted::open_source(source, {.real_time = true});
}

}  // namespace margay::compat::ecrt
