#include "network/configure.hpp"

#include "network/members.hpp"
#include "network/pdo_lists.hpp"
#include "network/pdos.hpp"
#include "network/search.hpp"
#include "network/settings.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
constexpr Step kStep = Step::configure_process_data;

// The SyncManagers that trigger the slave's process data watchdog: by their control octets, or all outputs.
enum class Fed : std::uint8_t { as_described, by_all_outputs };

// A watchdog that the application has set must be triggered, and in some SIIs the control octets of the outputs do not
// contain the trigger.
Fed fed(const Slave& slave) {
    using Watchdog = SlaveConfiguration::Watchdog;
    return slave.config.process_data_watchdog.value_or(Watchdog{0}) > Watchdog{0} ? Fed::by_all_outputs
                                                                                  : Fed::as_described;
}

void store(MutableBytes bytes, const ProcessSm& sm, Fed fed) {
    wire::SyncManager wanted = make_sync_manager(sm);
    if (fed == Fed::by_all_outputs && sm.direction == Direction::outputs)
        wanted.control |= wire::sm_control::kWatchdogTrigger;
    wire::store_sync_manager(bytes, wanted);
}

// An ESC accepts the address and length of a SyncManager only while the SyncManager is disabled.
Task<Result<>> write_sync_managers(Station station, const Slave& slave, Fed fed) {
    for (const ProcessSm& sm : slave.config.used_sms()) {
        const wire::Register place = reg::sync_manager(sm.number);
        std::array<std::byte, reg::kSyncManagerStride> bytes{};
        store(bytes, sm, fed);
        const auto activate = static_cast<std::uint16_t>(place.address + wire::SyncManagerLayout::activate::offset);
        Datagram switch_off(station.engine.link(), wire::Command::FPWR, {station.address, activate},
                            Bytes(kClearedRegisters).first(1));
        Datagram write_all(station.engine.link(), wire::Command::FPWR, {station.address, place.address}, Bytes(bytes));
        co_await together(switch_off, write_all);
        Error error = error_of_reply(station, switch_off, kStep, activate);
        if (error.code == Errc::none) error = error_of_reply(station, write_all, kStep, place.address);
        if (error.code != Errc::none) co_return error;
    }
    co_return Nothing{};
}

using FmmuBytes = std::array<std::byte, SlaveFmmus::kMost * reg::kFmmuStride>;
static_assert(sizeof(FmmuBytes) <= sizeof(kClearedRegisters));

std::size_t fmmu_count(const Slave& slave) { return std::min<std::size_t>(slave.dl.fmmus, SlaveFmmus::kMost); }

MutableBytes bytes_of_fmmu(FmmuBytes& bytes, std::size_t n) {
    return MutableBytes(bytes).subspan(n * reg::kFmmuStride, reg::kFmmuStride);
}

// This is a plain function: in a sequence, the frame of the coroutine would hold the FMMUs during each co_await.
Error store_fmmus(FmmuBytes& bytes, const Slave& slave, const ImageLayout& layout, bool active) {
    const auto fmmus = make_fmmus(slave, layout);
    for (std::size_t n = 0; fmmus && active && n < fmmus->at.size(); ++n)
        wire::store_fmmu(bytes_of_fmmu(bytes, n), fmmus->at[n]);
    return fmmus.error();
}

Result<bool> are_fmmus_of(const Slave& slave, const ImageLayout& layout, FmmuBytes& there) {
    const auto wanted = make_fmmus(slave, layout);
    if (!wanted) return wanted.error();
    bool same = true;
    for (std::size_t n = 0; n < fmmu_count(slave); ++n)
        same &= wire::load_fmmu(bytes_of_fmmu(there, n)) == wanted->at[n];
    return same;
}

// Writes all FMMUs that the ESC has, so that none of an older mapping remains.
Task<Result<>> write_fmmus(Station station, const Slave& slave, const ImageLayout& layout, bool active) {
    FmmuBytes bytes{};
    const Error refused = store_fmmus(bytes, slave, layout, active);
    if (refused.code != Errc::none) co_return refused;
    const std::size_t count = fmmu_count(slave);
    if (count == 0) co_return Nothing{};
    co_await required(write_bytes(station, reg::kFmmuBase, Bytes(bytes).first(count * reg::kFmmuStride), kStep));
    co_return Nothing{};
}

