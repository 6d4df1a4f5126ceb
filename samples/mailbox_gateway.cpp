// mailbox_gateway: tools reach the mailboxes of the slaves over UDP and TCP (ETG.8200).
#include "common/counted.hpp"
#include "common/listen_address.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"

#include <margay/gateway/mailbox_gateway.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string>

namespace {

using namespace margay;
using namespace margay::samples;
using namespace std::chrono_literals;

struct Options {
    SourceArguments source;
    std::string listen = "127.0.0.1:34980";
    bool read_only = false;
};

class Program {
  public:
    Program(Source& source, const MailboxGatewaySettings& settings) : source_(source), settings_(settings) {}

    int run() {
        if (const auto ready = source_.begin(ctx_); !ready) return fail(sentence(ready.error()));
        // Slaves that fail do not prevent the access of tools to the other slaves.
        if (const auto found = config_init(ctx_); !found) {
            if (ctx_.slaves().empty()) return fail(sentence(found.error()));
            while (const auto error = ctx_.errors().take()) warn(sentence(*error));
        }
        supervise_.target = AlState::preop;
        if (const auto begun = submit(ctx_, supervise_); !begun) return fail(sentence(begun.error()));
        MailboxGateway gateway(ctx_, settings_);
        if (!gateway.error().empty()) return fail(gateway.error(), exit_code::kSystem);
        for (const Slave& slave : ctx_.slaves())
            if (slave.mailbox.present())
                print_out("0x{:04x}: slave {} ({})\n", slave.station_address.value, slave.number, slave.name());
        print_out("listening at {}\n", to_text(ListenAddress{settings_.address, gateway.port()}));
        serve();
        const auto counts = gateway.counts();
        print_out("{}, {}, {}, {} of them errors\n", counted(counts.clients, "client"),
                  counted(counts.messages, "message"), counted(counts.replies, "reply", "replies"), counts.errors);
        supervise_.cancel();
        return exit_code::kWell;
    }

  private:
    void serve() {
        while (!stop_asked()) {
            const Time next = poll(ctx_, source_.osal().now());
            while (const auto event = ctx_.events().take()) {
                std::array<char, 400> text{};
                print_out("{}\n", describe(*event, text));
            }
            // A message of a client ends the wait.
            source_.osal().wait(std::min(next, source_.osal().now() + 100ms), source_.wait_handles());
        }
    }

    Source& source_;
    const MailboxGatewaySettings& settings_;
    HostContext ctx_{source_.limits(Limits{.slaves = 1024})};
    SuperviseRequest supervise_;
};

int run(Source& source, const MailboxGatewaySettings& settings) {
    std::setvbuf(stdout, nullptr, _IOLBF, 0);
    stop_at_signals();
    return std::make_unique<Program>(source, settings)->run();
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    Arguments arguments(
        "mailbox_gateway",
        "Lets tools reach the mailboxes of the slaves over UDP and TCP (ETG.8200): a frame is the EtherCAT frame "
        "header "
        "of type 5 and mailbox messages, whose address is the station address of the slave (0: the master). Brings the "
        "slaves to PREOP; exchanges no process data. Runs until SIGINT or SIGTERM.");
    add_source_arguments(arguments, options.source);
    arguments.option("--listen", options.listen,
                     "ADDRESS:PORT in digits. DANGER: the protocol has no passwords: whoever reaches another address "
                     "than that of this machine can write to the slaves");
    arguments.flag("--read-only", options.read_only, "refuse every message that may change a slave");
    return arguments.run(argc, argv, [&] {
        const auto where = parse_listen_address(options.listen, MailboxGatewaySettings::kPort);
        if (!where) return fail(fmt::format("--listen {}: is not ADDRESS:PORT", options.listen), exit_code::kUsage);
        if (!is_ip_address(where->address))
            return fail(fmt::format("--listen {}: is no IP address in digits", where->address), exit_code::kUsage);
        const MailboxGatewaySettings settings{
            .address = where->address, .port = where->port, .read_only = options.read_only};
        options.source.options.real_time = true;
        return run_on_source(options.source, [&](Source& source) { return run(source, settings); });
    });
}
