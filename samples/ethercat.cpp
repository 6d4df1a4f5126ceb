// ethercat: the commands of IgH's command line tool, without a kernel module. See ethercat/README.md.
#include "common/program.hpp"
#include "common/source_arguments.hpp"
#include "ethercat/call.hpp"
#include "ethercat/find_masters.hpp"
#include "ethercat/help.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace {

using namespace margay::ethercat;
namespace samples = margay::samples;

int execute(const Arguments& arguments) {
    std::vector<Master> masters;
    if (!arguments.command->without_master) {
        auto found = find_masters(arguments);
        if (!found) {
            const int code = fail(arguments, found.problem());
            if (found.problem().text.starts_with("no source"))
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
        // The arguments could not be read, so only the option in full shows which output the user wants.
        Arguments wanted;
        if (std::ranges::find(words, "--json") != words.end()) wanted.options.emplace_back("json", "");
        return fail(wanted, arguments.problem());
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
