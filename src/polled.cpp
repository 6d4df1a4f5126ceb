// The blocking forms: submit, poll and wait, in this one place.
#include "request_queue.hpp"

#include <margay/margay.hpp>

namespace margay {

// While another thread runs the cycle the work is left to it, and done here as soon as there is no cycle any more.
Result<> wait(Context& ctx, Request& request) {
    constexpr Duration kLookAgain = std::chrono::milliseconds(1);
    Osal* osal = ContextAccess::osal(ctx);
    if (osal == nullptr) return Error{.code = Errc::wrong_state};
    const int handle = ContextAccess::network(ctx)->engine.link().nic().wait_handle();
    while (request.busy()) {
        if (cycle_runs(ctx) && !is_cycle_thread(ctx)) {
            osal->wait(osal->now() + kLookAgain, -1);
            continue;
        }
        const Time next = poll(ctx, osal->now());
        if (request.busy()) osal->wait(next, handle);
    }
    return request.state() == RequestState::success ? Result<>() : Result<>(request.error());
}

Result<std::uint16_t> config_init(Context& ctx) {
    ScanRequest request;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done.error();
    return request.slaves;
}

Result<> eeprom_read(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<std::byte> data) {
    SiiReadRequest request;
    request.slave = slave;
    request.word = word;
    request.data = data;
    return submit_and_wait(ctx, request);
}

Result<> eeprom_write(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<const std::byte> data) {
    SiiWriteRequest request;
    request.slave = slave;
    request.word = word;
    request.data = data;
    return submit_and_wait(ctx, request);
}

}  // namespace margay
