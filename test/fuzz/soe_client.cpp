// Replies with random content for the SoE client. The input is a conversation: the request, then replies in sequence.
// For any answers, a transfer must not write beyond its buffer, must not report more octets than its buffer has, must
// not compose more than a mailbox holds, and must end after as many fragments as the first fragment says.
#include "client_input.hpp"
#include "mailbox/soe_transfer.hpp"

#include <algorithm>
#include <cstdlib>
#include <span>
#include <vector>

using namespace margay;
using namespace margay::fuzzing;

namespace {

std::size_t compose(MailClient& client, std::size_t room) {
    std::vector<std::byte> data(room + kGuard, kMark);
    const std::size_t bytes = client.compose(MutableBytes(data).first(room));
    require(bytes <= room && bytes >= wire::soe::kHeaderBytes);
    require(untouched(data, room));
    std::vector<std::byte> again(room, kMark);
    require(client.compose(again) == bytes);
    require(std::equal(again.begin(), again.begin() + static_cast<std::ptrdiff_t>(bytes), data.begin()));
    return bytes;
}

MailClient::Taken answer(MailClient& client, Input& input) {
    const Bytes data = input.take(input.octet());
    return client.accept({{.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::soe}, data});
}

void read(Input& input, std::size_t room, const SoeTarget& target) {
    const std::size_t size = input.octet();
    std::vector<std::byte> into(size + kGuard, kMark);
    SoeReadTransfer transfer(target, MutableBytes(into).first(size));
    compose(transfer, room);
    std::size_t fragments = 0;
    while (!input.empty() && !transfer.over())
        if (answer(transfer, input) != MailClient::Taken::no) ++fragments;
    require(fragments <= 0x10000);
    require(untouched(into, size));
    if (transfer.over() && transfer.error().code == Errc::none) require(transfer.bytes() <= size);
    if (transfer.error().code == Errc::capacity) require(transfer.error().expected > size);
    require(transfer.over() || transfer.error().code == Errc::none);
}

void write(Input& input, std::size_t room, const SoeTarget& target) {
    const std::vector<std::byte> value(input.octet(), std::byte{7});
    SoeWriteTransfer transfer(target, value, room);
    std::size_t sent = 0;
    std::size_t messages = 1;
    for (; !transfer.at_last(); ++messages) {
        sent += compose(transfer, room) - wire::soe::kHeaderBytes;
        transfer.advance();
        require(messages <= value.size());
    }
    sent += compose(transfer, room) - wire::soe::kHeaderBytes;
    require(sent == value.size());
    while (!input.empty() && !transfer.over()) (void)answer(transfer, input);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    const std::size_t room = 5 + input.octet();
    const SoeTarget target{.idn = Idn::standard(51), .drive = static_cast<std::uint8_t>((what >> 1) & 7)};
    if ((what & 1) == 0)
        read(input, room, target);
    else
        write(input, room, target);
    return 0;
}
