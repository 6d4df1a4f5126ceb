// subdevice_check: checks whether a slave obeys the rules of the EtherCAT standard, similar to ETG.7000.
#include "common/json_text.hpp"
#include "common/program.hpp"
#include "common/progress_line.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "subdevice_check/check.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <nlohmann/json.hpp>

namespace {

using namespace margay::samples;

struct Options {
    SourceArguments source;
    std::uint16_t number = 0;
    bool json = false;
    bool all = false;
    conformance::Options checks{};
};

int check(Source& source, const Options& options) {
    margay::HostContext ctx(source.limits(margay::Limits{.slaves = 2048}));
    const auto ready = source.begin(ctx);
    if (!ready) return fail(sentence(ready.error()));
    ProgressLine line;
    const auto checked =
        conformance::check_device(ctx, source.osal(), source.wait_handles(), options.number, options.checks,
                                  [&](std::string_view name) { line.show(std::string(name)); });
    line.clear();
    if (checked.report.checks.empty())
        return fail(checked.error, checked.wrong_arguments ? exit_code::kUsage : exit_code::kSegment);
    write_out(options.json ? json_text(conformance::report_json(checked.report))
                           : conformance::report_text(checked.report, options.all));
    if (!checked.error.empty()) return fail(checked.error);
    return checked.report.conforms() ? exit_code::kWell : exit_code::kSegment;
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    Arguments arguments(
        "subdevice_check",
        "Checks whether a slave keeps the rules of the EtherCAT standard: EEPROM, state machine, "
        "SyncManagers, mailbox, CoE, PDOs, watchdog, clock. The slave passes all states again and again "
        "and gets wrong requests on purpose; its outputs are 0. All other slaves stay in PREOP. Do not "
        "use it on a machine.");
    add_source_arguments(arguments, options.source);
    arguments.positional("NUMBER", options.number, "the slave, 1 is the first", Arguments::Presence::required);
    arguments.flag("--json", options.json, "print JSON for programs");
    arguments.flag("--all", options.all, "also print the checks that passed or do not apply");
    arguments.option("--only", options.checks.only,
                     "only checks whose names begin with one of these, for example states,mailbox.repeat");
    arguments.flag(
        "--eeprom-write", options.checks.write_eeprom,
        "also write the EEPROM: the alias, with the value that it has, and the word behind the content, which "
        "gets its old value again");
    return arguments.run(argc, argv, [&] {
        if (options.number == 0) return fail("NUMBER of the slave is 0; 1 is the first slave", exit_code::kUsage);
        stop_at_signals();
        return run_on_source(options.source, [&](Source& source) { return check(source, options); });
    });
}
