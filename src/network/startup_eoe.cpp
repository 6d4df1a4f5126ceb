// Start-up commands of EoE.
#include "mailbox/eoe.hpp"
#include "network/startup_mail.hpp"

namespace margay {

namespace eoe = wire::eoe;

namespace {

// Whether the octets are IP parameters: at least one parameter is set, and the size is exactly the size that the flags
// announce, either with all places or only with the places of the parameters that are set.
bool is_ip(Bytes parameters) {
    constexpr std::uint32_t kFlags = 0x1'003F;  // six parameters, and the time stamp
    if (parameters.size() < sizeof(std::uint32_t)) return false;
    const auto flags = load_le<std::uint32_t>(parameters);
    const auto ip = eoe::load_ip(parameters);
    if (flags == 0 || (flags & ~kFlags) != 0 || !ip) return false;
    std::array<std::byte, eoe::kIpBytes> compact{};
    return parameters.size() == eoe::kIpBytes || parameters.size() == eoe::store_ip(compact, *ip, true);
}

bool is_filter(Bytes parameters) {
    if (parameters.size() != eoe::kFilterBytes) return false;
    const auto filter = eoe::load_filter(parameters);
    return filter && filter->address_count <= EoeFilter::kAddresses && filter->mask_count <= EoeFilter::kMasks;
}

}  // namespace

bool is_eoe_message(std::span<const std::byte> message) {
    if (message.size() < eoe::kHeaderBytes) return false;
    const Bytes parameters = message.subspan(eoe::kHeaderBytes);
    const auto type = eoe::load_header(message).type;
    return type == eoe::Type::set_ip_request ? is_ip(parameters)
                                             : type == eoe::Type::set_filter_request && is_filter(parameters);
}

namespace {

Task<Result<>> send_request(MailboxChannel& channel, const StartupCommand& command, const MailPatience& patience) {
    const Bytes message = command.octets();
    const EoeCall call{.type = eoe::load_header(message).type, .parameters = message.subspan(eoe::kHeaderBytes)};
    co_return co_await required(eoe_call(channel, call, patience));
}

}  // namespace

constinit const detail::StartupMail detail::kEoeStartup{
    .protocol = mailbox_protocol::kEoE, .type = MailboxType::eoe, .valid = is_eoe_message, .send = send_request};

std::array<std::byte, 62> eoe_ip_message(const EoeIp& ip) {
    std::array<std::byte, eoe::kHeaderBytes + eoe::kIpBytes> message{};
    eoe::store_header(message, eoe::Type::set_ip_request, EoeResult::success);
    (void)eoe::store_ip(MutableBytes(message).subspan(eoe::kHeaderBytes), ip);
    return message;
}

std::array<std::byte, 126> eoe_filter_message(const EoeFilter& filter) {
    std::array<std::byte, eoe::kHeaderBytes + eoe::kFilterBytes> message{};
    if (filter.address_count > EoeFilter::kAddresses || filter.mask_count > EoeFilter::kMasks) return message;
    eoe::store_header(message, eoe::Type::set_filter_request, EoeResult::success);
    eoe::store_filter(MutableBytes(message).subspan(eoe::kHeaderBytes), filter);
    return message;
}

}  // namespace margay
