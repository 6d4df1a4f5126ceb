// eoe_bridge: gives each slave with EoE a network interface of the kernel (TAP). The kernel bridges and routes between
// these interfaces and others.
#include "common/eoe_lines.hpp"
#include "common/interface_claim.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>

#include <poll.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace margay;
using namespace margay::samples;
using namespace std::chrono_literals;

struct Options {
    SourceArguments source;
    unsigned master = 0;
    unsigned statistics_s = 0;
};

class Bridge {
  public:
    Bridge(Source& source, const Options& options) : source_(source), options_(options) {}

    int run() {
        if (const auto ready = source_.begin(ctx_); !ready) return fail(sentence(ready.error()));
        // Slaves that fail do not prevent the interfaces of other slaves.
        if (const auto found = config_init(ctx_); !found) {
            if (ctx_.slaves().empty()) return fail(sentence(found.error()));
            while (const auto error = ctx_.errors().take()) warn(sentence(*error));
        }
        if (const int code = open_lines(); code != exit_code::kWell) return code;
        supervise_.target = AlState::preop;
        if (const auto begun = submit(ctx_, supervise_); !begun) return fail(sentence(begun.error()));
        const int code = exchange();
        lines_.cancel();
        report();
        supervise_.cancel();
        return code;
    }

  private:
    int open_lines() {
        bool any = false;
        for (const Slave& slave : ctx_.slaves()) {
            if (!has_eoe(slave)) continue;
            any = true;
            if (const auto shared = shared_alias(slave, ctx_.slaves()); !shared.empty()) warn(shared);
            const auto name = eoe_interface_name(options_.master, slave, ctx_.slaves());
            const auto opened = lines_.open(ctx_, slave, name);
            if (opened)
                print_out("{}: slave {} ({})\n", name, slave.number, slave.name());
            else if (opened.refused)
                warn(opened.problem);
            else
                return fail(opened.problem, exit_code::kSystem);
        }
        if (!lines_.empty()) return exit_code::kWell;
        if (any) return fail("no interface was created", exit_code::kSystem);
        return fail("no slave of the segment exchanges Ethernet frames (EoE)");
    }

    int exchange() {
        const Duration interval = std::chrono::seconds(options_.statistics_s);
        Time report_at = options_.statistics_s == 0 ? kNever : source_.osal().now() + interval;
        print_out("running\n");
        while (!stop_asked()) {
            (void)lines_.pass();
            for (const auto& [what, counters] : lines_.end_deleted()) {
                warn(what);
                print_out("{}\n", counters);
            }
            if (lines_.empty()) return fail("all interfaces were deleted", exit_code::kSystem);
            const Time next = poll(ctx_, source_.osal().now());
            print_events();
            if (source_.osal().now() >= report_at) {
                report();
                report_at += interval;
            }
            if (!wait(std::min(next, report_at)))
                return fail(fmt::format("waiting failed: {}", std::strerror(errno)), exit_code::kSystem);
        }
        return exit_code::kWell;
    }

    // Waits until a frame arrives from the segment, or from an interface whose port has room for it.
    bool wait(Time until) {
        files_.assign(1, {source_.nic().wait_handle(), POLLIN, 0});
        if (Nic* const second = source_.second()) files_.push_back({second->wait_handle(), POLLIN, 0});
        lines_.add_files(files_);
        const Duration pause = std::clamp<Duration>(until - source_.osal().now(), 0ns, 100ms);
        const timespec timeout{0, static_cast<long>(pause.count())};
        return ::ppoll(files_.data(), files_.size(), &timeout, nullptr) >= 0 || errno == EINTR;
    }

    void print_events() {
        while (const auto event = ctx_.events().take()) {
            std::array<char, 400> text{};
            print_out("{}\n", describe(*event, text));
        }
    }

    void report() const {
        for (const auto& line : lines_.report()) print_out("{}\n", line);
    }

    Source& source_;
    const Options& options_;
    HostContext ctx_{source_.limits(Limits{.slaves = 1024})};
    EoeLines lines_;
    std::vector<pollfd> files_;
    SuperviseRequest supervise_;
};

int bridge(Source& source, const Options& options) {
    if (source.virtual_time())
        return fail(
            "SOURCE must be a network interface: a simulated segment or a recording has no real time "
            "(virtual_segment connects a simulated segment to an interface)",
            exit_code::kUsage);
    std::setvbuf(stdout, nullptr, _IOLBF, 0);
    stop_at_signals();
    return std::make_unique<Bridge>(source, options)->run();
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    Arguments arguments(
        "eoe_bridge",
        "Gives each slave with EoE a network interface: eoe0s1 for the second slave of the segment "
        "(eoe0a7 for a slave with the alias 7). Bridge or route it with the tools of the system, for "
        "example: ip link set eoe0s1 master br0. Brings the slaves to PREOP; exchanges no process data. "
        "Runs until SIGINT or SIGTERM, and then removes the interfaces. Needs the capability "
        "CAP_NET_ADMIN.");
    add_interface_arguments(arguments, options.source);
    arguments.option("--master", options.master, "number of the master in the names of the interfaces", Bounds{0, 99});
    arguments.option("--statistics", options.statistics_s,
                     "print the counters of each interface at this interval in seconds; 0: only at the end",
                     Bounds{0, 86400});
    return arguments.run(argc, argv, [&] {
        // The claim comes before the scan, which would bring the slaves of a running bridge to INIT.
        InterfaceClaim claim;
        if (const auto taken = claim.take("eoe_bridge", options.source.source); !taken.empty())
            return fail(taken, exit_code::kSystem);
        return run_on_source(options.source, [&](Source& source) { return bridge(source, options); });
    });
}
