// Ethernet frames and EoE fragments for tests, composed octet by octet.
#pragma once

#include "mailbox/mailbox_bus.hpp"
#include "sim/ethernet_port.hpp"

namespace margay {

inline constexpr auto kEoe = wire::MailboxType::eoe;

// A frame of the experimental type 0x88B5; its octets depend on `seed`.
[[nodiscard]] inline Mail ethernet_frame(std::size_t bytes, unsigned seed) {
    Mail frame(bytes);
    for (std::size_t n = 0; n < bytes; ++n) frame[n] = static_cast<std::byte>(n * 3 + seed * 7 + n / 256);
    frame[0] = std::byte{0x02};
    frame[6] = std::byte{0x06};
    frame[12] = std::byte{0x88};
    frame[13] = std::byte{0xB5};
    return frame;
}

// A fragment as a slave sends it. `blocks`: as in the header.
struct EoePart {
    unsigned number = 0;
    unsigned fragment = 0;
    unsigned blocks = 0;
    bool last = false;
    unsigned flags = 0;  // further bits of the first word
};
[[nodiscard]] inline Mail eoe_part(const EoePart& part, Bytes octets) {
    const unsigned first = part.flags | (part.last ? 0x100U : 0U);
    const unsigned second = part.fragment | part.blocks << 6 | part.number << 12;
    Mail mail = mail_bytes({first & 0xFF, first >> 8, second & 0xFF, second >> 8});
    mail.insert(mail.end(), octets.begin(), octets.end());
    return mail;
}
// All fragments of a frame, `bytes` octets each.
[[nodiscard]] inline std::vector<Mail> eoe_parts(const Mail& frame, unsigned number, std::size_t bytes) {
    std::vector<Mail> parts;
    for (std::size_t at = 0; at < frame.size(); at += bytes) {
        const auto size = std::min(bytes, frame.size() - at);
        const auto fragment = static_cast<unsigned>(parts.size());
        const auto blocks = static_cast<unsigned>(fragment == 0 ? (frame.size() + 31) / 32 : at / 32);
        parts.push_back(
            eoe_part({number, fragment, blocks, at + size == frame.size()}, Bytes(frame).subspan(at, size)));
    }
    return parts;
}

// A host at the port of a gateway. It stores the frames that arrive, and sends them back if `echo` is set.
struct EoeHost final : sim::EthernetPeer {
    MailboxBus& bus;
    std::uint32_t number;  // number of the slave, from 0
    std::vector<Mail> frames;
    bool echo = false;
    EoeHost(MailboxBus& b, std::uint32_t n) : bus(b), number(n) { port().connect(this); }
    [[nodiscard]] sim::EthernetPort& port() { return *bus.segment.slave(number).ethernet(); }
    void arrived(Bytes frame, Time) override {
        frames.emplace_back(frame.begin(), frame.end());
        if (echo) {
            EXPECT_TRUE(port().put(frame));
        }
    }
    bool send(const Mail& frame) {
        const bool taken = port().put(frame);
        bus.segment.interrupt(number, bus.osal.now());
        return taken;
    }
};

// All frames that wait in a port.
[[nodiscard]] inline std::vector<Mail> received(EoePort& port) {
    std::vector<Mail> frames;
    std::array<std::byte, kEoeFrameBytes> buffer{};
    while (const auto frame = port.receive(buffer))
        frames.emplace_back(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(frame->bytes));
    return frames;
}

}  // namespace margay
