// The messages by EoE and AoE in configuration files.
#pragma once

#include "util/bytes.hpp"

#include <margay/files/esi.hpp>
#include <margay/startup_mail.hpp>

#include <cstdint>
#include <optional>
#include <vector>

namespace margay::files {

// The reasons why a start-up command of EoE or AoE is not sent.
inline constexpr const char* kNoEoeMessage =
    "the start-up command of EoE is not sent: its data is neither that of IP parameters nor of an address filter";
inline constexpr const char* kNoAoeCommand =
    "the start-up command of AoE is not sent: its data is no AoE command that writes";

// The message that send_eoe() sends. Some tools omit the EoE header. Then `type` (the type in the header; 0: not known)
// determines the content, or the data begins with the flags of the IP parameters. nullopt: the data is no such message.
[[nodiscard]] std::optional<std::vector<std::byte>> eoe_message(Bytes data, std::uint16_t type = 0);
// The reason why the command of an ESI is not sent; nullptr: it is sent, or it belongs to another protocol.
[[nodiscard]] const char* not_sent(const EsiCommand& command);
// The NetID that the command gives to its slave; nullopt: it is another command.
[[nodiscard]] std::optional<AoeNetId> given_net_id(Bytes aoe_command);

}  // namespace margay::files
