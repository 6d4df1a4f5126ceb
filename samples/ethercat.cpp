// ethercat: the commands of IgH's command line tool, without a kernel module. See ethercat/README.md.
#include "common/program.hpp"
#include "common/source_arguments.hpp"
#include "ethercat/call.hpp"
#include "ethercat/help.hpp"
#include "ethercat/standalone.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>

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

Answer<std::vector<Master>> masters_of(const Arguments& arguments) {
    const auto sources = sources_of(arguments);
    if (sources.empty())
        return Problem{"no source: use --source, or set MARGAY_MASTER0; see ethercat --help",
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
