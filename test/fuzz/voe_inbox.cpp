// An inbox of VoE with any messages and reads, compared with a queue. The first octet is the size of the inbox's
// memory. Each step begins with an octet. If bit 7 is set, the other bits are the number of octets of a read. If not,
// the octet is the length of a message that arrives.
#include "unasked_mail.hpp"
#include "wire/voe.hpp"

#include <margay/voe.hpp>

#include <deque>

using namespace margay;
using fuzzing::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    fuzzing::Input input(std::as_bytes(std::span(data, size)));
    std::vector<std::byte> memory(input.octet());
    VoeInbox inbox(memory);
    if (memory.size() % 3 == 1) inbox.vendor_id = 1;
    if (memory.size() % 5 == 1) inbox.vendor_type = 2;
    fuzzing::Post post(inbox);
    std::deque<std::vector<std::byte>> model;
    std::uint32_t count = 0;
    while (!input.empty()) {
        const std::size_t step = input.octet();
        if ((step & 0x80) == 0) {
            const Bytes mail = input.take(step);
            const bool whole = mail.size() >= wire::voe::kHeaderBytes;
            const bool wanted = whole && (!inbox.vendor_id || load_le<std::uint32_t>(mail) == 1) &&
                                (!inbox.vendor_type || load_le<std::uint16_t>(mail, 4) == 2);
            const auto lost = inbox.lost();
            require(post.deliver(MailboxType::voe, mail) == wanted);
            if (wanted) ++count;
            if (wanted && inbox.lost() == lost) model.emplace_back(mail.begin(), mail.end());
            require(inbox.count() == count);
            continue;
        }
        std::vector<std::byte> into(step & 0x7F, std::byte{0xA5});
        const auto message = inbox.take(into);
        require(message.has_value() != model.empty());
        if (!message) continue;
        const auto& mail = model.front();
        require(message->bytes == mail.size() - wire::voe::kHeaderBytes && message->slave == 1);
        require(message->header.vendor_id == load_le<std::uint32_t>(mail) &&
                message->header.vendor_type == load_le<std::uint16_t>(mail, 4));
        const std::size_t kept = std::min(into.size(), message->bytes);
        require(std::equal(into.begin(), into.begin() + static_cast<std::ptrdiff_t>(kept),
                           mail.begin() + wire::voe::kHeaderBytes));
        require(std::all_of(into.begin() + static_cast<std::ptrdiff_t>(kept), into.end(),
                            [](std::byte octet) { return octet == std::byte{0xA5}; }));
        model.pop_front();
    }
    std::size_t used = 0;
    for (const auto& mail : model) used += mail.size() - wire::voe::kHeaderBytes + 20;
    require(used <= memory.size() && inbox.empty() == model.empty());
    return 0;
}
