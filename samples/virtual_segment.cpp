// virtual_segment: connects a simulated segment to a network interface, in real time, for any master.
#include "common/program.hpp"
#include "common/segment_console.hpp"
#include "common/segment_server.hpp"
#include "common/source_arguments.hpp"

namespace {

using namespace margay::samples;

int serve(const std::string& description, const ServerOptions& options) {
    SegmentServer server;
    if (const auto problem = server.open(description, options); !problem.empty())
        return fail(problem, exit_code::kSystem);
    return server.run() ? exit_code::kWell : exit_code::kSystem;
}

}  // namespace

int main(int argc, char** argv) {
    Arguments arguments("virtual_segment",
                        "Serves a simulated EtherCAT segment on a network interface. Commands on standard input while "
                        "it runs; \"help\" lists them. SIGUSR1 breaks the last cable, SIGUSR2 reconnects all cables.");
    ServerOptions options;
    std::string description;
    arguments.positional("IFNAME", options.interface,
                         "network interface, or the name of the TAP device with --tap; two with '+' between "
                         "them at both ends of a ring");
    arguments.positional("SEGMENT", description,
                         "ready-made segment (demo, drives), segment description (FILE.toml), or SII images separated "
                         "by commas; may begin with sim: as for other programs");
    arguments.flag("--tap", options.tap, "make a TAP device of that name");
    arguments.option("--record", options.record, "write all frames to this pcap file");
    arguments.option("--ports", options.ports,
                     "make a TAP device for the Ethernet port of each slave with EoE, with this name and the position "
                     "of the slave, the first is 0: gw1");
    arguments.flag("--quiet", options.quiet, "do not report masters and state changes");
    arguments.without_arguments([] { return list_of_interfaces() + list_of_segments(""); });
    return arguments.run(argc, argv, [&] {
        constexpr std::string_view kSimulated = "sim:";
        if (description.starts_with(kSimulated)) description.erase(0, kSimulated.size());
        return serve(description, options);
    });
}
