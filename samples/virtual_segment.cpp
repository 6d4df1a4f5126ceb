// Serves a simulated segment on a network interface, in real time, to any master.
#include "common/segment_console.hpp"
#include "common/segment_server.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

int main(int argc, char** argv) {
    CLI::App app(
        "Serves a simulated EtherCAT segment on a network interface. Commands on standard input while it "
        "runs; \"help\" lists "
        "them. SIGUSR1 breaks the last cable, SIGUSR2 heals all.");
    margay::samples::ServerOptions options;
    std::string description;
    app.add_option("IFNAME", options.interface, "network interface, or the name of the TAP device with --tap")
        ->required();
    app.add_option("SEGMENT", description, "segment description, \"demo\", or SII images separated by commas")
        ->required();
    app.add_flag("--tap", options.tap, "make a TAP device of that name");
    app.add_option("--record", options.record, "write all frames to this pcap file");
    app.add_flag("--quiet", options.quiet, "do not print who talks and which states change");
    CLI11_PARSE(app, argc, argv);

    margay::samples::SegmentServer server;
    if (const auto problem = server.open(description, options); !problem.empty()) {
        fmt::print(stderr, "{}\n", problem);
        return 1;
    }
    return server.run() ? 0 : 1;
}
