#include "layers/calls_check.hpp"

#include <algorithm>
#include <regex>

namespace margay::layers {

std::set<std::string> identifiers_of(std::string_view text) {
    std::set<std::string> found;
    for (const auto line : lines_of(text)) {
        std::string name;
        for (const char c : std::string(line.substr(0, line.find("//"))) + " ") {
            const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
            if (letter || (!name.empty() && c >= '0' && c <= '9')) {
                name += c;
            } else {
                if (!name.empty()) found.insert(name);
                name.clear();
            }
        }
    }
    return found;
}

Faults call_faults(const std::string& readme, const CallNames& names) {
    static const std::regex code("`([^`]*)`");
    static constexpr std::array<const char*, 3> kColumns{"SOEM", "IgH", "Margay"};
    const auto begin = readme.find("## Coming from SOEM or IgH\n");
    if (begin == std::string::npos) return {"README.md: no section \"Coming from SOEM or IgH\""};
    const auto section = readme.substr(begin, readme.find("\n## ", begin) - begin);
    Faults faults;
    std::size_t rows = 0;
    for (const auto view : lines_of(section)) {
        if (view.substr(0, 2) != "| " || view.substr(0, 6) == "| SOEM") continue;
        ++rows;
        std::size_t column = 0;
        std::string cell;
        for (const char c : view.substr(1)) {
            if (c != '|') {
                cell += c;
                continue;
            }
            for (std::sregex_iterator match(cell.begin(), cell.end(), code), end; column < 3 && match != end; ++match)
                for (const auto& name : identifiers_of(match->str(1))) {
                    const auto& known = names[column];
                    const bool part = column == 1 && std::any_of(known.begin(), known.end(), [&](const auto& whole) {
                                          return whole.find(name) != std::string::npos;
                                      });
                    if (!part && known.count(name) == 0)
                        faults.push_back(std::string("README.md, column ") + kColumns[column] +
                                         ": no such name: " + name);
                }
            ++column;
            cell.clear();
        }
    }
    if (rows == 0) faults.push_back("README.md: no table of calls");
    return faults;
}

}  // namespace margay::layers
