// The fragments of an EoePort: any fragments from a slave, and frames to a slave through a mailbox of any size. The
// first octet selects the direction. A received frame has a permitted length. No octet beyond a memory is written. The
// fragments of a sent frame, put together, are this frame.
#include "client_input.hpp"
#include "mailbox/eoe_relay.hpp"

using namespace margay;
using fuzzing::Input;
using fuzzing::kGuard;
using fuzzing::kMark;
using fuzzing::require;

namespace {

struct Watch final : EoeRelayWatch {
    std::size_t fragments = 0;
    void composing() override {}
    void arrived(bool) override { ++fragments; }
};

constexpr std::size_t kRing = EoePortMemory<1, 1, 1>::kOne;

struct Memory {
    std::vector<std::byte> to = std::vector<std::byte>(2 * kRing + kGuard, kMark);
    std::vector<std::byte> from = std::vector<std::byte>(kRing + 100 + kGuard, kMark);
    std::vector<std::byte> parts = std::vector<std::byte>(2 * kEoeFrameBytes + kGuard, kMark);
    [[nodiscard]] bool intact() const {
        return fuzzing::untouched(to, to.size() - kGuard) && fuzzing::untouched(from, from.size() - kGuard) &&
               fuzzing::untouched(parts, parts.size() - kGuard);
    }
    static MutableBytes without_guard(std::vector<std::byte>& memory) {
        return MutableBytes(memory).first(memory.size() - kGuard);
    }
};

void from_slave(Input& input, EoePort& port, EoeRelay& relay, const Watch& watch, std::size_t what) {
    while (!input.empty()) {
        const std::size_t step = input.octet();
        if (step == 0xFF) {
            std::vector<std::byte> into(input.octet() * 8, kMark);
            if (const auto frame = port.receive(into))
                require(frame->bytes >= wire::eoe::kLeastFrameBytes && frame->bytes <= kEoeFrameBytes);
            continue;
        }
        const Bytes taken = input.take(step * 2);
        std::vector<std::byte> data(taken.begin(), taken.end());
        // Most messages are fragments.
        if ((what & 2) != 0 && !data.empty()) data[0] &= std::byte{0xF0};
        (void)relay.take({.slave = 1, .type = MailboxType::eoe, .data = data});
        if (step == 0xFE) relay.drop_all();
    }
    const auto s = port.statistics();
    require(s.received + s.overrun + s.incomplete + s.malformed + s.too_long <= watch.fragments);
}

void to_slave(Input& input, EoePort& port, EoeRelay& relay) {
    std::vector<std::byte> room(wire::eoe::kLeastRoom + input.octet() * 8);
    constexpr unsigned kMostFrames = 8;  // each has up to 48 fragments
    for (unsigned n = 0; n < kMostFrames; ++n) {
        const Bytes head = input.take(2);
        if (head.size() < 2) return;
        std::vector<std::byte> frame(load_le<std::uint16_t>(head) % 1700);
        for (std::size_t at = 0; at < frame.size(); ++at) frame[at] = static_cast<std::byte>(at * 3 + at / 256);
        const bool right = frame.size() >= wire::eoe::kLeastFrameBytes && frame.size() <= kEoeFrameBytes;
        require(port.send(frame) == right);
        if (!right) continue;
        const bool lost = (input.octet() & 7) == 0;
        std::vector<std::byte> memory(kEoeFrameBytes);
        wire::eoe::Assembly whole;
        whole.use(memory);
        auto took = wire::eoe::Assembly::Took::more;
        while (relay.has_fragment()) {
            const std::size_t bytes = relay.compose(room);
            require(bytes > wire::eoe::kHeaderBytes && bytes <= room.size());
            const Bytes message = Bytes(room).first(bytes);
            took = whole.add(wire::eoe::load_header(message), message.subspan(wire::eoe::kHeaderBytes));
            relay.sent(!lost);
        }
        if (lost) continue;
        require(took == wire::eoe::Assembly::Took::whole);
        require(std::ranges::equal(whole.frame(), frame));
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    Memory memory;
    EoePort port(Memory::without_guard(memory.to), Memory::without_guard(memory.from),
                 Memory::without_guard(memory.parts));
    Watch watch;
    EoeRelay relay(1, port, watch);
    if ((what & 1) == 0)
        from_slave(input, port, relay, watch, what);
    else
        to_slave(input, port, relay);
    require(memory.intact());
    return 0;
}
