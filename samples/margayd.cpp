// margayd: EtherCAT masters as a service. See margayd/README.md.
#include "common/program.hpp"
#include "margayd/log.hpp"
#include "margayd/service.hpp"
#include "margayd/texts.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace {

using namespace margay;
using namespace margay::service;
namespace exit_code = samples::exit_code;

// The given options with their values, or a sentence.
struct Parsed {
    std::map<std::string, std::string, std::less<>> values{};
    std::string problem{};
    [[nodiscard]] bool has(std::string_view name) const { return values.contains(name); }
};

Parsed parse(const std::vector<std::string>& words) {
    Parsed parsed;
    for (std::size_t n = 0; n < words.size(); ++n) {
        const auto& word = words[n];
        if (!word.starts_with("-")) return {.problem = fmt::format("unexpected argument '{}'", word)};
        const auto equals = std::min(word.find('='), word.size());
        const auto name = word == "-h" ? "help" : word.starts_with("--") ? word.substr(2, equals - 2) : std::string();
        const auto option = std::ranges::find(program_options(), name, &ProgramOption::name);
        if (option == program_options().end())
            return {.problem = fmt::format("there is no option '{}'", word.substr(0, equals))};
        if (option->value.empty()) {
            if (equals != word.size()) return {.problem = fmt::format("--{} takes no value", name)};
            parsed.values[name];
            continue;
        }
        if (equals == word.size() && n + 1 == words.size())
            return {.problem = fmt::format("--{} needs a value: {}", name, option->value)};
        parsed.values[name] = equals == word.size() ? words[++n] : word.substr(equals + 1);
    }
    return parsed;
}

int check(const ServiceOptions& options) {
    const auto configuration =
        samples::read_service_configuration(options.config, samples::ConfigurationCheck::whole, options.sockets);
    int code = exit_code::kWell;
    if (!is_usable(configuration, options.config, code)) return code;
    for (const auto& master : configuration.masters)
        samples::print_out("{}: master {}, source {}, socket {}\n", master.name, master.number, master.source,
                           samples::socket_path(master, options.sockets));
    return exit_code::kWell;
}

int run(const std::vector<std::string>& words) {
    begin_log();
    const auto parsed = parse(words);
    if (!parsed.problem.empty()) {
        log(Priority::error, parsed.problem + "; see margayd --help");
        return exit_code::kUsage;
    }
    ServiceOptions options;
    // systemd has created this folder (RuntimeDirectory=margay).
    if (const char* folder = std::getenv("RUNTIME_DIRECTORY"); folder != nullptr && *folder != 0)
        options.sockets = folder;
    if (parsed.has("config")) options.config = parsed.values.at("config");
    if (parsed.has("sockets")) options.sockets = parsed.values.at("sockets");
    if (parsed.has("help"))
        samples::write_out(help_text());
    else if (parsed.has("version"))
        samples::print_out("margayd (Margay) {}\n", MARGAY_VERSION_TEXT);
    else if (parsed.has("man"))
        samples::write_out(man_page());
    else if (parsed.has("completion"))
        samples::write_out(bash_completion());
    else
        return parsed.has("check") ? check(options) : Service(options).run();
    return exit_code::kWell;
}

}  // namespace

int main(int argc, char** argv) {
    return samples::run_program("margayd", [&] { return run({argv + std::min(argc, 1), argv + argc}); });
}
