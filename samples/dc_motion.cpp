// dc_motion: moves all CiA 402 drives of a segment along a sine in the mode "cyclic synchronous position". The cycle
// follows the reference clock (master shift), and SYNC0 of every drive occurs half a cycle after the frames. At the end
// the program prints how far the drives were behind their targets, and how synchronous the clocks were.
#include "common/arguments.hpp"
#include "common/counted.hpp"
#include "common/cycle_report.hpp"
#include "common/frame_times.hpp"
#include "common/gnuplot.hpp"
#include "common/new_file.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"

#include <margay/clocks.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/master_clock.hpp>
#include <margay/timed_send.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace {

using namespace margay;
using samples::print_out;
using samples::sentence;
using samples::stop_asked;
using samples::warn;

struct Options {
    samples::SourceArguments source;
    unsigned period_us = 1000;
    unsigned sines = 5;
    unsigned sine_ms = 1000;
    unsigned amplitude = 200'000;
    bool move = false;
    std::string log;
    std::string svg;
    samples::FrameTimeOptions times{};
};

// CiA 402 "State machine": the control word that brings the drive one step nearer to "operation enabled".
std::uint16_t control_for(std::uint16_t status, bool odd_cycle) {
    constexpr std::uint16_t kShutdown = 0x06;
    constexpr std::uint16_t kSwitchOn = 0x07;
    constexpr std::uint16_t kEnable = 0x0F;
    constexpr std::uint16_t kResetFault = 0x80;
    if ((status & 0x4F) == 0x08) return odd_cycle ? kResetFault : std::uint16_t{0};
    switch (status & 0x6F) {
        case 0x21: return kSwitchOn;
        case 0x23:
        case 0x27: return kEnable;
        default: return (status & 0x4F) == 0x40 ? kShutdown : std::uint16_t{0};
    }
}
bool is_enabled(std::uint16_t status) { return (status & 0x6F) == 0x27; }

// A cycle as an interpolation period (object 0x60C2): the value, and the power of ten of its unit in seconds.
struct Interpolation {
    std::uint8_t value = 0;
    std::int8_t power = 0;
};
std::optional<Interpolation> interpolation_of(unsigned period_us) {
    unsigned unit_us = 1000;
    for (std::int8_t power = -3; power >= -6; --power, unit_us /= 10)
        if (period_us % unit_us == 0 && period_us / unit_us <= 255)
            return Interpolation{static_cast<std::uint8_t>(period_us / unit_us), power};
    return std::nullopt;
}

struct Axis {
    explicit Axis(std::uint16_t number)
        : slave(number),
          control{number, 0x6040},
          target{number, 0x607A},
          mode{number, 0x6060},
          status{number, 0x6041},
          actual{number, 0x6064} {
        mode.optional = true;
    }
    std::uint16_t slave;
    Output<std::uint16_t> control;
    Output<std::int32_t> target;
    Output<std::int8_t> mode;
    Input<std::uint16_t> status;
    Input<std::int32_t> actual;
    std::int32_t start = 0;
    std::vector<double> behind;  // by cycle
    std::vector<double> way;     // by cycle, from `start`
};

double greatest(const std::vector<double>& values) {
    double most = 0;
    for (const double value : values) most = std::max(most, std::abs(value));
    return most;
}
double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

class Motion {
  public:
    Motion(samples::Source& source, const Options& options, Interpolation interpolation)
        : source_(source), options_(options), period_(std::chrono::microseconds(options.period_us)) {
        constexpr auto kWhen = Transition::preop_to_safeop;
        constexpr std::int8_t kCyclicPosition = 8;
        startup_ = {write_object(kWhen, 0x6060, 0, kCyclicPosition).that_may_fail(),
                    write_object(kWhen, 0x60C2, 1, interpolation.value).that_may_fail(),
                    write_object(kWhen, 0x60C2, 2, interpolation.power).that_may_fail()};
        setup_.startup = startup_;
        setup_.dc = {.source = SyncSettings::Source::application, .sync0_cycle = period_};
        clock_.emplace(MasterClockSettings{.set_value = -period_ / 2, .phase = {.cycle = period_}});
    }

