// Helpers for the tests of the simulation: devices from SII octets, and datagrams that are sent one by one.
#pragma once

#include "sim/segment.hpp"
#include "wire/datagram.hpp"
#include "wire/sii.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <memory>
#include <vector>

namespace margay::sim::test {

using wire::Command;
namespace reg = wire::reg;

inline std::vector<std::byte> bytes(std::initializer_list<unsigned> values) {
    std::vector<std::byte> out;
    for (const auto v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

// A configuration area with the given PDI control word, followed by words that count up.
inline std::vector<std::byte> sii_image(std::uint16_t pdi_control, std::uint16_t alias = 0, std::size_t size = 512) {
    std::vector<std::byte> image(size);
    for (std::size_t i = 16; i + 2 <= size; i += 2)
        store_le<std::uint16_t>(image, i, static_cast<std::uint16_t>(0xA000 + i / 2));
    store_le<std::uint16_t>(image, 0, pdi_control);
    store_le<std::uint16_t>(image, 8, alias);
    image[14] = std::byte{wire::sii::checksum(image)};
    return image;
}

inline constexpr std::uint16_t kEmulationWithDc = 0x0D00;  // PDI none, device emulation, DC units on
inline constexpr std::uint16_t kDigitalIo = 0x0104;        // PDI digital I/O, device emulation
inline constexpr std::uint16_t kProcessor = 0x0005;        // PDI SPI: a processor must answer

// Firmware without actions: the test acts as the program.
class IdleFirmware final : public Firmware {
  public:
    void start(subdevice::EscAccess&, Time) override { ++starts; }
    Time step(Time) override {
        ++steps;
        return kNever;
    }
    [[nodiscard]] bool feeds_pdi_watchdog() const override { return true; }
    unsigned starts = 0;
    unsigned steps = 0;
};

struct Reply {
    bool returned = false;
    Time at{};
    wire::DatagramHeader header;
    std::vector<std::byte> data;
    std::uint16_t wkc = 0;
    std::byte source{};

    template <class T>
    [[nodiscard]] T as(std::size_t offset = 0) const {
        return load_le<T>(data, offset);
    }
};

// A line of slaves and a master that sends one datagram per frame. Time advances by `step` from frame to frame.
class Rig {
  public:
    Segment segment;
    Time now{};
    Duration step = std::chrono::microseconds(100);

    std::uint32_t add(const EscDescription& description, std::vector<std::byte> sii) {
        const auto n = segment.add(std::make_unique<Esc>(description, std::move(sii)));
        if (n == 0) {
            EXPECT_TRUE(segment.connect_master({0, 0}));
        } else {
            EXPECT_TRUE(segment.connect({n - 1, 1}, {n, 0}));
        }
        return n;
    }
    // An ESC with a processor whose program is the test.
    std::uint32_t add_with_processor(const EscDescription& description,
                                     std::vector<std::byte> sii = sii_image(kProcessor)) {
        const auto n = add(description, std::move(sii));
        slave(n).set_firmware(std::make_unique<IdleFirmware>());
        return n;
    }
    void on() { segment.power_up(now); }
    Esc& slave(std::uint32_t n) { return segment.slave(n); }

    struct Request {
        Command command;
        wire::DatagramAddress address;
        std::vector<std::byte> data;
    };
    // Sends all requests in one frame.
    std::vector<Reply> frame(const std::vector<Request>& requests, unsigned master_port = 0) {
        std::array<std::byte, wire::kMaxFrameBytes> buffer{};
        wire::FrameBuilder builder(buffer, {0x00, 1, 1, 1, 1, 1});
        std::uint8_t index = 0;
        for (const auto& r : requests) {
            const auto data = builder.append(r.command, index++, r.address, r.data.size());
            std::copy(r.data.begin(), r.data.end(), data.begin());
        }
        const auto size = builder.finish().size();
        now += step;
        const auto passage = segment.process(MutableBytes(buffer).first(size), now, master_port);
        std::vector<Reply> replies;
        wire::DatagramReader reader(Bytes(buffer).first(size));
        while (const auto d = reader.next())
            replies.push_back(
                {passage.returned, passage.at, d->header, {d->data.begin(), d->data.end()}, d->wkc, buffer[6]});
        return replies;
    }
    Reply send(Command command, wire::DatagramAddress address, std::vector<std::byte> data) {
        return frame({{command, address, std::move(data)}}).at(0);
    }
    // Addressed by ring position.
    Reply read(std::uint16_t position, std::uint16_t ado, std::size_t length) {
        return send(Command::APRD, {RingPosition{position}, ado}, std::vector<std::byte>(length));
    }
    Reply write(std::uint16_t position, std::uint16_t ado, std::vector<std::byte> data) {
        return send(Command::APWR, {RingPosition{position}, ado}, std::move(data));
    }
    template <class T>
    std::uint16_t put(std::uint16_t position, std::uint16_t ado, T value) {
        std::vector<std::byte> data(sizeof(T));
        store_le<T>(data, 0, value);
        return write(position, ado, std::move(data)).wkc;
    }
    // Accessed from the PDI side.
    template <class T>
    T pdi_get(std::uint32_t n, std::uint16_t address) {
        std::array<std::byte, sizeof(T)> raw{};
        slave(n).advance(now);
        slave(n).read(address, raw);
        return load_le<T>(raw, 0);
    }
    template <class T>
    void pdi_put(std::uint32_t n, std::uint16_t address, T value) {
        std::array<std::byte, sizeof(T)> raw{};
        store_le<T>(raw, 0, value);
        slave(n).advance(now);
        slave(n).write(address, raw);
        segment.reconsider();
    }
    // Lets time pass without a frame.
    void pass(Duration time) {
        now += time;
        segment.advance(now);
    }
    template <class T>
    T get(std::uint16_t position, std::uint16_t ado) {
        const auto reply = read(position, ado, sizeof(T));
        EXPECT_EQ(reply.wkc, 1) << "reading 0x" << std::hex << ado;
        return reply.as<T>();
    }
};

}  // namespace margay::sim::test
