// simple_io: brings a segment to OP, lets the outputs count, and prints what comes in. What happens to slaves meanwhile
// is told, and put right while the others go on.
#include "common/cycle_pace.hpp"
#include "common/slave_report.hpp"
#include "common/source.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>

namespace {

using namespace margay;
using samples::al_text;
using samples::sentence;

struct Options {
    std::string source;
    std::string record;
    bool trace = false;
    unsigned cycles = 5000;
    samples::PaceOptions pace;
};

constexpr Duration kReplyTimeout = std::chrono::microseconds(500);

volatile std::sig_atomic_t stop_asked = 0;

class SimpleIo {
  public:
    SimpleIo(samples::Source& source, const Options& options) : source_(source), options_(options) {}

    // Returns what the program ends with.
    int run() {
        if (const auto ready = init(ctx_, source_.nic(), source_.osal()); !ready) return give_up(ready.error());
        const auto found = config_init(ctx_);
        if (!found) return give_up(found.error());
        const auto bytes = config_map(ctx_, image_);
        if (!bytes) return give_up(bytes.error());
        const Group& group = ctx_.group(0);
        fmt::print("{} slaves, {} octets out, {} in, {} frame{} a cycle, working counter {}\n", *found,
                   group.output_bytes, group.input_bytes, group.frames, group.frames == 1 ? "" : "s",
                   group.expected_wkc);
        tell_errors();
        if (!reach_op()) {
            tell_states();
            leave();
            return 1;
        }
        fmt::print("all slaves in OP\n");
        exchange();
        const auto& figures = pace_.figures();
        fmt::print("{} cycles, {} without all frames, {} with a wrong working counter\n", cycles_, figures.no_frame,
                   figures.wrong_wkc);
        print_inputs();
        leave();
        if (const auto failed = pace_.report(); !failed.empty()) {
            fmt::print(stderr, "simple_io: {}\n", failed);
            return 1;
        }
        return figures.wrong_wkc + figures.no_frame == 0 ? 0 : 1;
    }

  private:
    void leave() {
        supervise_.cancel();
        (void)writestate(ctx_, 0, AlState::init);
    }
    int give_up(const Error& error) {
        fmt::print(stderr, "simple_io: {}\n", sentence(error));
        tell_errors();
        return 1;
    }
    void tell_errors() {
        while (const auto error = ctx_.errors().take()) fmt::print(stderr, "simple_io: {}\n", sentence(*error));
        while (const auto odd = ctx_.warnings().take()) fmt::print(stderr, "simple_io: warning: {}\n", sentence(*odd));
    }
    void tell_states() {
        for (const Slave& slave : ctx_.slaves())
            if (slave.al.state != AlState::op || slave.al.error)
                fmt::print(stderr, "simple_io: slave {} ({}) is in {}\n", slave.position, slave.name(),
                           al_text(slave.al));
    }

    // One cycle: send, receive, and let everything else go on until the next one is due.
    Result<std::uint32_t> cycle() {
        const Time start = source_.osal().now();
        Result<std::uint32_t> got;
        const auto sent = send_processdata(ctx_);
        if (sent)
            got = receive_processdata(ctx_, kReplyTimeout);
        else
            got = sent.error();
        round_trip_ = source_.osal().now() - start;
        pace_.wait();
        return got;
    }

    // The supervision brings the slaves to OP, and back there whatever happens. Process data runs before: their
    // watchdogs want outputs.
    bool reach_op() {
        constexpr unsigned kMostCycles = 10'000;
        pace_.start();
        for (int n = 0; n < 10; ++n) (void)cycle();
        if (!submit(ctx_, supervise_)) return false;
        const auto in_op = [](const Slave& slave) { return slave.al.state == AlState::op && !slave.al.error; };
        for (unsigned n = 0; n < kMostCycles && stop_asked == 0; ++n) {
            (void)cycle();
            if (std::ranges::all_of(ctx_.slaves(), in_op)) break;
        }
        while (ctx_.events().take()) {
        }
        return std::ranges::all_of(ctx_.slaves(), in_op);
    }

    void exchange() {
        for (cycles_ = 0; cycles_ < options_.cycles && stop_asked == 0; ++cycles_) {
            for (std::size_t n = 0; n < ctx_.group(0).output_bytes; ++n)
                image_[n] = static_cast<std::byte>(cycles_ >> 6);
            const auto got = cycle();
            pace_.count(round_trip_, got);
            if (!got && (last_.code != got.error().code || last_.slave != got.error().slave))
                fmt::print(stderr, "simple_io: cycle {}: {}\n", cycles_, sentence(got.error()));
            last_ = got.error();
            tell_events();
        }
    }

    // Beside the cycle the supervision works; here is what it has to tell.
    void tell_events() {
        while (const auto event = ctx_.events().take()) {
            std::array<char, 400> text{};
            fmt::print("cycle {}: {}\n", cycles_, describe(*event, text));
        }
    }

    void print_inputs() {
        for (const Slave& slave : ctx_.slaves()) {
            if (slave.image.inputs.bits == 0) continue;
            fmt::print("slave {} ({}):", slave.position, slave.name());
            for (const std::byte octet : slave.image.inputs.bytes)
                fmt::print(" {:02x}", std::to_integer<unsigned>(octet));
            fmt::print("\n");
        }
    }

    samples::Source& source_;
    const Options& options_;
    HostContext ctx_{Limits{.slaves = 1024, .process_frames = 64}};
    std::array<std::byte, 65536> image_{};
    samples::CyclePace pace_{source_, ctx_, options_.pace};
    Duration round_trip_{};
    unsigned cycles_ = 0;
    Error last_;
    SuperviseRequest supervise_;
};

}  // namespace

int main(int argc, char** argv) {
    Options options;
    CLI::App app{"Brings all slaves to OP and exchanges process data: outputs count, inputs are printed at the end."};
    app.add_option("source", options.source,
                   "interface (eth0), simulated segment (sim:demo, sim:FILE, sim:a.bin,b.bin) or recording (pcap:FILE)")
        ->required();
    app.add_option("--cycles", options.cycles, "how many cycles in OP");
    samples::add_pace_options(app, options.pace);
    app.add_option("--record", options.record, "write every frame sent and received to this file, as pcap");
    app.add_flag("--trace", options.trace, "print a line for every datagram to standard error");
    CLI11_PARSE(app, argc, argv);
    std::setvbuf(stdout, nullptr, _IOLBF, 0);  // what happens is to be seen when it happens, in a log too
    auto source = margay::samples::open_source(options.source, {.record = options.record, .trace = options.trace});
    if (!source) {
        fmt::print(stderr, "simple_io: {}\n", source.error());
        return 1;
    }
    // The slaves are left in INIT, however it ends.
    (void)std::signal(SIGINT, [](int) { stop_asked = 1; });
    (void)std::signal(SIGTERM, [](int) { stop_asked = 1; });
    const auto program = std::make_unique<SimpleIo>(*source, options);
    const int status = program->run();
    const std::string remark = source->finish();
    if (!remark.empty()) fmt::print(stderr, "simple_io: {}\n", remark);
    return remark.empty() ? status : 1;
}
