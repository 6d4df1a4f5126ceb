// A master on FreeRTOS with two tasks. The cycle task owns the context: a hardware timer wakes it every 10 ms, with the
// higher priority. The reader task reads an object of slave 4 once a second, by calls that sleep until the cycle task
// has executed the request.
#include "tasks.hpp"

#include <margay/margay.hpp>
#include <margay/parts/osal/freertos/freertos_osal.hpp>
#include <margay/parts/oshw/lan9118/lan9118.hpp>
#include <margay/parts/util/bytes.hpp>

using namespace margay;
using namespace std::chrono_literals;

namespace {

constexpr Limits kLimits{.slaves = 8, .frames = 8, .groups = 1, .process_frames = 2, .emergencies = 2};
constexpr Duration kPeriod = 10ms;

FreertosOsal osal(board::counter, board::kHertz);
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
StaticContext<kLimits> ctx;
std::byte image[256];
SuperviseRequest supervision;
StaticTask<2048> cycle_task;
StaticTask<1024> reader_task;
std::atomic<bool> running{false};

void print_problems() {
    char sentence[160];
    while (const auto error = ctx.errors().take()) print("error: ", describe(*error, sentence));
    while (const auto event = ctx.events().take()) print("event: ", describe(*event, sentence));
}

std::uint64_t first_input() {
    for (const Slave& slave : ctx.slaves())
        if (!slave.image.inputs.bytes.empty()) return std::to_integer<std::uint64_t>(slave.image.inputs.bytes[0]);
    return 0;
}

Result<> start() {
    if (const auto opened = nic.open(osal); !opened) return print("LAN9118: ", nic.problem()), opened;
    board::allow_ethernet_interrupt(6);
    return init(ctx, nic, osal);
}

// The bring-up can be repeated, because slaves without power or a cable may be connected later.
Result<> bring_up() {
    const auto slaves = config_init(ctx);
    if (!slaves) return slaves.error();
    const auto octets = config_map(ctx, image);
    if (!octets) return octets.error();
    print(std::uint64_t{*slaves}, " slaves, ", std::uint64_t{*octets}, " octets of process data");
    if (const auto op = reach(ctx, AlState::op, 20s, {.period = kPeriod}); !op) return op;
    return submit(ctx, supervision);
}

void cycle(void*) {
    char sentence[160];
    if (const auto started = start(); !started) {
        print("ended: ", describe(started.error(), sentence));
        vTaskSuspend(nullptr);
    }
    for (auto up = bring_up(); !up; up = bring_up()) {
        print("will be repeated: ", describe(up.error(), sentence));
        print_problems();
        vTaskDelay(500);
    }
    print("all slaves are in OP");
    board::start_cycle_timer(kPeriod, 6);
    (void)allow_waiting(ctx, false);
    running = true;
    for (std::uint64_t n = 1;; ++n) {
        // Between the cycles: requests and supervision.
        while (ulTaskNotifyTake(pdTRUE, 0) == 0) osal.wait(poll(ctx, osal.now()), -1);
        image[0] = static_cast<std::byte>(n >> 6);  // the first outputs
        (void)send_processdata(ctx);
        (void)receive_processdata(ctx, kPeriod / 2);
        if (n % 100 == 0)
            print("cycle ", n, all_right(ctx) ? ": all right" : ": not all right", ", first input ", first_input());
        print_problems();
    }
}

void read(void*) {
    while (!running) vTaskDelay(10);
    for (;; vTaskDelay(1000)) {
        char text[160];
        const auto vendor = SDOread<std::uint32_t>(ctx, 4, 0x1018, 1);
        if (vendor) {
            TextWriter line(text);
            (line << "slave 4: vendor ").hex(*vendor, 8);
            print(line.text());
        } else {
            print("error: ", describe(vendor.error(), text));
        }
    }
}

}  // namespace

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake_from_interrupt();
}

extern "C" void timer1_handler() {
    board::clear_cycle_timer();
    BaseType_t other_task = pdFALSE;
    vTaskNotifyGiveFromISR(cycle_task.handle, &other_task);
    osal.wake_from_interrupt();
    portYIELD_FROM_ISR(other_task);
}

int main() {
    cycle_task.start("cycle", 3, cycle);
    reader_task.start("reader", 1, read);
    vTaskStartScheduler();
}
