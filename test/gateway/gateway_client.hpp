// A client of the mailbox gateway that composes every octet by hand, over UDP or TCP.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

namespace margay::testing_gateway {

using Octets = std::vector<std::byte>;

inline Octets octets(std::initializer_list<unsigned> values) {
    Octets out;
    for (const auto v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}
inline unsigned at(std::span<const std::byte> from, std::size_t n) { return std::to_integer<unsigned>(from[n]); }
inline std::uint32_t number(std::span<const std::byte> from, std::size_t offset, std::size_t bytes) {
    std::uint32_t value = 0;
    for (std::size_t n = 0; n < bytes && offset + n < from.size(); ++n) value |= at(from, offset + n) << (8 * n);
    return value;
}
inline void append(Octets& to, std::uint32_t value, std::size_t bytes) {
    for (std::size_t n = 0; n < bytes; ++n) to.push_back(static_cast<std::byte>(value >> (8 * n)));
}

enum : unsigned { kErr = 0, kAoe = 1, kEoe = 2, kCoe = 3, kFoe = 4, kSoe = 5, kVoe = 15 };

// A mailbox message in a frame of type 5. The frame header has the length in its lowest 11 bits and the type in its
// highest 4 bits.
inline Octets frame(std::uint16_t address, unsigned type, unsigned counter, const Octets& data, unsigned priority = 0) {
    Octets out;
    append(out, static_cast<std::uint32_t>((6 + data.size()) | 0x5000U), 2);
    append(out, static_cast<std::uint32_t>(data.size()), 2);
    append(out, address, 2);
    append(out, priority << 6, 1);
    append(out, type | counter << 4, 1);
    out.insert(out.end(), data.begin(), data.end());
    return out;
}

struct Message {
    std::uint16_t address = 0;
    unsigned type = 0;
    unsigned counter = 0;
    unsigned priority = 0;
    Octets data{};
    // The code of a mailbox error reply.
    [[nodiscard]] unsigned error() const {
        return type == kErr && data.size() == 4 && number(data, 0, 2) == 1 ? number(data, 2, 2) : 0;
    }
};

// Frames of all clients in both directions, for tshark.
struct Traffic {
    struct One {
        bool udp;
        bool to_gateway;
        Octets frame;
    };
    static std::vector<One>& all() {
        static std::vector<One> frames;
        return frames;
    }
    static void add(bool udp, bool to_gateway, const Octets& frame) {
        static std::mutex lock;
        const std::lock_guard guard(lock);
        all().push_back({udp, to_gateway, frame});
    }
};

enum class Over { udp, tcp };
enum class Ip { v4, v6 };

class GatewayClient {
  public:
    GatewayClient(std::uint16_t port, Over over, bool recorded = false, Ip version = Ip::v4)
        : udp_(over == Over::udp), recorded_(recorded) {
        const bool six = version == Ip::v6;
        fd_ = ::socket(six ? AF_INET6 : AF_INET, (udp_ ? SOCK_DGRAM : SOCK_STREAM) | SOCK_CLOEXEC, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        sockaddr_in6 address6{};
        address6.sin6_family = AF_INET6;
        address6.sin6_port = htons(port);
        address6.sin6_addr = in6addr_loopback;
        connected_ = six ? ::connect(fd_, reinterpret_cast<const sockaddr*>(&address6), sizeof address6) == 0
                         : ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
        wait_at_most(20'000);
    }
    ~GatewayClient() { close(); }
    GatewayClient(const GatewayClient&) = delete;
    GatewayClient& operator=(const GatewayClient&) = delete;

    void close() {
        if (fd_ >= 0) ::close(fd_);
        fd_ = -1;
    }
    void wait_at_most(int milliseconds) {
        const timeval time{milliseconds / 1000, (milliseconds % 1000) * 1000};
        (void)::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
    }
    [[nodiscard]] bool connected() const { return connected_; }
    [[nodiscard]] int fd() const { return fd_; }

    // Sends any octets. False: the gateway has disconnected, or accepts no more octets.
    bool send_octets(std::span<const std::byte> from, int flags = 0) {
        return ::send(fd_, from.data(), from.size(), MSG_NOSIGNAL | flags) == static_cast<ssize_t>(from.size());
    }
    void send(std::uint16_t address, unsigned type, const Octets& data, unsigned counter = 1, unsigned priority = 0) {
        const auto out = frame(address, type, counter, data, priority);
        if (recorded_) Traffic::add(udp_, true, out);
        (void)send_octets(out);
    }
    // nullopt: nothing arrived in time, the connection has ended, or the received octets are no frame.
    std::optional<Message> receive() {
        Octets in(4096);
        std::size_t got = 0;
        if (udp_) {
            const auto came = ::recv(fd_, in.data(), in.size(), 0);
            if (came < 0) return std::nullopt;
            got = static_cast<std::size_t>(came);
        } else {
            if (::recv(fd_, in.data(), 2, MSG_WAITALL) != 2) return std::nullopt;
            got = 2 + (number(in, 0, 2) & 0x7FFU);
            if (::recv(fd_, in.data() + 2, got - 2, MSG_WAITALL) != static_cast<ssize_t>(got - 2)) return std::nullopt;
        }
        in.resize(got);
        if (recorded_) Traffic::add(udp_, false, in);
        const auto head = number(in, 0, 2);
        if (got < 8 || head >> 12 != 5 || (head & 0x7FFU) != got - 2 || number(in, 2, 2) != got - 8)
            return std::nullopt;
        return Message{.address = static_cast<std::uint16_t>(number(in, 4, 2)),
                       .type = at(in, 7) & 0xFU,
                       .counter = at(in, 7) >> 4 & 7U,
                       .priority = at(in, 6) >> 6,
                       .data = Octets(in.begin() + 8, in.end())};
    }
    Message ask(std::uint16_t address, unsigned type, const Octets& data, unsigned counter = 1) {
        send(address, type, data, counter);
        return receive().value_or(Message{.type = 0xFF});
    }
    // Whether the gateway has ended the connection.
    bool ended() {
        std::array<std::byte, 4096> some{};
        for (;;) {
            const auto came = ::recv(fd_, some.data(), some.size(), 0);
            if (came == 0) return true;
            if (came < 0) return errno == ECONNRESET;
        }
    }

  private:
    int fd_ = -1;
    bool udp_;
    bool recorded_;
    bool connected_ = false;
};

// ------------------------------------------------------------------ CoE (ETG.1000.6 "SDO")

inline Octets sdo(unsigned command, unsigned index, unsigned subindex, std::uint32_t value = 0) {
    Octets out = octets({0x00, 0x20, command});
    append(out, index, 2);
    append(out, subindex, 1);
    append(out, value, 4);
    return out;
}
// The abort code of a reply; 0 if the reply is no abort.
inline std::uint32_t abort_of(const Message& m) {
    return m.type == kCoe && m.data.size() >= 10 && at(m.data, 2) == 0x80 ? number(m.data, 6, 4) : 0;
}

// Uploads the value of an object, in segments if necessary. Returns an empty value after an abort or an error.
inline Octets upload(GatewayClient& client, std::uint16_t address, unsigned index, unsigned subindex,
                     Message* last = nullptr) {
    unsigned counter = 3;
    auto reply = client.ask(address, kCoe, sdo(0x40, index, subindex), counter);
    if (last != nullptr) *last = reply;
    if (reply.type != kCoe || reply.data.size() < 10 || reply.counter != counter || reply.address != address) return {};
    const unsigned command = at(reply.data, 2);
    if (command >> 5 != 2) return {};
    if ((command & 2U) != 0) return Octets(reply.data.begin() + 6, reply.data.begin() + 6 + (4 - (command >> 2 & 3U)));
    const std::size_t size = number(reply.data, 6, 4);
    Octets value(reply.data.begin() + 10, reply.data.end());
    for (bool toggle = false; value.size() < size; toggle = !toggle) {
        counter = counter % 7 + 1;
        Octets segment = octets({0x00, 0x20, toggle ? 0x70U : 0x60U});
        segment.resize(10);
        reply = client.ask(address, kCoe, segment, counter);
        if (last != nullptr) *last = reply;
        if (reply.type != kCoe || reply.data.size() < 10 || reply.counter != counter) return {};
        const unsigned answer = at(reply.data, 2);
        if (answer >> 5 != 0) return {};
        const std::size_t unused = reply.data.size() == 10 ? answer >> 1 & 7U : 0;
        value.insert(value.end(), reply.data.begin() + 3, reply.data.end() - static_cast<std::ptrdiff_t>(unused));
        if ((answer & 1U) != 0) break;
    }
    return value;
}

// Returns true if the slave has confirmed the whole value. `room`: octets of mailbox data in a message.
inline bool download(GatewayClient& client, std::uint16_t address, unsigned index, unsigned subindex,
                     const Octets& value, std::size_t room) {
    std::size_t sent = std::min(value.size(), room - 10);
    Octets first = octets({0x00, 0x20, 0x21});
    append(first, index, 2);
    append(first, subindex, 1);
    append(first, static_cast<std::uint32_t>(value.size()), 4);
    first.insert(first.end(), value.begin(), value.begin() + static_cast<std::ptrdiff_t>(sent));
    auto reply = client.ask(address, kCoe, first, 1);
    if (reply.type != kCoe || reply.data.size() < 10 || at(reply.data, 2) != 0x60) return false;
    for (unsigned toggle = 0; sent < value.size(); toggle ^= 0x10U) {
        const auto some = std::min(value.size() - sent, room - 3);
        const unsigned unused = some < 7 ? static_cast<unsigned>(7 - some) : 0;
        const bool last = sent + some == value.size();
        Octets segment = octets({0x00, 0x20, toggle | unused << 1 | (last ? 1U : 0U)});
        segment.insert(segment.end(), value.begin() + static_cast<std::ptrdiff_t>(sent),
                       value.begin() + static_cast<std::ptrdiff_t>(sent + some));
        segment.resize(std::max<std::size_t>(segment.size(), 10));
        reply = client.ask(address, kCoe, segment, 2);
        if (reply.type != kCoe || reply.data.size() < 3 || at(reply.data, 2) != (0x20U | toggle)) return false;
        sent += some;
    }
    return true;
}

}  // namespace margay::testing_gateway
