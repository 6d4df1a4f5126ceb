// Start-up commands of AoE and EoE (startup.hpp): messages that a slave gets at its state transitions, and answers.
//
//     static const auto kNetId = margay::aoe_net_id_command({{5, 1, 2, 3, 2, 1}});
//     static const auto kIp = margay::eoe_ip_message(ip);
//     static const margay::StartupCommand kStartup[] = {
//         margay::send_aoe(margay::Transition::init_to_preop, kNetId),
//         margay::send_eoe(margay::Transition::init_to_preop, kIp),
//     };
//
// A refusal of the slave is the error of the transition: aoe_error, aoe_result (expected and actual: index group and
// offset) or eoe_error. A message of a kind that this header does not name is an error too (invalid_argument), and so
// is a slave without the protocol (unsupported).
#pragma once

#include <margay/aoe_address.hpp>
#include <margay/eoe_parameters.hpp>
#include <margay/startup.hpp>

namespace margay {

namespace detail {
extern const StartupMail kAoeStartup;
extern const StartupMail kEoeStartup;
}  // namespace detail

// An AoE command whose answer contains only a result: write or write control. `command` is the message from the AoE
// header on; the library chooses the invoke ID.
[[nodiscard]] constexpr StartupCommand send_aoe(Transition when, Borrowed<std::byte> command) {
    return {.kind = StartupCommand::Kind::send_aoe, .transitions = when, .data = command, .mail = &detail::kAoeStartup};
}
// Sets IP parameters or the address filter. `message` is the request from the EoE header on. The IP parameters occupy
// all places that the standard gives them, or only the places of the parameters that are set (EoeSetIp::packed).
[[nodiscard]] constexpr StartupCommand send_eoe(Transition when, Borrowed<std::byte> message) {
    return {.kind = StartupCommand::Kind::send_eoe, .transitions = when, .data = message, .mail = &detail::kEoeStartup};
}

// Whether the commands accept this message. They refuse a message whose answer is more than a result, that sets
// nothing, or that contradicts itself. Callable from anywhere.
[[nodiscard]] bool is_aoe_command(std::span<const std::byte> message);
[[nodiscard]] bool is_eoe_message(std::span<const std::byte> message);

// ------------------------------------------------------------------ messages
//
// No memory, no waiting: callable from anywhere.

// The octets of an AoE write around its data.
inline constexpr std::size_t kAoeWriteBytes = 44;
// Composes an AoE write in `into` and returns its octets; none: `into` is smaller than kAoeWriteBytes and the data.
[[nodiscard]] std::span<const std::byte> aoe_write_command(const AoeAddress& target, std::uint32_t index_group,
                                                           std::uint32_t index_offset, std::span<const std::byte> data,
                                                           std::span<std::byte> into);
// The write that gives a slave its NetID: index group 1, index offset 3, with the NetID as target.
[[nodiscard]] std::array<std::byte, kAoeWriteBytes + 6> aoe_net_id_command(const AoeNetId& net_id);
// The requests that set IP parameters and the address filter. A filter with more addresses or masks than its arrays
// gives a message that the command refuses.
[[nodiscard]] std::array<std::byte, 62> eoe_ip_message(const EoeIp& ip);
[[nodiscard]] std::array<std::byte, 126> eoe_filter_message(const EoeFilter& filter);

}  // namespace margay