// Converts a time to units of the watchdogs, rounded up. Without a division of 64 bits, see Link::in_steps().
[[gnu::noinline]] std::uint16_t watchdog_units(Duration time, Duration unit) {
    std::uint32_t units = 0;
    for (std::uint32_t bit = 0x8000; bit != 0; bit /= 2)
        if ((units + bit) * unit < time) units += bit;
    return static_cast<std::uint16_t>(time > Duration{0} && units < 0xFFFF ? units + 1 : units);
}

// A value for a register of two octets; address 0: none.
struct RegisterValue {
    wire::Register place;
    std::uint16_t value = 0;
};
using WatchdogValues = std::array<RegisterValue, 3>;

// Only the watchdog times that the application has set.
WatchdogValues watchdog_values(const Slave& slave) {
    const SlaveTimes times = slave.config.times();
    const auto outputs = slave.config.process_data_watchdog;
    const auto pdi = times.pdi_watchdog;
    WatchdogValues values{};
    if (!outputs && !pdi && !times.watchdog_divider) return values;
    const std::uint16_t divider = times.watchdog_divider.value_or(kDividerFor100us);
    const Duration unit = watchdog_unit(times);
    values[0] = {reg::kWatchdogDivider, divider};
    if (pdi) values[1] = {reg::kPdiWatchdogTime, watchdog_units(*pdi, unit)};
    if (outputs) values[2] = {reg::kProcessDataWatchdogTime, watchdog_units(*outputs, unit)};
    return values;
}

Task<Result<>> write_watchdogs(Station station, const Slave& slave) {
    const WatchdogValues values = watchdog_values(slave);
    for (const RegisterValue& one : values) {
        if (one.place.address == 0) continue;
        co_await required(write<std::uint16_t>(station, one.place, one.value, kStep));
    }
    co_return Nothing{};
}

Task<Result<>> write_all(Station station, const Slave& slave, const ImageLayout& layout, bool running) {
    co_await required(write_sync_managers(station, slave, fed(slave)));
    co_await required(write_fmmus(station, slave, layout, !running));
    co_return co_await required(write_watchdogs(station, slave));
}

// Some slaves require a watchdog and refuse SAFEOP when nothing triggers it. Then all outputs are set to trigger it,
// and the request is repeated.
Task<Result<AlStatus>> to_safeop(Station station, const Slave& slave) {
    auto first =
        co_await change_al_state(station, AlState::safeop, slave.device_emulation, al_timeout(slave, AlState::safeop));
    if (first || first.error().code != Errc::al_status || fed(slave) == Fed::by_all_outputs ||
        first.error().detail != static_cast<std::uint32_t>(wire::AlStatusCode::invalid_watchdog_configuration))
        co_return first;
    co_await required(write_sync_managers(station, slave, Fed::by_all_outputs));
    auto second =
        co_await change_al_state(station, AlState::safeop, slave.device_emulation, al_timeout(slave, AlState::safeop));
    co_return second;
}

// The clock and the SYNC signals: many slaves check them on their way to SAFEOP.
Task<Result<>> prepare_clock_if_any(Network& network, Slave& slave) {
    if (network.clocks.prepare == nullptr) {
        if (slave.config.dc().source == SyncSettings::Source::none) co_return Result<>();
        co_return Error{.code = Errc::wrong_state, .step = Step::configure_sync, .slave = slave.number};
    }
    co_return co_await required(network.clocks.prepare(network, slave));
}

}  // namespace

