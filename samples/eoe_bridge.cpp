// eoe_bridge: gives each slave with EoE a network interface of the kernel (TAP). Bridging and routing between these
// interfaces and others is the work of the kernel.
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "common/tap_nic.hpp"

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

// A slave and its interface.
struct Line {
    std::string name;
    TapNic tap;
    EoePortMemory<64, 64, EoePort::kMostAtOnce> memory;
    EoePort port{memory};
    std::uint64_t not_taken = 0;  // frames that the kernel did not take
};

class Bridge {
  public:
    Bridge(Source& source, const Options& options) : source_(source), options_(options) {}

    int run() {
        if (const auto ready = source_.begin(ctx_); !ready) return fail(sentence(ready.error()));
        // Slaves that fail do not keep the others from their interfaces.
        if (const auto found = config_init(ctx_); !found) {
            if (ctx_.slaves().empty()) return fail(sentence(found.error()));
            while (const auto error = ctx_.errors().take()) warn(sentence(*error));
        }
        if (const int code = open_lines(); code != exit_code::kWell) return code;
        supervise_.target = AlState::preop;
        if (const auto begun = submit(ctx_, supervise_); !begun) return fail(sentence(begun.error()));
        const int code = exchange();
        for (const auto& line : lines_) {
            line->port.cancel();
            report(*line);
        }
        supervise_.cancel();
        return code;
    }

  private:
    // eoe<master>s<position>, the first position is 0; for a slave with an alias eoe<master>a<alias>.
    [[nodiscard]] std::string name_of(const Slave& slave) const {
        if (slave.alias != 0) return fmt::format("eoe{}a{}", options_.master, slave.alias);
        return fmt::format("eoe{}s{}", options_.master, slave.number - 1);
    }

    int open_lines() {
        for (const Slave& slave : ctx_.slaves()) {
            if ((slave.mailbox.protocols & mailbox_protocol::kEoE) == 0) continue;
            auto line = std::make_unique<Line>();
            line->name = name_of(slave);
            line->port.slave = slave.number;
            if (const auto begun = submit(ctx_, line->port); !begun) {
                warn(fmt::format("no interface {}: {}", line->name, sentence(begun.error())));
                continue;
            }
            if (const auto problem = line->tap.open(line->name); !problem.empty())
                return fail(problem, exit_code::kSystem);
            print_out("{}: slave {} ({})\n", line->name, slave.number, slave.name());
            lines_.push_back(std::move(line));
        }
        return lines_.empty() ? fail("no slave of the segment exchanges Ethernet frames (EoE)") : exit_code::kWell;
    }

    // Passes frames between the interfaces and the ports.
    void pass() {
        std::array<std::byte, kEoeFrameBytes> buffer;
        for (const auto& line : lines_) {
            while (const auto frame = line->port.receive(buffer))
                line->not_taken += line->tap.send(std::span(buffer).first(frame->bytes)) == SendStatus::sent ? 0U : 1U;
            while (line->port.can_send()) {
                const auto size = line->tap.receive(buffer);
                if (size == 0) break;
                (void)line->port.send(std::span(buffer).first(size));
            }
        }
    }

    // Ends the lines whose interface was deleted.
    void end_deleted() {
        std::erase_if(lines_, [](const std::unique_ptr<Line>& line) {
            if (!line->tap.gone()) return false;
            warn(fmt::format("the interface {} was deleted: its frames are not exchanged any more", line->name));
            line->port.cancel();
            report(*line);
            return true;
        });
    }

    int exchange() {
        const Duration interval = std::chrono::seconds(options_.statistics_s);
        Time report_at = options_.statistics_s == 0 ? kNever : source_.osal().now() + interval;
        print_out("running\n");
        while (!stop_asked()) {
            pass();
            end_deleted();
            if (lines_.empty()) return fail("all interfaces were deleted", exit_code::kSystem);
            const Time next = poll(ctx_, source_.osal().now());
            print_events();
            if (source_.osal().now() >= report_at) {
                for (const auto& line : lines_) report(*line);
                report_at += interval;
            }
            if (!wait(std::min(next, report_at)))
                return fail(fmt::format("waiting failed: {}", std::strerror(errno)), exit_code::kSystem);
        }
        return exit_code::kWell;
    }

    // Until a frame of the segment or of an interface arrives, whose port has room for it.
    bool wait(Time until) {
        files_.assign(1, {source_.nic().wait_handle(), POLLIN, 0});
        if (Nic* const second = source_.second()) files_.push_back({second->wait_handle(), POLLIN, 0});
        for (const auto& line : lines_)
            if (line->port.can_send()) files_.push_back({line->tap.wait_handle(), POLLIN, 0});
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

    static void report(Line& line) {
        const EoeStatistics s = line.port.statistics();
        const auto dropped_out = s.refused + s.not_sent;
        const auto dropped_in = s.overrun + s.incomplete + s.malformed + s.too_long;
        print_out("{}: to the slave {} frames, {} octets, {} dropped; from the slave {} frames, {} octets, {} dropped",
                  line.name, s.sent, s.sent_octets, dropped_out, s.received, s.received_octets, dropped_in);
        if (dropped_in != 0)
            print_out(" ({} queue full, {} fragment missing, {} malformed, {} too long)", s.overrun, s.incomplete,
                      s.malformed, s.too_long);
        if (line.not_taken != 0) print_out("; {} not taken by the kernel", line.not_taken);
        print_out("\n");
    }

    Source& source_;
    const Options& options_;
    HostContext ctx_{source_.limits(Limits{.slaves = 1024})};
    std::vector<std::unique_ptr<Line>> lines_;
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
    add_source_arguments(arguments, options.source);
    arguments.option("--master", options.master, "number of the master in the names of the interfaces", Bounds{0, 99});
    arguments.option("--statistics", options.statistics_s,
                     "print the counters of each interface at this interval in seconds; 0: only at the end",
                     Bounds{0, 86400});
    return arguments.run(argc, argv, [&] {
        return run_on_source(options.source, [&](Source& source) { return bridge(source, options); });
    });
}
