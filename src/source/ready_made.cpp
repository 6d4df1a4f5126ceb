#include "source/ready_made.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace margay::hosted {
namespace {

namespace fs = std::filesystem;

// Installed programs find the folder from their own place, so that an installation may be moved. Programs of a build
// tree use the folder of the sources. A copy of a program somewhere else uses the folder of the installation.
fs::path folder() {
    std::error_code error;
    const auto program = fs::read_symlink("/proc/self/exe", error);
    for (const auto& candidate : {program.parent_path() / ".." / "share" / "margay" / "segments",
                                  fs::path(MARGAY_SEGMENTS_FOLDER), fs::path(MARGAY_INSTALLED_SEGMENTS_FOLDER)})
        if (candidate.is_absolute() && fs::is_directory(candidate, error)) return candidate;
    return MARGAY_SEGMENTS_FOLDER;
}

// The text of the line `title = "…"` in a description.
std::string title_in(const fs::path& file) {
    constexpr std::string_view kBegin = "title = \"";
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);)
        if (line.starts_with(kBegin)) return line.substr(kBegin.size(), line.rfind('"') - kBegin.size());
    return {};
}

}  // namespace

std::vector<ReadyMadeSegment> ready_made_segments() {
    std::vector<ReadyMadeSegment> all;
    std::error_code error;
    for (fs::directory_iterator entry(folder(), error), end; !error && entry != end; entry.increment(error))
        if (entry->path().extension() == ".toml")
            all.push_back({entry->path().stem().string(), title_in(entry->path())});
    std::ranges::sort(all, {}, &ReadyMadeSegment::name);
    all.insert(all.begin(), {"demo", "A coupler with digital and analogue terminals"});
    return all;
}

std::vector<std::string> ready_made_names() {
    std::vector<std::string> names;
    for (const auto& segment : ready_made_segments()) names.push_back(segment.name);
    return names;
}

bool is_plain_name(const std::string& text) { return !text.empty() && text.find_first_of("./,") == std::string::npos; }

std::string ready_made_file(const std::string& name) {
    if (!is_plain_name(name)) return {};
    const auto file = folder() / (name + ".toml");
    std::error_code error;
    return fs::is_regular_file(file, error) ? file.string() : std::string();
}

}  // namespace margay::hosted
