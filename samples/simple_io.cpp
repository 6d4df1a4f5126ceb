// simple_io: brings a segment to OP, exchanges process data, and prints it at the end. All outputs are 0, unless the
// user asks for a counter in them. It reports events of slaves; the supervision recovers such slaves while the other
// slaves continue.
#include "common/counted.hpp"
#include "common/cycle_pace.hpp"
#include "common/drives.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "common/xml_files.hpp"

#include <margay/attach/server.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/missing.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace margay;
using samples::al_text;
using samples::print_out;
using samples::sentence;
using samples::stop_asked;
using samples::warn;

struct Options {
    samples::SourceArguments source;
    unsigned cycles = 5000;
    bool count = false;       // write a counter to the outputs
    bool drives_too = false;  // also to the outputs of drives
    samples::PaceOptions pace;
    std::string eni{};     // file from which the segment is brought up
    std::string attach{};  // path of a socket for other programs; empty: none
};

class SimpleIo {
  public:
    SimpleIo(samples::Source& source, const Options& options, const files::EniConfiguration* eni)
        : source_(source), options_(options), eni_(eni), pace_(source, ctx_, options.pace, options.pace.plan(eni)) {}

    // Returns the exit code of the program.
    int run() {
        if (const auto ready = source_.begin(ctx_); !ready) return report_failure(ready.error());
        if (!options_.attach.empty()) {
            attach_.emplace(ctx_, options_.attach,
                            AttachSettings{.name = options_.source.source, .scan = AttachScan::search});
            if (!attach_->error().empty()) return samples::fail(attach_->error(), samples::exit_code::kSystem);
        }
        const auto found = samples::scan_by(ctx_, eni_);
        if (!found) return report_failure(found.error());
        const auto bytes = samples::map_groups(ctx_, eni_, image_);
        if (!bytes) return report_failure(bytes.error());
        const Group& group = ctx_.group(0);
        print_out("{}, {} out, {} in, {} a cycle, working counter {}\n", samples::counted(*found, "slave"),
                  samples::counted(group.output_bytes, "octet"), group.input_bytes,
                  samples::counted(group.frames, "frame"), group.expected_wkc);
        print_errors();
        if (options_.count) choose_outputs();
        if (!reach_op()) {
            if (!ends()) print_states();
            if (stop_asked() && !samples::output_lost()) warn("stopped before all slaves were in OP");
            if (!pace_.stopped().empty()) warn(pace_.stopped());
            leave();
            return 1;
        }
        print_out("all slaves in OP\n");
        if (const auto ring = samples::ring_remark(ctx_); !ring.empty()) warn("warning: " + ring);
        exchange();
        const auto& figures = pace_.figures();
        print_out("{}, {} without all frames, {} with a wrong working counter\n", samples::counted(cycles_, "cycle"),
                  figures.no_frame, figures.wrong_wkc);
        print_image();
        leave();
        if (const auto failed = pace_.report(); !failed.empty())
            return samples::fail(failed, samples::exit_code::kSystem);
        if (!pace_.stopped().empty()) warn(pace_.stopped());
        if (const auto advice = pace_.advice(); !advice.empty()) warn(advice);
        return figures.wrong_wkc + figures.no_frame == 0 && pace_.stopped().empty() ? 0 : 1;
    }

  private:
    [[nodiscard]] bool ends() const { return stop_asked() || !pace_.stopped().empty(); }
    void leave() {
        supervise_.cancel();
        (void)writestate(ctx_, 0, AlState::init);
    }
    int report_failure(const Error& error) {
        const std::string text = sentence(error);
        warn(text);
        print_errors(text);
        return 1;
    }
    void print_errors(const std::string& printed = {}) {
        for (const auto& text : samples::take_errors(ctx_, printed)) warn(text);
        while (const auto odd = ctx_.warnings().take()) warn("warning: " + sentence(*odd));
    }
    void print_states() {
        for (const Slave& slave : ctx_.slaves())
            if (slave.al.state != AlState::op || slave.al.error)
                warn(fmt::format("slave {} ({}) is in {}{}", slave.number, slave.name(), al_text(slave.al),
                                 slave.error.code == Errc::none ? std::string()
                                                                : ": " + samples::sentence_without_slave(slave.error)));
    }

    // Chooses the slaves whose outputs get the counter. A counter in the control word of a drive switches the drive on
    // and moves it, so that only an explicit wish includes drives.
    void choose_outputs() {
        if (!options_.drives_too) drives_ = samples::find_drives(ctx_);
        for (const samples::Drive& drive : drives_)
            print_out("slave {} ({}): {}: its outputs stay 0 (--drives-too includes it)\n", drive.slave,
                      ctx_.slave(drive.slave).name(), drive.why);
        for (const Slave& slave : ctx_.slaves())
            if (slave.image.outputs.bits != 0 &&
                std::ranges::find(drives_, slave.number, &samples::Drive::slave) == drives_.end())
                counting_.push_back(slave.image.outputs.bytes);
    }

    // One cycle: sends, receives, and executes the other work of the master until the next cycle is due.
    Result<std::uint32_t> cycle() {
        const auto got = pace_.exchange(pace_.reply_timeout());
        pace_.wait();
        return got;
    }

