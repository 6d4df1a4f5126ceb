// Puts the master's half of a recording to a simulated segment and tells how its answers differ from the
// hardware's.
#include "common/fidelity.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

int main(int argc, char** argv) {
    CLI::App app("Compares the answers of a simulated segment with those that real hardware gave in a recording.");
    std::string recording;
    std::string description;
    app.add_option("CAPTURE", recording, "pcap or pcapng file with both ways of the traffic")->required();
    app.add_option("SEGMENT", description, "segment description, \"demo\", or SII images separated by commas")
        ->required();
    CLI11_PARSE(app, argc, argv);

    using namespace margay::samples;
    const auto capture = load_capture(recording);
    if (!capture.error.empty()) {
        fmt::print(stderr, "{}\n", capture.error);
        return 1;
    }
    if (!capture.remark.empty()) fmt::print(stderr, "note: {}\n", capture.remark);
    auto segment = load_segment(description);
    if (!segment) {
        fmt::print(stderr, "{}\n", segment.error());
        return 1;
    }
    const auto report = measure_fidelity(capture, *segment);
    fmt::print("{}", to_text(report));
    return report.datagrams != 0 && report.equal_wkc == report.datagrams && report.equal_octets == report.data_octets
               ? 0
               : 2;
}
