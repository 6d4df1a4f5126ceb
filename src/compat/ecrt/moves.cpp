// A device that is connected after activation may change the positions of others. Positions are those of the interface:
// then the segment starts again, with each configuration at the device that has its position now. Until then nothing is
// sent to a device that has moved, because the outputs belong to another position. A slave that leaves changes
// nothing: the others keep their configurations, and it gets its own when it returns.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/operation.hpp"
#include "compat/ecrt/start_up.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace margay::compat::ecrt {
namespace {

constexpr Duration kLookEvery = std::chrono::milliseconds(50);
constexpr Duration kWatched = std::chrono::seconds(2);  // the supervision reads the ring within some cycles
// The order of slaves is read wrongly while cables are changed.
constexpr Duration kSettled = std::chrono::milliseconds(300);

bool is_device_of(const ec_slave_config& config, const Identity& identity) {
    return identity.vendor == config.vendor && identity.product == config.product;
}

bool is_online(const Bus& bus, const ec_slave_config& config) {
    const std::uint16_t number = config.number.load(std::memory_order_relaxed);
    const Slave& own = bus.ctx->slave(number);
    return number != 0 && is_there(own) && !own.held && is_device_of(config, own.identity);
}

}  // namespace

// Whether a device was connected before the slave of the configuration.
bool Operation::is_moved(const ec_slave_config& config) const {
    const std::uint16_t number = config.number.load(std::memory_order_relaxed);
    return config.alias == 0 && number != 0 && bus_.ctx->slave(number).ring_position > config.position + 1;
}

// Whether the configuration waits for its first device, and a device that fits is at its position.
bool Operation::may_attach(const ec_slave_config& config) const {
    if (config.alias != 0 || is_online(bus_, config)) return false;
    const std::uint16_t number = config.number.load(std::memory_order_relaxed);
    const Slave& own = bus_.ctx->slave(number);
    // The supervision brings the slave back.
    if (number != 0 && own.seen && is_device_of(config, own.identity)) return false;
    for (const Slave& slave : bus_.ctx->slaves()) {
        if (!is_there(slave) || slave.ring_position != config.position + 1) continue;
        const auto has = [&](const auto& other) { return other->number == slave.number && is_online(bus_, *other); };
        return slave.number != number && is_device_of(config, slave.identity) &&
               std::ranges::none_of(bus_.configs, has);
    }
    const auto fits = [&](const Identity& stranger) { return is_device_of(config, stranger); };
    return bus_.answering > config.position && std::ranges::any_of(bus_.strangers, fits);
}

// Whether the slave came after the process data was laid out, and has process data that the program has not named:
// nothing is reserved for this data, and the slave may refuse OP without it. When the slave is present, a new mapping
// places the data, unless the process data could not be found: then the mapping would fail in the same way.
bool Operation::lacks_place(const ec_slave_config& config) const {
    const Slave& own = bus_.ctx->slave(config.number.load(std::memory_order_relaxed));
    if (own.number == 0 || !is_there(own) || own.held || own.pdos_failed) return false;
    if (own.unplaced && own.seen) return true;
    if (!config.late) return false;
    for (std::uint8_t n = 0; n < own.sm_count; ++n)
        if (own.sync_managers[n].type == SmType::outputs &&
            std::ranges::find(config.plan.sms, n, &SmPdos::sync_manager) == config.plan.sms.end())
            return true;
    return false;
}

bool Operation::is_misplaced() const {
    const auto is_wrong = [this](const auto& config) {
        return is_moved(*config) || may_attach(*config) || lacks_place(*config);
    };
    return restarts_left_ != 0 && target_ == AlState::op && !bus_.silent && std::ranges::any_of(bus_.configs, is_wrong);
}

// After slaves have come or gone each cycle compares the positions.
void Operation::watch_places(Time now) {
    if (std::exchange(changed_, false)) watched_until_ = now + kWatched;
    if (now >= watched_until_) watched_until_ = {};
    hold_moved();
}

void Operation::hold_moved() {
    for (const auto& exchange : bus_.exchanges) {
        const auto has_moved = [&](const auto& config) {
            return config->group == exchange->group && is_moved(*config);
        };
        exchange->held = target_ == AlState::op && std::ranges::any_of(bus_.configs, has_moved);
    }
}

void Operation::check(Time now) {
    if (stage_ != Stage::running) return;
    if (starting() && (now >= starting_until_ || are_started())) end_starting();
    watch_places(now);
    if (now >= look_at_) {
        look_at_ = now + kLookEvery;
        if (!is_misplaced())
            misplaced_since_ = {};
        else if (misplaced_since_ == Time{})
            misplaced_since_ = now;
        else if (now - misplaced_since_ >= kSettled)
            return start_again();
    }
    if (supervise_.busy() || now < retry_) return;
    retry_ = now + kRetry;
    (void)submit(*bus_.ctx, supervise_);
}

void Operation::end_starting() {
    starting_until_ = {};
    for (const auto& config : bus_.configs) config->start_up = StartUp::over;
}

void Operation::start_again() {
    const auto unplaced = [this](const auto& config) { return lacks_place(*config); };
    const bool place = std::ranges::any_of(bus_.configs, unplaced);
    say("master %u: %s: the segment starts again", bus_.index,
        place ? "the frames have no place for a slave that came late" : "other slaves are there");
    --restarts_left_;
    misplaced_since_ = {};
    cancel();
    old_expected_ = std::move(expected_);
    stage_ = Stage::scan;
    retry_ = {};
    waited_ = 0;
    again_ = true;
    end_starting();
    for (const auto& exchange : bus_.exchanges) {
        exchange->mapped = exchange->held = false;
        exchange->answer = exchange->best = Answer::incomplete;
        ++exchange->answers;
        std::ranges::fill(exchange->image, std::byte{0});
    }
    clock_tries_ = kMostClockTries;
    first_clock_ = false;
    forget_slaves();
    if (plan_expected() == 0) return;
    restarts_left_ = 0;  // the reason was printed; the scan uses the earlier list
    std::swap(expected_, old_expected_);
    find_expected();
}

}  // namespace margay::compat::ecrt
