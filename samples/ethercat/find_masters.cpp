#include "ethercat/find_masters.hpp"

#include "common/counted.hpp"
#include "common/program.hpp"
#include "common/service_configuration.hpp"
#include "ethercat/attached.hpp"
#include "ethercat/standalone.hpp"

#include <fmt/format.h>

#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

namespace margay::ethercat {
namespace {

using samples::MasterConfiguration;

// By number of the master: a source that the command opens itself, or the socket of a running application.
struct Place {
    std::string source{};
    std::string socket{};
};
using Places = std::map<unsigned, Place>;

Places sources_of_environment() {
    Places all;
    constexpr unsigned kMost = 64;
    for (unsigned n = 0; n < kMost; ++n)
        if (const char* source = std::getenv(fmt::format("MARGAY_MASTER{}", n).c_str());
            source != nullptr && *source != 0)
            all[n].source = source;
    return all;
}

Places numbered(const std::vector<std::string>& values, std::string Place::*member) {
    Places all;
    for (const auto& value : values) all[static_cast<unsigned>(all.size())].*member = value;
    return all;
}

bool is_socket(const std::string& path) {
    struct stat found {};
    return ::stat(path.c_str(), &found) == 0 && S_ISSOCK(found.st_mode);
}

std::vector<std::string> sockets_in(const char* folder) {
    std::vector<std::string> all;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
        if (entry->path().extension() == ".sock") all.push_back(entry->path());
    std::ranges::sort(all);
    return all;
}

// The masters of the service. An error in its files does not hide the existing sockets.
std::vector<MasterConfiguration> service_masters(const Arguments& arguments) {
    std::error_code ignored;
    if (!std::filesystem::is_directory(samples::kConfigurationFolder, ignored)) return {};
    auto configuration =
        samples::read_service_configuration(samples::kConfigurationFolder, samples::ConfigurationCheck::files);
    if (!arguments.has("quiet"))
        for (const auto& error : configuration.errors) samples::warn("warning: " + error);
    return std::move(configuration.masters);
}

Places places_of_system(const Arguments& arguments) {
    const auto masters = service_masters(arguments);
    Places served;
    auto sockets = sockets_in(samples::kSocketFolder);
    for (const MasterConfiguration& master : masters) {
        const auto path = samples::socket_path(master);
        if (!is_socket(path)) continue;
        served[master.number].socket = path;
        std::erase(sockets, path);
    }
    unsigned free = 0;
    for (const auto& path : sockets) {
        while (served.contains(free)) ++free;
        served[free].socket = path;
    }
    if (!served.empty()) return served;
    Places own;
    for (const MasterConfiguration& master : masters) own[master.number].source = master.source;
    return own;
}

Places places_of(const Arguments& arguments) {
    if (arguments.has("attach")) return numbered(arguments.values("attach"), &Place::socket);
    if (arguments.has("source")) return numbered(arguments.values("source"), &Place::source);
    auto places = sources_of_environment();
    return places.empty() ? places_of_system(arguments) : places;
}

// What belongs to a source of the program's own.
std::optional<Problem> check_attached(const Arguments& arguments) {
    for (const auto* option : {"source", "eni", "record", "trace", "take-over"})
        if (arguments.has(option))
            return Problem{fmt::format("--{} is not for a running application", option), samples::exit_code::kUsage};
    return std::nullopt;
}

std::unique_ptr<Session> open_session(unsigned index, const Place& place, const Arguments& arguments) {
    if (!place.socket.empty()) return std::make_unique<AttachedSession>(index, place.socket);
    StandaloneSettings settings{.index = index, .source = place.source};
    settings.options.record = arguments.value("record");
    settings.options.trace = arguments.has("trace");
    settings.options.real_time = arguments.has("watch");  // in virtual time the lines would be printed at once
    settings.take_over = arguments.has("take-over");
    settings.eni = arguments.value("eni");
    return std::make_unique<StandaloneSession>(std::move(settings));
}

}  // namespace

Answer<std::vector<Master>> find_masters(const Arguments& arguments) {
    for (const auto* option : {"attach", "source"})
        if (const auto values = arguments.values(option); std::ranges::find(values, "") != values.end())
            return Problem{fmt::format("--{} is empty", option), samples::exit_code::kUsage};
    const auto places = places_of(arguments);
    if (places.empty())
        return Problem{"no source: use --source, or set MARGAY_MASTER0, or --attach; see ethercat --help",
                       samples::exit_code::kUsage};
    const bool attached = !places.begin()->second.socket.empty();
    if (attached)
        if (const auto problem = check_attached(arguments)) return *problem;
    const auto wanted = Numbers::parse(arguments.has("master") ? arguments.value("master") : "-");
    if (!wanted)
        return Problem{
            fmt::format("--master: '{}' is no number, list or range of numbers (1,4,7-9)", arguments.value("master")),
            samples::exit_code::kUsage};
    std::vector<Master> masters;
    for (const auto& [index, place] : places)
        if (wanted->contains(index)) masters.push_back({index, open_session(index, place, arguments)});
    if (masters.empty())
        return Problem{
            fmt::format(
                "no master is selected by --master {}: {}", arguments.value("master"),
                attached ? samples::counted(places.size(), "application serves a socket", "applications serve a socket")
                         : samples::counted(places.size(), "master has a source", "masters have a source")),
            samples::exit_code::kUsage};
    std::vector<std::uint32_t> there;
    for (const auto& [index, place] : places) there.push_back(index);
    if (const auto missing = wanted->missing(there);
        missing && arguments.has("master") && arguments.value("master") != "-")
        return Problem{fmt::format("no master is selected by --master {}", *missing), samples::exit_code::kUsage};
    if (masters.size() > 1 && (arguments.has("record") || arguments.has("eni")))
        return Problem{"--record and --eni are for one master: use --master", samples::exit_code::kUsage};
    return masters;
}

}  // namespace margay::ethercat
