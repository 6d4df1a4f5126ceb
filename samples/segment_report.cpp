// segment_report: writes what a segment, a running application or a recording shows as one HTML page.
#include "common/cycle_pace.hpp"
#include "common/new_file.hpp"
#include "common/program.hpp"
#include "common/progress_line.hpp"
#include "common/source_arguments.hpp"
#include "ethercat/attached.hpp"
#include "ethercat/standalone.hpp"
#include "segment_report/collect.hpp"
#include "segment_report/page.hpp"
#include "source/interface_nic.hpp"

#include "analyse/recording.hpp"

#include <margay/files/text_place.hpp>
#include <margay/version.hpp>

#include <fmt/format.h>

#include <net/if.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>

namespace {

using namespace margay;
using namespace margay::segment_report;
namespace fs = std::filesystem;
namespace exit_code = samples::exit_code;
using samples::fail;

struct Options {
    samples::SourceArguments source{};
    std::string output = "report.html";
    std::string attach{};
    std::string eni{};
    std::string cycle_log{};
    std::string dc_log{};
    unsigned cycles = 0;
    bool record = false;
    bool no_dictionary = false;
    bool no_map = false;
    samples::PaceOptions pace{};
    std::string command{};
};

std::string local_time() {
    const std::time_t now = std::time(nullptr);
    std::tm local{};
    (void)::localtime_r(&now, &local);
    std::array<char, 64> text{};
    return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S %z", &local)};
}

bool is_recording(const std::string& source) {
    const auto extension = fs::path(source).extension();
    return (extension == ".pcap" || extension == ".pcapng" || extension == ".cap") && !source.starts_with("pcap:") &&
           !source.starts_with("sim:");
}

// A contradiction between arguments; empty: there is none.
std::string contradiction(const Options& options) {
    const bool attached = !options.attach.empty();
    const bool recording = !attached && is_recording(options.source.source);
    if (attached && !options.source.source.empty()) return "SOURCE and --attach are two sources: give one of them";
    if (!attached && options.source.source.empty()) return "SOURCE is missing; see segment_report --help";
    if (options.record && options.output == "-") return "--record writes a file beside the page: give --output a name";
    if (options.no_map && options.cycles != 0) return "--cycles needs the process data: leave --no-map out";
    if (!attached && !recording) return {};
    const std::string_view what = attached ? "a running application" : "a recording";
    for (const auto& [given, name] :
         {std::pair{options.record, "--record"}, std::pair{options.cycles != 0, "--cycles"},
          std::pair{!options.eni.empty(), "--eni"}, std::pair{options.source.take_over, "--take-over"},
          std::pair{options.source.options.trace, "--trace"}})
        if (given) return fmt::format("{} is not for {}", name, what);
    return {};
}

// Reads the log of a master's clock and the figures of its cycles. Returns a sentence about an error.
std::string read_logs(const Options& options, Report& report) {
    if (const auto& path = options.dc_log; !path.empty()) {
        const auto file = files::read_file(path);
        if (!file.error.empty()) return file.error;
        auto log = samples::parse_clock_log(file.octets);
        if (!log.fault.empty()) return path + ": " + log.fault;
        report.clock_log = std::move(log);
        report.clock_log_file = path;
    }
    if (const auto& path = options.cycle_log; !path.empty()) {
        const auto file = files::read_file(path);
        if (!file.error.empty()) return file.error;
        const auto log = samples::parse_cycle_log(file.octets);
        if (!log.fault.empty()) return path + ": " + log.fault;
        report.cycle_log = log.figures;
        report.cycle_log_file = path;
    }
    return {};
}

Recording read_recording(const std::string& at, const std::string& name, bool beside) {
    std::error_code ignored;
    Recording recording{.file = name, .beside = beside, .analysis = analyse::analyse_file(at)};
    const auto size = fs::file_size(at, ignored);
    recording.octets = ignored ? 0 : size;
    return recording;
}

class Program {
  public:
    explicit Program(const Options& options) : options_(options) {
        report_.version = MARGAY_VERSION_TEXT;
        report_.command = options.command;
        report_.begun = local_time();
        report_.source = options.attach.empty() ? options.source.source : options.attach;
        if (options.output != "-") page_ = std::make_unique<samples::NewFile>(options.output);
        if (options.record)
            pcap_ = std::make_unique<samples::NewFile>(fs::path(options.output).replace_extension(".pcap").string());
    }

