// The request that exchanges Ethernet frames with a slave.
#include "mailbox/eoe.hpp"

#include "api/mail.hpp"

namespace margay {

static Error check(Network& network, const EoePort& port) {
    const Error where{.step = Step::eoe_frames, .slave = port.slave};
    if (!port.has_memory()) return invalid(Argument::eoe_port_memory, where.step, port.slave);
    if (port.look_every <= Duration{0}) return invalid(Argument::interval, where.step, port.slave);
    if (port.send_patience <= Duration{0}) return invalid(Argument::timeout, where.step, port.slave);
    const Error refused = check_mailbox(network, mailbox_protocol::kEoE, where);
    if (refused.code != Errc::none) return refused;
    return check_message(network, wire::eoe::kLeastRoom, where);
}

static Task<Result<>> run(Network& network, EoePort& port) { return eoe_relay(channel_of(network, port), port); }

static constexpr OperationDescription kPort =
    describe_operation<EoePort, check, run>(Operation::eoe_port, Step::eoe_frames, Needs::nothing, Ends::when_canceled);

EoePort::EoePort(std::span<std::byte> to_slave, std::span<std::byte> from_slave, std::span<std::byte> parts)
    : MailRequest(kPort), to_slave_(to_slave), from_slave_(from_slave), parts_(parts) {}

}  // namespace margay
