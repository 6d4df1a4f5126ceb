// Start-up commands of AoE.
#include "mailbox/aoe.hpp"
#include "network/startup_mail.hpp"

#include <algorithm>

namespace margay {

namespace aoe = wire::aoe;

namespace {

// The octets between the AoE header and the data of a command whose answer contains only a result; 0: any other
// command.
std::size_t head_bytes(aoe::Command command) {
    if (command == aoe::Command::write) return aoe::kIndexBytes;
    return command == aoe::Command::write_control ? aoe::kControlBytes : 0;
}

}  // namespace

bool is_aoe_command(std::span<const std::byte> message) {
    if (message.size() < aoe::kHeaderBytes) return false;
    const aoe::Header header = aoe::load_header(message);
    const Bytes data = message.subspan(aoe::kHeaderBytes);
    const std::size_t head = head_bytes(header.command);
    constexpr unsigned kNone = aoe::state_flag::kResponse | aoe::state_flag::kNoReturn;
    if ((header.flags & kNone) != 0 || head == 0 || data.size() < head || header.data_bytes != data.size())
        return false;
    const bool writes = header.command == aoe::Command::write;
    return (writes ? aoe::IndexLayout::bytes::load(data) : aoe::ControlLayout::bytes::load(data)) == data.size() - head;
}

namespace {

Task<Result<>> send_command(MailboxChannel& channel, const StartupCommand& command, const MailPatience& patience) {
    const Bytes message = command.octets();
    const aoe::Header header = aoe::load_header(message);
    const Bytes data = message.subspan(aoe::kHeaderBytes);
    AoeCall call{.command = header.command,
                 .head_bytes = static_cast<std::uint8_t>(head_bytes(header.command)),
                 .target = header.target,
                 .source = header.source};
    std::ranges::copy(data.first(call.head_bytes), call.head.begin());
    call.data = data.subspan(call.head_bytes);
    (void)co_await required(aoe_call(channel, call, aoe_invoke_id(channel.engine().now()), patience));
    co_return Nothing{};
}

}  // namespace

constinit const detail::StartupMail detail::kAoeStartup{
    .protocol = mailbox_protocol::kAoE, .type = MailboxType::aoe, .valid = is_aoe_command, .send = send_command};

std::span<const std::byte> aoe_write_command(const AoeAddress& target, std::uint32_t index_group,
                                             std::uint32_t index_offset, std::span<const std::byte> data,
                                             std::span<std::byte> into) {
    static_assert(kAoeWriteBytes == aoe::kHeaderBytes + aoe::kIndexBytes);
    if (into.size() < kAoeWriteBytes || into.size() - kAoeWriteBytes < data.size()) return {};
    aoe::store_header(into, {.target = target,
                             .source = {},
                             .command = aoe::Command::write,
                             .data_bytes = static_cast<std::uint32_t>(aoe::kIndexBytes + data.size())});
    const auto head = into.subspan(aoe::kHeaderBytes);
    aoe::IndexLayout::group::store(head, index_group);
    aoe::IndexLayout::offset::store(head, index_offset);
    aoe::IndexLayout::bytes::store(head, static_cast<std::uint32_t>(data.size()));
    std::ranges::copy(data, head.begin() + aoe::kIndexBytes);
    return into.first(kAoeWriteBytes + data.size());
}

std::array<std::byte, kAoeWriteBytes + 6> aoe_net_id_command(const AoeNetId& net_id) {
    constexpr std::uint32_t kGroup = 1;
    constexpr std::uint32_t kOffset = 3;
    std::array<std::byte, kAoeWriteBytes + 6> message{};
    (void)aoe_write_command({net_id, 0}, kGroup, kOffset, std::as_bytes(std::span(net_id.octets)), message);
    return message;
}

}  // namespace margay
