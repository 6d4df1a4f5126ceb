// nic_check: reports whether an interface, the kernel and the machine are suitable for EtherCAT, and the command that
// corrects each fault.
#include "common/arguments.hpp"
#include "common/program.hpp"
#include "common/source_arguments.hpp"
#include "nic_check/findings.hpp"
#include "nic_check/read.hpp"

namespace {

using namespace margay::samples;

struct Options {
    std::string interface {};
    bool json = false;
    bool probe = false;
    bool try_xdp = false;
    unsigned frames = 1000;
};

int check(const Options& options) {
    using namespace margay::nic_check;
    Facts facts;
    const auto refusal = read_interface(options.interface, {}, facts.interface);
    if (!refusal.empty()) return fail(refusal, exit_code::kSystem);
    facts.machine = read_machine({});
    if (options.try_xdp) try_xdp(facts.interface);
    if (options.probe) facts.probe = probe(options.interface, options.frames);
    const auto findings = judge(facts);
    write_out(options.json ? findings_json(facts, findings) : findings_text(facts, findings));
    if (!facts.probe) return exit_code::kWell;
    if (!facts.probe->problem.empty()) return fail(facts.probe->problem, exit_code::kSystem);
    return facts.probe->returned == 0 ? fail("no slave answers") : exit_code::kWell;
}

}  // namespace

int main(int argc, char** argv) {
    Arguments arguments("nic_check",
                        "Says what an interface, the kernel and the machine can do for EtherCAT: good, could be better "
                        "(with the command that mends it), or not known. Sends nothing without --probe, and changes "
                        "nothing without --try-xdp. Findings are no errors: only an interface that cannot be used, or "
                        "a probe without an answer, ends with another code than 0.");
    Options options;
    arguments.positional("IFACE", options.interface, "interface (eth0)");
    arguments.flag("--json", options.json, "print JSON for programs");
    arguments.flag("--probe", options.probe,
                   "measure round trips: broadcast reads of register 0, which change nothing in slaves. Not beside a "
                   "running master");
    arguments.option("--frames", options.frames, "frames of --probe, one each millisecond", Bounds{1, 1'000'000});
    arguments.flag(
        "--try-xdp", options.try_xdp,
        "try the modes of AF_XDP. Not beside a running master: it loses frames, and some drivers restart the "
        "link");
    arguments.without_arguments([] { return list_of_interfaces(); });
    return arguments.run(argc, argv, [&] { return check(options); });
}