    int run() {
        if (const auto ready = source_.begin(ctx_); !ready) return report(ready.error());
        if (const auto found = config_init(ctx_); !found) return report(found.error());
        if (!find_axes()) return samples::fail("there is no CiA 402 drive with CoE");
        const auto reference = configdc(ctx_, {.cycle = period_});
        if (!reference) return report(reference.error());
        ctx_.group(0).config.entries = handles_;
        if (const auto mapped = config_map(ctx_, image_); !mapped) return report(mapped.error());
        if (!submit(ctx_, supervise_)) return samples::fail("no supervision");
        const CycleSettings settings{.period = period_,
                                     .clock = &*clock_,
                                     .send_at = source_.timing().send_at,
                                     .send_lead = std::chrono::microseconds(options_.times.send_at_us)};
        if (const auto up = reach(ctx_, AlState::op, std::chrono::seconds(20), settings); !up) {
            leave();
            return report(up.error());
        }
        print_out("{}, reference clock of slave {}, all in OP\n", samples::counted(axes_.size(), "drive"), *reference);
        const auto work = [this](const CycleInfo& cycle) { return one_cycle(cycle); };
        if (const auto ended = run_cycle(ctx_, settings, work); !ended) warn(sentence(ended.error()));
        leave();
        return finish();
    }

  private:
    enum class Phase : std::uint8_t { settling, enabling, moving, stopping };

    int report(const Error& error) {
        const std::string text = sentence(error);
        warn(text);
        for (const auto& other : samples::take_errors(ctx_, text)) warn(other);
        return samples::exit_code::kSegment;
    }
    void leave() {
        supervise_.cancel();
        (void)writestate(ctx_, 0, AlState::init);
    }

    // Drives have device profile 402 in object 0x1000.
    bool find_axes() {
        for (const Slave& slave : ctx_.slaves()) {
            if ((slave.mailbox.protocols & mailbox_protocol::kCoE) == 0) continue;
            std::array<std::byte, 4> type{};
            const auto read = SDOread(ctx_, slave.number, 0x1000, 0, false, type);
            if (!read || std::to_integer<unsigned>(type[0]) + 256 * std::to_integer<unsigned>(type[1]) != 402) continue;
            axes_.push_back(std::make_unique<Axis>(slave.number));
            ctx_.slave(slave.number).config.setup = &setup_;
            Axis& axis = *axes_.back();
            for (EntryHandle* handle : std::initializer_list<EntryHandle*>{&axis.control, &axis.target, &axis.mode,
                                                                           &axis.status, &axis.actual})
                handles_.push_back(handle);
        }
        return !axes_.empty();
    }

    bool one_cycle(const CycleInfo& cycle) {
        constexpr unsigned kMostWaiting = 20'000;
        note(cycle);
        ++in_phase_;
        const bool enabled =
            std::ranges::all_of(axes_, [](const auto& axis) { return is_enabled(axis->status.read()); });
        switch (phase_) {
            case Phase::settling:
                if (clock_->state() == PhaseState::in_sync) enter(Phase::enabling);
                break;
            case Phase::enabling:
                if (enabled) enter(Phase::moving);
                break;
            case Phase::moving:
                if (!enabled) fault_ = "a drive has left \"operation enabled\"";
                if (in_phase_ >= cycles_of_motion() || !enabled || stop_asked()) enter(Phase::stopping);
                break;
            case Phase::stopping:
                if (in_phase_ >= 200) return false;
                break;
        }
        if (phase_ < Phase::moving && (in_phase_ > kMostWaiting || stop_asked())) {
            // run_program() prints the message about lost output.
            if (!stop_asked())
                fault_ =
                    phase_ == Phase::settling ? "the cycle does not come into sync" : "not all drives could be enabled";
            else if (!samples::output_lost())
                fault_ = "stopped before the drives moved";
            return false;
        }
        for (const auto& axis : axes_) command(*axis);
        return true;
    }
    void enter(Phase phase) {
        phase_ = phase;
        in_phase_ = 0;
        if (phase == Phase::moving) {
            clock_->reset_statistics();
            missed_before_ = missed();
            for (const auto& axis : axes_) axis->start = axis->actual.read();
        }
    }
    [[nodiscard]] unsigned cycles_of_motion() const {
        return static_cast<unsigned>(std::uint64_t{options_.sines} * options_.sine_ms * 1000 / options_.period_us);
    }

