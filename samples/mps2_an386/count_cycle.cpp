// Counts the instructions of a cycle: send_processdata() and receive_processdata(). QEMU counts the instructions
// (`-icount shift=0`: one instruction is one nanosecond of the board's timers). After the bring-up, a NIC in memory
// answers each frame at once; the cost of this NIC and of the clock is counted separately and subtracted, as
// test/bench/cycle.cpp does it on a PC.
#include "board.hpp"

#include <margay/margay.hpp>
#include <margay/parts/oshw/filter_nic.hpp>
#include <margay/parts/oshw/lan9118/lan9118.hpp>
#include <margay/parts/util/text_writer.hpp>

#include <cstring>

using namespace margay;

namespace {

constexpr Limits kLimits{.slaves = 8, .frames = 8, .groups = 1, .process_frames = 2, .emergencies = 2};
constexpr std::uint32_t kCycles = 1000;

BareOsal osal(board::description());
Lan9118 lan(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
StaticContext<kLimits> ctx;
std::byte image[256];

// First the LAN9118, later a far end that returns every frame at once with the expected working counter.
class ExchangedNic final : public FilterNic {
  public:
    using FilterNic::FilterNic;
    bool in_memory = false;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (!in_memory) return inner().send(frame);
        frame_ = frame;
        return SendStatus::sent;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (!in_memory) return inner().receive(into);
        if (frame_.empty()) return 0;
        const auto size = frame_.size();
        std::memcpy(into.data(), frame_.data(), size);
        into[6] |= std::byte{2};
        const std::uint16_t wkc = ctx.group(0).datagrams[0].expected;
        into[size - 2] = static_cast<std::byte>(wkc);
        into[size - 1] = static_cast<std::byte>(wkc >> 8);
        frame_ = {};
        return size;
    }

  private:
    std::span<const std::byte> frame_;
} nic(lan);

template <class... Parts>
void print(const Parts&... parts) {
    char line[200];
    TextWriter text(line);
    (text << ... << parts);
    board::print(text.text());
}

// Instructions of one of kCycles calls.
template <class Work>
std::uint32_t count(Work work) {
    const auto before = board::counter();
    for (std::uint32_t n = 0; n < kCycles; ++n) work();
    const auto ticks = board::counter() - before;
    return static_cast<std::uint32_t>(std::uint64_t{ticks} * (1'000'000'000 / board::kHertz) / kCycles);
}

Result<> run() {
    if (const auto opened = lan.open(osal); !opened) return opened;
    board::allow_ethernet_interrupt();
    if (const auto ready = init(ctx, nic, osal); !ready) return ready;
    const auto slaves = config_init(ctx);
    if (!slaves) return slaves.error();
    const auto octets = config_map(ctx, image);
    if (!octets) return octets.error();
    if (ctx.group(0).datagrams.size() != 1) return print("more than one datagram"), Error{.code = Errc::unsupported};

    nic.in_memory = true;
    board::stop_tick();
    std::uint32_t wrong = 0;
    const auto cycle = count([&] {
        if (!send_processdata(ctx) || !receive_processdata(ctx, std::chrono::milliseconds(1))) ++wrong;
    });
    static std::byte frame[1514];
    static std::byte got[1514];
    const std::size_t size = 14 + 2 + 10 + ctx.group(0).image.size() + 2;
    const auto around = count([&] {
        (void)osal.now();
        (void)nic.send(std::span(frame).first(size));
        if (nic.receive(got) != size) ++wrong;
    });
    board::start_tick();
    if (wrong != 0) return print(std::uint64_t{wrong}, " cycles were wrong"), Error{.code = Errc::working_counter};
    print("instructions of a cycle: ", std::uint64_t{cycle - around}, " (", std::uint64_t{*slaves}, " slaves, ",
          std::uint64_t{*octets}, " octets; with NIC and clock ", std::uint64_t{cycle}, ")");
    return {};
}

}  // namespace

extern "C" void ethernet_handler() {
    lan.on_interrupt();
    osal.wake();
}

int main() {
    board::start_tick();
    char sentence[160];
    if (const auto ended = run(); !ended) print("ended: ", describe(ended.error(), sentence));
    for (;;) osal.wait(kNever, -1);
}
