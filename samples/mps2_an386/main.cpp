// A master on a microcontroller without an operating system: it brings the slaves to OP, exchanges process data every
// 2 ms, reads an object of slave 2 beside the cycle once a second, and prints what happens to the slaves.
#include "board.hpp"

#include <margay/margay.hpp>
#include "oshw/lan9118/lan9118.hpp"
#include "util/text_writer.hpp"

using namespace margay;

namespace {

constexpr Limits kLimits{.slaves = 8, .frames = 8, .groups = 1, .process_frames = 2, .emergencies = 2};

BareOsal osal(board::description());
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
StaticContext<kLimits> ctx;
std::byte image[256];
std::byte vendor[4];
SuperviseRequest supervision;
SdoUpload upload;

template <class... Parts>
void print(const Parts&... parts) {
    char line[200];
    TextWriter text(line);
    (text << ... << parts);
    board::print(text.text());
}

void print_problems() {
    char sentence[200];
    while (const auto error = ctx.errors().take()) print("error: ", describe(*error, sentence));
    while (const auto event = ctx.events().take()) print("event: ", describe(*event, sentence));
}

// The application: once a cycle.
bool work(const CycleInfo& cycle) {
    image[0] = static_cast<std::byte>(cycle.number >> 6);  // the first outputs
    if (cycle.number % 500 == 1 && !upload.busy()) (void)submit(ctx, upload);
    if (cycle.number % 500 == 0)
        print("cycle ", cycle.number, all_right(ctx) ? ": all right, vendor " : ": NOT all right, vendor ",
              std::uint64_t{std::to_integer<unsigned>(vendor[0])});
    print_problems();
    return true;
}

Result<> run() {
    if (const auto opened = nic.open(osal); !opened) return print("LAN9118: ", nic.problem()), opened;
    board::allow_ethernet_interrupt();
    if (const auto ready = init(ctx, nic, osal); !ready) return ready;
    const auto slaves = config_init(ctx);
    if (!slaves) return slaves.error();
    const auto octets = config_map(ctx, image);
    if (!octets) return octets.error();
    print(std::uint64_t{*slaves}, " slaves, ", std::uint64_t{*octets}, " octets of process data");
    if (const auto begun = submit(ctx, supervision); !begun) return begun;
    if (const auto op = reach(ctx, AlState::op, std::chrono::seconds(20)); !op) return op;
    print("all slaves are in OP");
    upload.slave = 2;
    upload.index = 0x1018;  // identity: vendor
    upload.subindex = 1;
    upload.data = vendor;
    return run_cycle(ctx, {.period = std::chrono::milliseconds(2)}, [](const CycleInfo& cycle) { return work(cycle); });
}

}  // namespace

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake();
}

int main() {
    board::start_tick();
    for (;;) {
        const auto ended = run();
        char sentence[200];
        if (!ended) print("ended: ", describe(ended.error(), sentence));
        print_problems();
        osal.wait(osal.now() + std::chrono::seconds(1), -1);
    }
}