    void command(Axis& axis) {
        const std::uint16_t status = axis.status.read();
        axis.mode.write(8);
        if (phase_ != Phase::moving) axis.target.write(phase_ == Phase::stopping ? axis.start : axis.actual.read());
        if (phase_ == Phase::settling || phase_ == Phase::stopping) return axis.control.write(0x06);
        axis.control.write(control_for(status, in_phase_ % 2 != 0));
        if (phase_ != Phase::moving) return;
        if (in_phase_ > 0) {
            axis.behind.push_back(static_cast<double>(axis.target.read()) - axis.actual.read());
            axis.way.push_back(static_cast<double>(axis.actual.read()) - axis.start);
        }
        const double turns = static_cast<double>(in_phase_) * options_.period_us / (1000.0 * options_.sine_ms);
        const double way = options_.amplitude * (1 - std::cos(2 * std::numbers::pi * turns)) / 2;
        axis.target.write(axis.start + static_cast<std::int32_t>(std::lround(way)));
    }

    void note(const CycleInfo& cycle) {
        ++cycles_;
        if (cycle.error.code != Errc::none) ++wrong_cycles_;
        const ClockRecord& record = clock_->record();
        if (!options_.log.empty()) {
            std::array<char, 300> line{};
            log_ += write_clock_log(record, line);
        }
        if (phase_ == Phase::moving && in_phase_ > 0) {
            errors_.push_back(static_cast<double>(record.error_ns));
            differences_.push_back(static_cast<double>(record.difference_ns));
            if (cycle.error.code == Errc::none || cycle.error.code == Errc::working_counter)
                watch_.count(ctx_, source_.timing(), wire_);
            else
                watch_.forget();
        }
        while (const auto event = ctx_.events().take()) {
            std::array<char, 400> text{};
            print_out("cycle {}: {}\n", cycle.number, describe(*event, text));
        }
    }

    int finish() {
        double apart = 0;
        for (const auto& axis : axes_) {
            print_out("slave {} ({}): following error {:.0f} increments at most, {:.1f} rms\n", axis->slave,
                      ctx_.slave(axis->slave).name(), greatest(axis->behind), rms(axis->behind));
            for (std::size_t n = 0; n < std::min(axis->way.size(), axes_[0]->way.size()); ++n)
                apart = std::max(apart, std::abs(axis->way[n] - axes_[0]->way[n]));
        }
        print_out("drives apart by {:.0f} increments at most\n", apart);
        print_out("phase of the cycle: {} ns off on average, {} ns at most, drift {:.3f} ppm: {}\n",
                  clock_->average_ns(), clock_->most_ns(), clock_->drift_ppb() / 1000.0, to_text(clock_->state()));
        print_out("clocks of the slaves: {:.0f} ns apart at most (upper estimate), {} wrong\n", greatest(differences_),
                  samples::counted(wrong_cycles_, "cycle"));
        if (wire_.any()) print_out("{}", samples::wire_text(wire_));
        if (const auto frames = missed() - missed_before_; frames != 0) warn(samples::missed_text(frames));
        if (const int failed = write_files(); failed != 0) return failed;
        if (!fault_.empty()) return samples::fail(fault_);
        if (wrong_cycles_ > cycles_ / 100) return samples::fail("more than one cycle of a hundred was wrong");
        return stop_asked() ? samples::exit_code::kSegment : samples::exit_code::kWell;
    }

    // Frames that did not leave at their time.
    [[nodiscard]] std::uint64_t missed() {
        TimedSend* const timed = source_.timing().send_at;
        return timed == nullptr ? 0 : timed->missed();
    }

