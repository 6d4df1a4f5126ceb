// A master on a microcontroller without an operating system: it brings the slaves to OP, exchanges process data every
// 10 ms, reads an object of slave 4 beside the cycle once a second, and prints what happens to the slaves.
#include "report.hpp"

#include <margay/parts/oshw/lan9118/lan9118.hpp>

using namespace margay;
using namespace std::chrono_literals;

namespace {

BareOsal osal(board::description());
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
StaticContext<Limits{.slaves = 8, .frames = 8, .groups = 1, .process_frames = 2, .emergencies = 2}> ctx;
std::byte image[256];
VendorReader vendor(4);

// The application: once a cycle.
bool work(const CycleInfo& cycle) {
    image[0] = static_cast<std::byte>(cycle.number >> 6);  // the first outputs
    if (cycle.number % 100 == 0) {
        print_state(ctx, cycle.number);
        vendor.read(ctx);
    }
    print_problems(ctx);
    return true;
}

// The bring-up can be repeated, because slaves without power or a cable may be connected later.
Result<> bring_up_and_run() {
    const auto slaves = config_init(ctx);
    if (!slaves) return slaves.error();
    const auto octets = config_map(ctx, image);
    if (!octets) return octets.error();
    print(std::uint64_t{*slaves}, " slaves, ", std::uint64_t{*octets}, " octets of process data");
    SuperviseRequest supervision;
    if (const auto begun = submit(ctx, supervision); !begun) return begun;
    if (const auto op = reach(ctx, AlState::op, 20s); !op) return op;
    print("all slaves are in OP");
    return run_cycle(ctx, {.period = 10ms}, work);
}

}  // namespace

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake();
}

int main() {
    board::start_tick();
    if (const auto opened = nic.open(osal); !opened) return print("LAN9118: ", nic.problem()), 1;
    board::allow_ethernet_interrupt();
    if (const auto ready = init(ctx, nic, osal); !ready) return print("ended: ", sentence_of(ready.error())), 1;
    for (auto done = bring_up_and_run(); !done; done = bring_up_and_run()) {
        print("will be repeated: ", sentence_of(done.error()));
        print_problems(ctx);
        osal.wait(osal.now() + 500ms, -1);
    }
}
