// The client of EoE requests with any answers. The client accepts an answer only with the right type, and reads no
// octet beyond the answer.
#include "client_input.hpp"
#include "mailbox/eoe.hpp"

using namespace margay;
using fuzzing::Input;
using fuzzing::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using wire::eoe::Type;
    Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    EoeIp ip;
    EoeFilter filter;
    const Bytes name = input.take(input.octet() & 0x3F);
    std::string text(name.size(), '\0');
    for (std::size_t n = 0; n < text.size(); ++n) text[n] = static_cast<char>(std::to_integer<unsigned char>(name[n]));
    require(ip.set_host_name(text) == (text.size() <= EoeIp::kHostNameBytes));
    filter.address_count = static_cast<std::uint8_t>(what >> 4);
    constexpr Type kTypes[] = {Type::set_ip_request, Type::get_ip_request, Type::set_filter_request,
                               Type::get_filter_request};
    EoeCall call{.type = kTypes[what & 3], .compact = (what & 4) != 0};
    if (call.type == Type::set_ip_request) call.set_ip = &ip;
    if (call.type == Type::get_ip_request) call.got_ip = &ip;
    if (call.type == Type::set_filter_request) call.set_filter = &filter;
    if (call.type == Type::get_filter_request) call.got_filter = &filter;
    EoeClient client(call);
    std::vector<std::byte> room(input.octet());
    const std::size_t composed = client.compose(room);
    require(composed <= room.size());
    while (!input.empty()) {
        const Bytes taken = input.take(input.octet());
        std::vector<std::byte> answer(taken.begin(), taken.end());
        if ((what & 8) != 0 && answer.size() >= wire::eoe::kHeaderBytes) {
            answer[0] = static_cast<std::byte>(static_cast<unsigned>(call.type) + 1);
            answer[2] = answer[3] = std::byte{0};
        }
        const auto result = client.accept(
            {{.length = static_cast<std::uint16_t>(answer.size()), .type = wire::MailboxType::eoe}, answer});
        require(result != MailClient::Taken::more);
        if (result == MailClient::Taken::no) continue;
        require((std::to_integer<unsigned>(answer[0]) & 0xF) == static_cast<unsigned>(call.type) + 1);
        if (client.error().code != Errc::none) return 0;
        require(ip.host_name().size() <= EoeIp::kHostNameBytes);
        require(filter.address_count <= EoeFilter::kAddresses && filter.mask_count <= EoeFilter::kMasks);
        (void)filter.passes({1, 2, 3, 4, 5, 6});
        return 0;
    }
    return 0;
}
