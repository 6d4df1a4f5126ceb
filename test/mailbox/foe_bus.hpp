// Slaves with FoE for tests: a bootloader of the library in BOOT, and a scripted FoE server.
#pragma once

#include "mailbox/mailbox_bus.hpp"
#include "sim/library/bootloader.hpp"
#include "wire/foe.hpp"

#include <string_view>

namespace margay {

namespace foe = wire::foe;

// Brings a slave to a state by a StateRequest.
inline Error bring(MailboxBus& bus, AlState state, std::uint16_t slave = 1) {
    StateRequest request;
    request.slave = slave;
    request.wanted = state;
    const auto submitted = submit(*bus.ctx, request);
    if (!submitted) return submitted.error();
    bus.run(request);
    return request.error();
}

// The data of an FoE message.
inline Mail foe_message(foe::Opcode opcode, std::uint32_t word, Bytes body = {}) {
    Mail data(foe::kHeaderBytes);
    foe::Layout::opcode::store(data, opcode);
    store_le<std::uint32_t>(data, 2, word);
    data.insert(data.end(), body.begin(), body.end());
    return data;
}
inline Mail foe_busy(std::uint16_t done, std::uint16_t entire, std::string_view text = {}) {
    Mail data = foe_message(foe::Opcode::busy, done | std::uint32_t{entire} << 16);
    for (const char c : text) data.push_back(static_cast<std::byte>(c));
    return data;
}
inline Mail foe_error(std::uint32_t code, std::string_view text = {}) {
    Mail data = foe_message(foe::Opcode::error, code);
    for (const char c : text) data.push_back(static_cast<std::byte>(c));
    return data;
}

// The content of a message to the slave.
struct FoeAsked {
    foe::Opcode opcode{};
    std::uint32_t word = 0;
    Bytes body;
    explicit FoeAsked(const Mail& mail) {
        const auto data = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
        opcode = foe::Layout::opcode::load(data);
        word = load_le<std::uint32_t>(data, 2);
        body = data.subspan(foe::kHeaderBytes);
    }
};

// A source that has no data in every other call, and returns a few octets in the other calls.
class SlowSource final : public ByteSource {
  public:
    explicit SlowSource(Bytes content, std::size_t most = 7) : left_(content), most_(most) {}
    Piece pull(MutableBytes into) override {
        ++calls;
        if (fails_after != 0 && calls > fails_after) return {.failure = 28};
        if (calls % 2 != 0) return {};
        const std::size_t bytes = std::min({into.size(), left_.size(), most_});
        std::copy_n(left_.begin(), bytes, into.begin());
        left_ = left_.subspan(bytes);
        return {.bytes = bytes, .last = left_.empty()};
    }
    unsigned calls = 0;
    unsigned fails_after = 0;

  private:
    Bytes left_;
    std::size_t most_;
};

class SlowSink final : public ByteSink {
  public:
    Taken push(Bytes octets) override {
        ++calls;
        if (content.size() > fails_above) return {.failure = 28};
        if (calls % 2 != 0) return {};
        const std::size_t bytes = std::min<std::size_t>(octets.size(), 5);
        content.insert(content.end(), octets.begin(), octets.begin() + static_cast<std::ptrdiff_t>(bytes));
        return {.bytes = bytes};
    }
    std::vector<std::byte> content;
    unsigned calls = 0;
    std::size_t fails_above = SIZE_MAX;
};

}  // namespace margay