    int run() {
        if (const auto wrong = contradiction(options_); !wrong.empty()) return refuse_arguments(wrong);
        if (const auto failed = read_logs(options_, report_); !failed.empty()) return fail(failed, exit_code::kSystem);
        // A file that cannot be written is reported before the segment is accessed.
        for (auto* file : {page_.get(), pcap_.get()}) {
            const auto failed = file == nullptr ? std::string() : file->write({});
            if (!failed.empty()) return fail(failed, exit_code::kSystem);
        }
        samples::stop_at_signals();
        const int code = !options_.attach.empty()               ? read_application()
                         : is_recording(options_.source.source) ? read_file()
                                                                : read_segment();
        if (code != exit_code::kWell) return code;
        if (samples::stop_asked()) return fail("stopped: no report is written", exit_code::kSystem);
        report_.ended = local_time();
        return save();
    }

  private:
    int refuse_arguments(const std::string& wrong) const {
        const int code = fail(wrong, exit_code::kUsage);
        if (options_.source.source.empty() && options_.attach.empty())
            (void)std::fputs((samples::list_of_interfaces() + samples::list_of_segments("sim:")).c_str(), stderr);
        return code;
    }

    [[nodiscard]] CollectSettings settings() {
        return {.dictionaries = !options_.no_dictionary,
                .map = !options_.no_map,
                .progress = [this](const std::string& text) { text.empty() ? line_.clear() : line_.show(text); }};
    }

    int read_application() {
        report_.origin = Origin::application;
        report_.machine = read_machine({});
        ethercat::AttachedSession session(0, options_.attach);
        auto how = settings();
        // An application can have missing slaves, which slaves() does not list.
        how.expected = [&] { return session.configs(); };
        collect(session, how, report_);
        line_.clear();
        read_interfaces_of_application();
        return report_.failure.empty() ? exit_code::kWell : fail(report_.failure, report_.failure_code);
    }

    // The application says what its source is; its socket is on this machine, and so are the interfaces. The driver is
    // asked here and not by the application, whose cycle would wait for it.
    void read_interfaces_of_application() {
        if (!report_.failure.empty()) return;
        const auto& source = report_.master.source;
        auto names = hosted::interfaces_of(source);
        // An application can give its source any name, and may run in another network namespace.
        const auto is_here = [](const std::string& name) { return ::if_nametoindex(name.c_str()) != 0; };
        if (!names.empty() && std::ranges::all_of(names, is_here))
            report_.machine = read_machine(names);
        else if (!source.starts_with("sim:"))
            report_.machine.interface_problems.push_back(
                fmt::format("The application calls its source '{}', which is no interface of this machine.", source));
    }

    int read_file() {
        report_.origin = Origin::recording;
        report_.machine = read_machine({});
        const auto& path = options_.source.source;
        report_.recording = read_recording(path, fs::path(path).filename().string(), false);
        const auto& analysis = report_.recording->analysis;
        const bool nothing = !analysis.problem.empty() && analysis.frames.ethercat == 0;
        return nothing ? fail(path + ": " + analysis.problem, exit_code::kSystem) : exit_code::kWell;
    }

    int read_segment() {
        report_.machine = read_machine(hosted::interfaces_of(options_.source.source));
        ethercat::StandaloneSettings wanted{.source = options_.source.source,
                                            .options = options_.source.options,
                                            .take_over = options_.source.take_over,
                                            .eni = options_.eni,
                                            .note_states = true};
        if (pcap_ != nullptr) wanted.options.record = pcap_->beside();
        ethercat::StandaloneSession session(std::move(wanted));
        auto how = settings();
        if (!options_.eni.empty()) how.expected = [&] { return session.expected(); };
        if (options_.cycles != 0) how.cycles = [&] { return run_cycles(session); };
        collect(session, how, report_);
        line_.clear();
        report_.virtual_time = session.virtual_time();
        const auto& found = session.found_states();
        for (SlaveState& slave : report_.slaves)
            if (slave.facts.position < found.size()) slave.found = found[slave.facts.position];
        const auto closed = session.close();
        // A segment that could not be scanned is reported too, but not one that another master runs.
        if (session.refused() || (!report_.failure.empty() && report_.failure_code != exit_code::kSegment))
            return fail(report_.failure, report_.failure_code);
        // If a recording has no replies to this program, the page would contain no facts.
        if (!closed && options_.source.source.starts_with("pcap:"))
            return fail(closed.problem().text, closed.problem().code);
        if (!report_.failure.empty()) samples::warn(report_.failure);
        if (!closed && closed.problem().code == exit_code::kSystem)
            return fail(closed.problem().text, exit_code::kSystem);
        if (!closed) report_.messages.push_back(closed.problem().text);
        if (pcap_ != nullptr)
            report_.recording = read_recording(pcap_->beside(), fs::path(pcap_->path()).filename().string(), true);
        return exit_code::kWell;
    }