    int write_files() {
        if (!options_.log.empty()) {
            std::array<char, 400> head{};
            samples::NewFile file(options_.log);
            std::string error = file.write(std::string(write_clock_log_head(head)) + log_);
            if (error.empty()) error = file.commit();
            if (!error.empty()) return samples::fail(error, samples::exit_code::kSystem);
        }
        if (options_.svg.empty() || errors_.empty()) return 0;
        samples::Diagram way{"Position", "increments", {}};
        samples::Diagram behind{"Following error", "increments", {}};
        std::vector<double> times;
        const std::size_t cycles = std::min(errors_.size(), axes_[0]->way.size());
        for (std::size_t n = 0; n < cycles; ++n) times.push_back(static_cast<double>(n) * options_.period_us * 1e-6);
        for (const auto& axis : axes_) {
            const std::string name = fmt::format("slave {}", axis->slave);
            way.curves.push_back({name, axis->way});
            behind.curves.push_back({name, axis->behind});
        }
        const auto failed = samples::draw_svg(options_.svg, times,
                                              {way,
                                               behind,
                                               {"Phase of the cycle", "ns", {{"error", errors_}}},
                                               {"Clocks of the slaves", "ns", {{"difference", differences_}}}});
        return failed.empty() ? 0 : samples::fail(failed, samples::exit_code::kSystem);
    }

    samples::Source& source_;
    const Options& options_;
    Duration period_;
    std::array<StartupCommand, 3> startup_{};
    SlaveSetup setup_{};
    HostContext ctx_{source_.limits(Limits{.slaves = 256, .process_frames = 16})};
    std::array<std::byte, 32768> image_{};
    std::vector<std::unique_ptr<Axis>> axes_;
    std::vector<EntryHandle*> handles_;
    std::optional<MasterClock> clock_;
    SuperviseRequest supervise_;
    Phase phase_ = Phase::settling;
    unsigned in_phase_ = 0;
    unsigned cycles_ = 0;
    unsigned wrong_cycles_ = 0;
    samples::WireFigures wire_{};  // while the drives move
    samples::WireWatch watch_{};
    std::uint64_t missed_before_ = 0;
    std::vector<double> errors_;
    std::vector<double> differences_;
    std::string log_;
    std::string fault_;
};

int run(samples::Source& source, const Options& options) {
    if (!source.virtual_time() && !options.move)
        return samples::fail("this program moves all drives of the segment; --move says that you want it",
                             samples::exit_code::kUsage);
    const auto interpolation = interpolation_of(options.period_us);
    if (!interpolation)
        return samples::fail("object 0x60C2 has no value for this --period", samples::exit_code::kUsage);
    std::setvbuf(stdout, nullptr, _IOLBF, 0);
    samples::stop_at_signals();
    const auto motion = std::make_unique<Motion>(source, options, *interpolation);
    return motion->run();
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    samples::Arguments arguments("dc_motion",
                                 "Moves all CiA 402 drives along a sine, synchronously by distributed clocks, and "
                                 "prints following error and synchrony.");
    add_source_arguments(arguments, options.source);
    arguments.option("--period", options.period_us, "cycle period in µs", samples::Bounds{100, 100'000});
    arguments.option("--sines", options.sines, "how many periods of the sine", samples::Bounds{1, 1000});
    arguments.option("--sine-ms", options.sine_ms, "period of the sine in ms", samples::Bounds{100, 60'000});
    arguments.option("--amplitude", options.amplitude, "way from end to end in increments",
                     samples::Bounds{0, 1'000'000'000});
    arguments.flag("--move", options.move, "needed on an interface. DANGER: all drives are switched on and move");
    add_frame_time_options(arguments, options.times);
    arguments.option("--log", options.log, "file for the log of the master clock (CSV, see dc_plot)");
    arguments.option("--svg", options.svg, "file for a picture (SVG, by gnuplot)");
    return arguments.run(argc, argv, [&] {
        if (const auto wrong = refusal(options.times, options.period_us); !wrong.empty())
            return samples::fail(wrong, samples::exit_code::kUsage);
        if (samples::is_same_file(options.log, options.svg))
            return samples::fail("--log and --svg name the same file", samples::exit_code::kUsage);
        options.source.options.times = wanted_times(options.times);
        return run_on_source(options.source, [&](samples::Source& source) { return run(source, options); });
    });
}
