// dc_plot: draws the log of a master clock (dc_motion --log, or the columns of other masters' logs) as SVG.
#include "common/arguments.hpp"
#include "common/clock_log_file.hpp"
#include "common/counted.hpp"
#include "common/new_file.hpp"
#include "common/program.hpp"

#include <margay/files/text_place.hpp>

#include <algorithm>
#include <cmath>

namespace {

using namespace margay;
using samples::print_out;

struct Options {
    std::string log;
    std::string svg;
};

double greatest(const std::vector<double>& values) {
    double most = 0;
    for (const double value : values) most = std::max(most, std::abs(value));
    return most;
}

int run(const Options& options) {
    if (samples::is_same_file(options.log, options.svg))
        return samples::fail("--svg would replace the log", samples::exit_code::kUsage);
    const auto file = files::read_file(options.log);
    if (!file.error.empty()) return samples::fail(file.error, samples::exit_code::kSystem);
    const auto log = samples::parse_clock_log(file.octets);
    if (!log.fault.empty()) return samples::fail(options.log + ": " + log.fault, samples::exit_code::kSystem);
    const std::string svg = options.svg.empty() ? options.log + ".svg" : options.svg;
    const auto failed = samples::draw_svg(svg, log.times_s, samples::clock_diagrams(log));
    if (!failed.empty()) return samples::fail(failed, samples::exit_code::kSystem);
    print_out(
        "{}, {:.3f} s: greatest error {:.0f} ns, drift {:.3f} ppm at the end, greatest difference {:.0f} ns: "
        "{}\n",
        samples::counted(log.times_s.size(), "cycle"), log.times_s.back(), greatest(log.error_ns), log.drift_ppm.back(),
        greatest(log.difference_ns), svg);
    return samples::exit_code::kWell;
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    samples::Arguments arguments("dc_plot",
                                 "Draws offset, drift and error of a log of the master clock as SVG, by gnuplot.");
    arguments.positional("LOG", options.log, "the log, as dc_motion --log writes it");
    arguments.option("--svg", options.svg, "the file to write; otherwise LOG.svg");
    return arguments.run(argc, argv, [&] { return run(options); });
}
