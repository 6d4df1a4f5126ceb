#include "layers/house_check.hpp"

#include <algorithm>

namespace margay::layers {

Faults length_faults(const SourceTree& tree) {
    Faults faults;
    for (const auto& file : tree) {
        if (layer_of(file.path) == "test") continue;
        if (const auto lines = lines_of(file.text).size(); lines > kMaxFileLines)
            faults.push_back(file.path + ": " + std::to_string(lines) + " lines; one subject fits in " +
                             std::to_string(kMaxFileLines));
    }
    return faults;
}

Faults width_faults(const SourceTree& tree) {
    const auto columns = [](std::string_view line) {
        return static_cast<std::size_t>(std::ranges::count_if(line, [](char c) { return (c & 0xC0) != 0x80; }));
    };
    Faults faults;
    for (const auto& file : tree) {
        const auto lines = lines_of(file.text);
        for (std::size_t n = 0; n < lines.size(); ++n)
            if (columns(lines[n]) > kMaxColumns)
                faults.push_back(file.path + ":" + std::to_string(n + 1) + ": wider than " +
                                 std::to_string(kMaxColumns) + " columns");
    }
    return faults;
}

Faults readme_faults(const SourceTree& tree, const std::set<std::string>& notes) {
    std::set<std::string> folders;
    for (const auto& file : tree) {
        if (file.path.find(".cpp") == std::string::npos) continue;
        // Below the other top-level folders one README.md is sufficient: test/README.md also describes test/wire.
        const auto floor = file.path.substr(0, file.path.find('/'));
        const auto folder = floor == "src" || floor == "include" ? file.path.substr(0, file.path.rfind('/')) : floor;
        if (notes.count(folder + "/README.md") == 0) folders.insert(folder);
    }
    Faults faults;
    for (const auto& folder : folders) faults.push_back(folder + ": no README.md says what lives here");
    return faults;
}

Faults top_level_faults(const std::set<std::string>& names) {
    static const std::set<std::string> allowed = {"include", "src",     "osal",      "oshw",          "samples",
                                                  "test",    "LICENSE", "README.md", "CMakeLists.txt"};
    Faults faults;
    for (const auto& name : names) {
        const bool generated = name.compare(0, 5, "build") == 0 || name == "compile_commands.json";
        if (name[0] != '.' && !generated && allowed.count(name) == 0)
            faults.push_back(name + ": does not belong at the top level");
    }
    for (const auto& name : allowed)
        if (names.count(name) == 0) faults.push_back(name + ": missing at the top level");
    return faults;
}

Faults wait_faults(const SourceTree& tree) {
    Faults faults;
    for (const auto& file : tree) {
        const bool first = file.text.find("nic().wait_handle()") != std::string::npos;
        if (layer_of(file.path) != "test" && first && file.text.find("second->wait_handle()") == std::string::npos)
            faults.push_back(file.path + ": waits for the first NIC alone, see Source::wait_handles()");
    }
    return faults;
}

}  // namespace margay::layers