    [[nodiscard]] Cycles run_cycles(ethercat::StandaloneSession& session) const {
        const auto run = session.run_cycles(options_.cycles, options_.pace);
        if (!run) return {.problem = run.problem().text};
        Cycles cycles{.figures = run->figures,
                      .period_us = static_cast<unsigned>(run->period / std::chrono::microseconds(1))};
        if (!run->problem.empty()) cycles.problem = "Not all slaves have reached OP: " + run->problem;
        return cycles;
    }

    int save() {
        const Page page = write_page(report_);
        const int code = page.worst == Severity::fault ? exit_code::kSegment : exit_code::kWell;
        if (page_ == nullptr) {
            samples::write_out(page.html);
            return code;
        }
        auto failed = page_->write(page.html);
        if (failed.empty() && pcap_ != nullptr) failed = pcap_->commit();
        if (failed.empty()) failed = page_->commit();
        if (!failed.empty()) return fail(failed, exit_code::kSystem);
        samples::print_out("{}: {}\n", options_.output, page.headline);
        return code;
    }

    const Options& options_;
    Report report_{};
    std::unique_ptr<samples::NewFile> page_{};
    std::unique_ptr<samples::NewFile> pcap_{};
    samples::ProgressLine line_{};
};

void add_options(samples::Arguments& arguments, Options& options) {
    using Presence = samples::Arguments::Presence;
    arguments.positional("SOURCE", options.source.source,
                         samples::source_text() +
                             ", or the name of a recording of any master (FILE.pcap, FILE.pcapng), which is analysed "
                             "without asking anything",
                         Presence::optional);
    arguments.option("-o,--output", options.output,
                     "the page; an existing file is replaced when the new one is complete; "
                     "-: standard output");
    arguments.option("--attach", options.attach,
                     "read from a running application, by the socket at this path, in place of SOURCE");
    arguments.option("--eni", options.eni, "expect and configure the slaves as this ENI file says");
    arguments.option(
        "--cycles", options.cycles,
        "bring the slaves to OP with outputs of 0, run this number of cycles, and show their times; 0: none");
    samples::add_period_options(arguments, options.pace, samples::kPeriodOfEni);
    arguments.option("--cycle-log", options.cycle_log,
                     "show the times of an application's cycles in this file (simple_io, dc_motion or segment_monitor "
                     "--histogram FILE.json)");
    arguments.option("--dc-log", options.dc_log, "show this log of a master's clock (dc_motion --log)");
    arguments.flag("--record", options.record,
                   "write every frame sent and received beside the page (report.html: report.pcap), and analyse it");
    arguments.flag("--no-dictionary", options.no_dictionary,
                   "do not read the object dictionaries of slaves of the same product");
    arguments.flag("--no-map", options.no_map,
                   "do not map the process data: slaves stay in PREOP (otherwise they go to SAFEOP and back)");
    arguments.flag("--trace", options.source.options.trace, "print a line for every datagram to standard error");
    arguments.flag(
        "--take-over", options.source.take_over,
        "scan also when slaves are in SAFEOP or OP, for example under another master; the slaves go to INIT");
    arguments.without_arguments([] { return samples::list_of_interfaces() + samples::list_of_segments("sim:"); });
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    for (int n = 0; n < argc; ++n) options.command += fmt::format("{}{}", n == 0 ? "" : " ", argv[n]);
    samples::Arguments arguments(
        "segment_report",
        "Writes what a segment shows as one HTML page without references to other files: slaves, topology, error "
        "counters with verdicts, process image, differences between alike devices, EEPROM, clocks. Ends with 0 when "
        "the "
        "page names no fault, with 1 when it names one or the segment could not be read.");
    add_options(arguments, options);
    return arguments.run(argc, argv, [&] { return Program(options).run(); });
}
