// ethercat: the commands of IgH's command line tool, without a kernel module. See ethercat/README.md.
#include "common/program.hpp"
#include "common/source_arguments.hpp"
#include "ethercat/attached.hpp"
#include "ethercat/call.hpp"
#include "ethercat/help.hpp"
#include "ethercat/standalone.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace {

using namespace margay::ethercat;
namespace samples = margay::samples;

// The sources of the masters: those of the arguments, or those of the environment.
std::vector<std::pair<unsigned, std::string>> sources_of(const Arguments& arguments) {
    std::vector<std::pair<unsigned, std::string>> all;
    for (const auto& source : arguments.values("source")) all.emplace_back(static_cast<unsigned>(all.size()), source);
    if (!all.empty()) return all;
    constexpr unsigned kMost = 64;
    for (unsigned n = 0; n < kMost; ++n)
        if (const char* source = std::getenv(fmt::format("MARGAY_MASTER{}", n).c_str());
            source != nullptr && *source != 0)
            all.emplace_back(n, source);
    return all;
}

// The sockets of running applications: those of --attach; without any source also those in the usual folder.
std::vector<std::string> sockets_of(const Arguments& arguments, bool any_source) {
    auto all = arguments.values("attach");
    if (!all.empty() || any_source) return all;
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/run/margay", ignored))
        if (entry.path().extension() == ".sock") all.push_back(entry.path());
    std::ranges::sort(all);
    return all;
}

// What belongs to a source of the program's own.
std::optional<Problem> check_attached(const Arguments& arguments) {
    for (const auto* option : {"source", "eni", "record", "trace", "take-over"})
        if (arguments.has(option))
            return Problem{fmt::format("--{} is not for a running application", option), samples::exit_code::kUsage};
    return std::nullopt;
}

Answer<std::vector<Master>> attached_masters(const std::vector<std::string>& sockets, const Arguments& arguments) {
    if (const auto problem = check_attached(arguments)) return *problem;
    const auto wanted = Numbers::parse(arguments.has("master") ? arguments.value("master") : "-");
    if (!wanted)
        return Problem{
            fmt::format("--master: '{}' is no number, list or range of numbers (1,4,7-9)", arguments.value("master")),
            samples::exit_code::kUsage};
    std::vector<Master> masters;
    for (unsigned index = 0; index < sockets.size(); ++index)
        if (wanted->contains(index))
            masters.push_back({index, std::make_unique<AttachedSession>(index, sockets[index])});
    if (masters.empty())
        return Problem{fmt::format("no master is selected by --master {}: {} applications serve a socket",
                                   arguments.value("master"), sockets.size()),
                       samples::exit_code::kUsage};
    return masters;
}

Answer<std::vector<Master>> masters_of(const Arguments& arguments) {
    const auto sources = arguments.has("attach") ? decltype(sources_of(arguments)){} : sources_of(arguments);
    const auto sockets = sockets_of(arguments, !sources.empty());
    if (!sockets.empty()) return attached_masters(sockets, arguments);
    if (sources.empty())
        return Problem{"no source: use --source, or set MARGAY_MASTER0, or --attach; see ethercat --help",
                       samples::exit_code::kUsage};
    auto wanted = Numbers::parse(arguments.has("master") ? arguments.value("master") : "-");
    if (!wanted)
        return Problem{
            fmt::format("--master: '{}' is no number, list or range of numbers (1,4,7-9)", arguments.value("master")),
            samples::exit_code::kUsage};
    std::vector<Master> masters;
    for (const auto& [index, source] : sources) {
        if (!wanted->contains(index)) continue;
        StandaloneSettings settings{.index = index, .source = source};
        settings.options.record = arguments.value("record");
        settings.options.trace = arguments.has("trace");
        settings.take_over = arguments.has("take-over");
        settings.eni = arguments.value("eni");
        masters.push_back({index, std::make_unique<StandaloneSession>(std::move(settings))});
    }
    if (masters.empty())
        return Problem{fmt::format("no master is selected by --master {}: {} have a source", arguments.value("master"),
                                   sources.size()),
                       samples::exit_code::kUsage};
    if (masters.size() > 1 && (arguments.has("record") || arguments.has("eni")))
        return Problem{"--record and --eni are for one master: use --master", samples::exit_code::kUsage};
    return masters;
}

int execute(const Arguments& arguments) {
    std::vector<Master> masters;
    if (!arguments.command->without_master) {
        auto found = masters_of(arguments);
        if (!found) {
            const int code = samples::fail(found.problem().text, found.problem().code);
            if (sources_of(arguments).empty())
                (void)std::fputs((samples::list_of_interfaces() + samples::list_of_segments("sim:")).c_str(), stderr);
            return code;
        }
        masters = std::move(*found);
    }
    Call call(arguments, std::move(masters));
    int code = arguments.command->run(call);
    for (Master& master : call.masters()) {
        const auto messages = master.session->messages();
        if (!arguments.has("quiet"))
            for (const auto& message : messages) samples::warn("warning: " + message);
        const auto closed = master.session->close();
        if (!closed) code = std::max(code, call.fail(closed.problem()));
    }
    return code;
}

int run(const std::vector<std::string>& words) {
    const auto arguments = parse(words);
    if (!arguments) {
        const int code = samples::fail(arguments.problem().text, arguments.problem().code);
        return code;
    }
    if (arguments->has("help"))
        samples::write_out(help_text(arguments->command));
    else if (arguments->has("version"))
        samples::print_out("ethercat (Margay) {}\n", MARGAY_VERSION_TEXT);
    else if (arguments->has("man"))
        samples::write_out(man_page());
    else if (arguments->has("completion"))
        samples::write_out(bash_completion());
    else
        return execute(*arguments);
    return samples::exit_code::kWell;
}

}  // namespace

int main(int argc, char** argv) {
    return samples::run_program("ethercat", [&] { return run({argv + std::min(argc, 1), argv + argc}); });
}
