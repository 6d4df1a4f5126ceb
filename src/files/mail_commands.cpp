#include "files/mail_commands.hpp"

#include "wire/aoe.hpp"
#include "wire/eoe.hpp"

#include <algorithm>

namespace margay::files {

namespace aoe = wire::aoe;
namespace eoe = wire::eoe;

std::optional<std::vector<std::byte>> eoe_message(Bytes data, std::uint16_t type) {
    const auto fits = [&](Bytes message) {
        return is_eoe_message(message) &&
               (type == 0 || static_cast<std::uint16_t>(eoe::load_header(message).type) == type);
    };
    if (fits(data)) return std::vector<std::byte>(data.begin(), data.end());
    std::vector<std::byte> message(eoe::kHeaderBytes);
    const auto is_filter = type == static_cast<std::uint16_t>(eoe::Type::set_filter_request);
    eoe::store_header(message, is_filter ? eoe::Type::set_filter_request : eoe::Type::set_ip_request,
                      EoeResult::success);
    message.insert(message.end(), data.begin(), data.end());
    if (!fits(message)) return std::nullopt;
    return message;
}

const char* not_sent(const EsiCommand& command) {
    switch (command.protocol) {
        case mailbox_protocol::kAoE: return is_aoe_command(command.data) ? nullptr : kNoAoeCommand;
        case mailbox_protocol::kEoE: return eoe_message(command.data, command.index) ? nullptr : kNoEoeMessage;
        default: return nullptr;
    }
}

std::optional<AoeNetId> given_net_id(Bytes aoe_command) {
    AoeNetId id;
    const auto octets = std::as_writable_bytes(std::span(id.octets));
    if (aoe_command.size() != kAoeWriteBytes + octets.size()) return std::nullopt;
    std::ranges::copy(aoe_command.last(octets.size()), octets.begin());
    const auto made = aoe_net_id_command(id);
    const Bytes data = aoe_command.subspan(aoe::kHeaderBytes);
    const bool same = aoe::load_header(aoe_command).command == aoe::Command::write &&
                      std::ranges::equal(data, Bytes(made).subspan(aoe::kHeaderBytes));
    return same ? std::optional(id) : std::nullopt;
}

}  // namespace margay::files
