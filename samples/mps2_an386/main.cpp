// A master on a microcontroller without an operating system: it brings the slaves to OP, exchanges process data every
// 10 ms, reads an object of slave 4 beside the cycle once a second, and prints what happens to the slaves.
#include "board.hpp"

#include <margay/margay.hpp>
#include <margay/parts/oshw/lan9118/lan9118.hpp>
#include <margay/parts/util/bytes.hpp>
#include <margay/parts/util/text_writer.hpp>

using namespace margay;

namespace {

constexpr Limits kLimits{.slaves = 8, .frames = 8, .groups = 1, .process_frames = 2, .emergencies = 2};

BareOsal osal(board::description());
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
StaticContext<kLimits> ctx;
std::byte image[256];
std::byte vendor[4];
SdoUpload upload;
char line[200];
char sentence[160];

template <class... Parts>
void print(const Parts&... parts) {
    TextWriter text(line);
    (text << ... << parts);
    board::print(text.text());
}

void print_problems() {
    while (const auto error = ctx.errors().take()) print("error: ", describe(*error, sentence));
    while (const auto event = ctx.events().take()) print("event: ", describe(*event, sentence));
}

// Reads the vendor of a slave again and again, while the cycle continues.
void read_vendor() {
    if (upload.busy()) return;
    TextWriter text(line);
    if (upload.state() == RequestState::success)
        (text << "slave 4: vendor ").hex(load_le<std::uint32_t>(vendor), 8);
    else if (upload.state() == RequestState::error)
        text << "error: " << describe(upload.error(), sentence);
    if (!text.text().empty()) board::print(text.text());
    upload.slave = 4;
    upload.index = 0x1018;  // identity
    upload.subindex = 1;
    upload.data = vendor;
    (void)submit(ctx, upload);
}

std::uint64_t first_input() {
    for (const Slave& slave : ctx.slaves())
        if (!slave.image.inputs.bytes.empty()) return std::to_integer<std::uint64_t>(slave.image.inputs.bytes[0]);
    return 0;
}

// The application: once a cycle.
bool work(const CycleInfo& cycle) {
    image[0] = static_cast<std::byte>(cycle.number >> 6);  // the first outputs
    if (cycle.number % 100 == 0) {
        print("cycle ", cycle.number, all_right(ctx) ? ": all right" : ": not all right", ", first input ",
              first_input());
        read_vendor();
    }
    print_problems();
    return true;
}

Result<> start() {
    if (const auto opened = nic.open(osal); !opened) return print("LAN9118: ", nic.problem()), opened;
    board::allow_ethernet_interrupt();
    return init(ctx, nic, osal);
}

// Can be repeated: slaves without power or a cable come later.
Result<> bring_up_and_run() {
    const auto slaves = config_init(ctx);
    if (!slaves) return slaves.error();
    const auto octets = config_map(ctx, image);
    if (!octets) return octets.error();
    print(std::uint64_t{*slaves}, " slaves, ", std::uint64_t{*octets}, " octets of process data");
    SuperviseRequest supervision;
    if (const auto begun = submit(ctx, supervision); !begun) return begun;
    if (const auto op = reach(ctx, AlState::op, std::chrono::seconds(20)); !op) return op;
    print("all slaves are in OP");
    return run_cycle(ctx, {.period = std::chrono::milliseconds(10)},
                     [](const CycleInfo& cycle) { return work(cycle); });
}

}  // namespace

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake();
}

int main() {
    board::start_tick();
    auto done = start();
    while (done) {
        done = bring_up_and_run();
        if (done) break;
        print("will be repeated: ", describe(done.error(), sentence));
        print_problems();
        osal.wait(osal.now() + std::chrono::milliseconds(500), -1);
        done = {};
    }
    if (!done) print("ended: ", describe(done.error(), sentence));
}
