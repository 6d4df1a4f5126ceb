#include "station/al_state.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr Duration kFirstPause = std::chrono::microseconds(200);
constexpr Duration kOldErrorStands = std::chrono::milliseconds(200);
constexpr Duration kLongestPause = std::chrono::milliseconds(5);
// Until then, a slow processor has read the register.
constexpr Duration kControlStaysFull = std::chrono::milliseconds(200);

constexpr std::uint16_t code_offset = reg::kAlStatusCode.address - reg::kAlStatus.address;

AlStatus load_al_status(std::uint64_t status_to_code) {
    const auto status = static_cast<std::uint16_t>(status_to_code);
    // While AL status reports a device id, the AL status code register contains the id (ETG.1020).
    const bool is_code = (status & wire::al::kDeviceIdentification) == 0;
    return {.state = static_cast<AlState>(status & wire::al::kStateMask),
            .error = (status & wire::al::kErrorIndication) != 0,
            .code = is_code ? static_cast<std::uint16_t>(status_to_code >> (8 * code_offset)) : std::uint16_t{0}};
}

}  // namespace

ReadAlStatus::ReadAlStatus(const Station& station)
    : RegisterWait(station, reg::kAlStatus.address, reg::kAlStatusCode.end() - reg::kAlStatus.address,
                   Step::read_state) {}

Result<AlStatus> ReadAlStatus::await_resume() const noexcept {
    const Error failed = error();
    if (failed.code != Errc::none) return failed;
    return value();
}

AlStatus ReadAlStatus::value() const noexcept { return load_al_status(load_le<std::uint64_t>(bytes())); }

Task<Result<>> request_again(Station station, std::uint16_t request, Step step, Duration patience) {
    const Time give_up = later(station.engine.now(), patience);
    Duration pause = kFirstPause;
    for (;;) {
        const auto status = co_await required(read_al_status(station));
        co_await station.engine.sleep_for(pause);
        pause = std::min(pause * 2, kLongestPause);
        auto written = co_await write<std::uint16_t>(station, reg::kAlControl, request, step);
        if (written || !does_not_answer(written.error())) co_return written;
        if (station.engine.now() < give_up) continue;
        Error error = station.error(Errc::timeout, step);
        error.expected = request & wire::al::kStateMask;
        error.actual = static_cast<std::uint32_t>(status.state);
        co_return error;
    }
}

Task<Result<AlStatus>> change_al_state(Station station, AlState state, bool device_emulation, Duration timeout) {
    const auto before = co_await required(read_al_status(station));
    co_return co_await required(change_al_state_from(station, before, state, device_emulation, timeout));
}

Task<Result<AlStatus>> change_al_state_from(Station station, AlStatus before, AlState state, bool device_emulation,
                                            Duration timeout) {
    const Time give_up = later(station.engine.now(), timeout);
    const bool acknowledge = before.error && !device_emulation;
    const auto request =
        static_cast<std::uint16_t>(static_cast<unsigned>(state) | (acknowledge ? wire::al::kErrorAcknowledge : 0U));
    auto written = co_await write<std::uint16_t>(station, reg::kAlControl, request, Step::request_state);
    if (does_not_answer(written.error()))
        written = co_await request_again(station, request, Step::request_state, std::min(timeout, kControlStaysFull));
    if (!written) co_return written.error();
    const Time give_up_old = station.engine.now() + kOldErrorStands;
    Duration pause = kFirstPause;
    for (;;) {
        auto now = co_await read_al_status(station);
        if (!now) co_return now;
        if (now->state == state && !now->error) co_return now;
        const bool over = station.engine.now() >= give_up;
        // The old error indication stays until the slave has processed the acknowledge. So it is no refusal yet.
        const bool old = *now == before && station.engine.now() < give_up_old;
        if ((now->error && !old) || over) {
            Error error = station.error(now->error ? Errc::al_status : Errc::timeout, Step::request_state);
            error.expected = static_cast<std::uint32_t>(state);
            error.actual = static_cast<std::uint32_t>(now->state);
            error.detail = now->code;
            co_return error;
        }
        co_await station.engine.sleep_for(pause);
        pause = std::min(pause * 2, kLongestPause);
    }
}

Duration default_al_timeout(AlState state) {
    switch (state) {
        case AlState::preop:
        case AlState::boot: return std::chrono::seconds(3);
        case AlState::safeop:
        case AlState::op: return std::chrono::seconds(10);
        default: return std::chrono::seconds(5);
    }
}

}  // namespace margay