    // The supervision brings the slaves to OP, and back to OP after any fault. The first process data is exchanged
    // before the supervision starts, because the SyncManager watchdogs of the slaves need outputs.
    bool reach_op() {
        constexpr unsigned kLeastCycles = 50;  // with long periods
        const Time give_up = source_.osal().now() + std::chrono::seconds(10);
        pace_.start();
        for (int n = 0; n < 10; ++n) (void)cycle();
        if (!submit(ctx_, supervise_)) return false;
        const auto in_op = [this](const Slave& slave) {
            if (slave.ring_position == 0) return margay::may_be_missing(ctx_, slave.number);
            return slave.al.state == AlState::op && !slave.al.error;
        };
        bool all_in_op = false;
        for (unsigned n = 0; !all_in_op && !ends() && (n < kLeastCycles || source_.osal().now() < give_up); ++n) {
            (void)cycle();
            all_in_op = std::ranges::all_of(ctx_.slaves(), in_op);
        }
        while (ctx_.events().take()) {
        }
        if (!all_in_op && !ends()) warn("not all slaves are in OP yet:");
        return all_in_op;
    }

    void exchange() {
        pace_.clear();
        for (cycles_ = 0; cycles_ < options_.cycles && !ends(); ++cycles_) {
            for (const auto outputs : counting_) std::ranges::fill(outputs, static_cast<std::byte>(cycles_ >> 6));
            const auto got = cycle();
            if (!got && (last_.code != got.error().code || last_.slave != got.error().slave))
                warn(fmt::format("cycle {}: {}", cycles_, sentence(got.error())));
            last_ = got.error();
            print_events();
        }
    }

    // The supervision works between the cycles. Its events are printed here.
    void print_events() {
        while (const auto event = ctx_.events().take()) {
            std::array<char, 400> text{};
            print_out("cycle {}: {}\n", cycles_, describe(*event, text));
        }
    }

    static void print_octets(const Slave& slave, std::string_view what, std::span<const std::byte> octets) {
        if (octets.empty()) return;
        print_out("slave {} ({}){}:", slave.number, slave.name(), what);
        for (const std::byte octet : octets) print_out(" {:02x}", std::to_integer<unsigned>(octet));
        print_out("\n");
    }
    void print_image() {
        for (const Slave& slave : ctx_.slaves()) {
            if (slave.image.inputs.bits != 0) print_octets(slave, "", slave.image.inputs.bytes);
            if (slave.image.outputs.bits != 0) print_octets(slave, " outputs", slave.image.outputs.bytes);
        }
    }

    samples::Source& source_;
    const Options& options_;
    const files::EniConfiguration* eni_;  // nullptr: the data of the slaves is used
    HostContext ctx_{source_.limits(samples::with_room({.slaves = 1024, .process_frames = 64}, eni_))};
    std::array<std::byte, 65536> image_{};
    samples::CyclePace pace_;
    unsigned cycles_ = 0;  // in OP
    std::vector<samples::Drive> drives_;
    std::vector<std::span<std::byte>> counting_;  // outputs that get the counter
    Error last_;
    SuperviseRequest supervise_;
    std::optional<AttachServer> attach_{};  // ends before the context
};

int run(samples::Source& source, const Options& options, const files::EniConfiguration* eni) {
    // Line buffering: each event appears in a terminal or a log file at once.
    std::setvbuf(stdout, nullptr, _IOLBF, 0);
    samples::stop_at_signals();  // after a signal, too, the program puts the slaves to INIT before it ends
    return std::make_unique<SimpleIo>(source, options, eni)->run();
}

int open_and_run(Options& options) {
    samples::EniFile file;
    if (!options.eni.empty()) file = samples::load_eni(options.eni);
    if (file.configuration && file.configuration->groups.size() > 1)
        file.error = options.eni + ": has several Cyclic elements, and this program has one cycle";
    if (!file.error.empty()) return samples::fail(file.error, samples::exit_code::kSystem);
    const auto* eni = file.configuration ? &*file.configuration : nullptr;
    const auto plan = options.pace.plan(eni);
    if (!plan.remark.empty()) samples::warn("warning: " + plan.remark);
    if (const auto wrong = options.pace.refusal(plan); !wrong.empty())
        return samples::fail(wrong, samples::exit_code::kUsage);
    options.source.options.times = wanted_times(options.pace.times);
    options.source.options.real_time = !options.attach.empty();
    return run_on_source(options.source, [&](samples::Source& source) { return run(source, options, eni); });
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    samples::Arguments arguments(
        "simple_io",
        "Brings all slaves to OP, exchanges process data, and prints inputs and outputs at the "
        "end. All outputs are 0, unless --count is given.");
    add_source_arguments(arguments, options.source);
    arguments.option("--cycles", options.cycles, "how many cycles in OP");
    arguments.flag("--count", options.count,
                   "write a counter to the outputs. DANGER: outputs switch on and axes may move. Slaves that are known "
                   "to be drives are left out");
    arguments.flag("--drives-too", options.drives_too,
                   "write the counter to the outputs of drives, too. DANGER: drives are switched on and move",
                   "--count");
    arguments.option("--eni", options.eni, "bring the segment up as this ENI file says");
    arguments.option(
        "--attach", options.attach,
        "let `ethercat --attach` and other programs work on this one, by a socket at this path; a simulated "
        "segment then runs in the time of the system");
    samples::add_pace_options(arguments, options.pace, samples::kPeriodOfEni);
    return arguments.run(argc, argv, [&] { return open_and_run(options); });
}
