// segment_fidelity: sends the frames of the master in a recording to a simulated segment and reports how the answers
// differ from the hardware.
#include "common/arguments.hpp"
#include "common/fidelity.hpp"
#include "common/program.hpp"

namespace {

using namespace margay::samples;

int compare(const std::string& recording, const std::string& description) {
    const auto capture = load_capture(recording);
    if (!capture.error.empty()) return fail(capture.error, exit_code::kSystem);
    if (!capture.remark.empty()) warn("note: " + capture.remark);
    auto segment = load_segment(description);
    if (!segment) return fail(segment.error(), exit_code::kSystem);
    const auto report = measure_fidelity(capture, *segment);
    write_out(to_text(report));
    const bool equal =
        report.datagrams != 0 && report.equal_wkc == report.datagrams && report.equal_octets == report.data_octets;
    return equal ? exit_code::kWell : exit_code::kSegment;
}

}  // namespace

int main(int argc, char** argv) {
    Arguments arguments(
        "segment_fidelity",
        "Compares the answers of a simulated segment with those that real hardware gave in a recording. "
        "Ends with 1 where they differ.");
    std::string recording;
    std::string description;
    arguments.positional("CAPTURE", recording, "pcap or pcapng file with both ways of the traffic");
    arguments.positional("SEGMENT", description,
                         "ready-made segment (demo, drives), segment description (FILE.toml), or SII images separated "
                         "by commas");
    return arguments.run(argc, argv, [&] { return compare(recording, description); });
}