Task<Result<>> clear_fmmus(Network& network, Slave& slave) {
    const std::size_t count = fmmu_count(slave);
    const Bytes zeros = Bytes(kClearedRegisters).first(std::max<std::size_t>(count, 1) * reg::kFmmuStride);
    const Station station = network.station(slave);
    Datagram write(station.engine.link(), wire::Command::FPWR, {station.address, reg::kFmmuBase}, zeros);
    const LeavingExchange leaving(network, slave, write);
    const Reply reply = co_await write;
    const Error failed = error_of_reply(station, reply, kStep, reg::kFmmuBase);
    // The write fails on a slave without FMMUs, which has nothing to clear.
    if (failed.code != Errc::none && count != 0) co_return failed;
    network.marks(slave).uncertain = false;
    set_takes_part(network, slave, false);
    co_return Nothing{};
}

Task<Result<>> clear_sync_managers(Network& network, const Slave& slave) {
    const Station station = network.station(slave);
    const std::size_t count = std::min<std::size_t>(slave.dl.sync_managers, Slave::kSyncManagers);
    if (count == 0) co_return Nothing{};
    Datagram write(station.engine.link(), wire::Command::FPWR, {station.address, reg::kSyncManagerBase},
                   Bytes(kClearedRegisters).first(count * reg::kSyncManagerStride));
    Datagram sync(station.engine.link(), wire::Command::FPWR, {station.address, reg::kSyncActivation.address},
                  Bytes(kClearedRegisters).first(1));
    co_await together(write, sync);  // not every slave has a SYNC unit
    if (!network.clocks.entries.empty()) network.clocks.of(slave).end_sync();
    co_return error_of_reply(station, write.reply(), Step::recover, reg::kSyncManagerBase);
}

Task<Result<bool>> has_fmmus(Network& network, Slave& slave, const ImageLayout& layout) {
    FmmuBytes there{};
    const Error refused = store_fmmus(there, slave, layout, false);
    if (refused.code != Errc::none) co_return refused;
    const std::size_t octets = fmmu_count(slave) * reg::kFmmuStride;
    if (octets == 0) co_return true;
    const Station station = network.station(slave);
    Datagram look(station.engine.link(), wire::Command::FPRD, {station.address, reg::kFmmuBase},
                  MutableBytes(there).first(octets));
    auto reply = co_await look;
    const Error error = error_of_reply(station, reply, kStep, reg::kFmmuBase);
    if (error.code != Errc::none) co_return error;
    co_return are_fmmus_of(slave, layout, there);
}

Task<Result<>> configure_process_data(Network& network, Slave& slave, const ImageLayout& layout, bool running) {
    const Station station = network.station(slave);
    auto before = co_await read_al_status(station);
    update_al_status(slave.al, before);
    if (!before) co_return before.error();
    if (before->state == AlState::safeop || before->state == AlState::op) {
        co_await required(bring_to_state(network, slave, AlState::preop));
    }
    if (slave.al.state != AlState::preop) {  // the slave has left PREOP by itself
        Error error = station.error(Errc::other_state, Step::request_state, 0);
        error.expected = static_cast<std::uint32_t>(AlState::preop);
        error.actual = static_cast<std::uint32_t>(slave.al.state);
        co_return error;
    }
    if (running && pdo_part(slave) != nullptr) {
        co_await required(pdo_part(slave)->write(network, slave));
    }
    co_await required(write_all(station, slave, layout, running));
    const Time begun = network.engine.now();
    co_await required(around_transition(network, slave, Transition::preop_to_safeop, Moment::before));
    co_await required(prepare_clock_if_any(network, slave));
    if (doubt_after_hook(network, slave, begun)) {
        co_await required(prove_before_request(network, slave, AlState::safeop));
    }
    network.marks(slave).requested = Transition::none;
    mark_unfinished(network, slave, Transition::preop_to_safeop);
    auto state = co_await to_safeop(station, slave);
    auto seen = co_await read_al_status(station);
    update_al_status(slave.al, seen);
    if (!state) co_return state.error();
    if (running) {
        network.marks(slave).uncertain = true;
        co_await required(write_fmmus(station, slave, layout, true));
        set_takes_part(network, slave, true);
    }
    const Time reached = network.engine.now();
    co_await required(around_transition(network, slave, Transition::preop_to_safeop, Moment::after));
    if (doubt_after_hook(network, slave, reached)) {
        co_await required(prove_before_request(network, slave, AlState::safeop));
    }
    co_return Nothing{};
}

}  // namespace margay
