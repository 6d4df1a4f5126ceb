// The list of slaves that the library expects, made of the addresses of the configurations.
//
// Each position of the line has an entry, so that the number of a slave is its position: that of a configuration, or
// one for any device, which is kept in PREOP. Behind the line there are such entries for devices that come later.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/operation.hpp"

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <map>
#include <set>
#include <vector>

namespace margay::compat::ecrt {
namespace {

constexpr std::size_t kNewcomers = 4;  // devices behind the line that may come later
constexpr SlaveConfiguration kOnlyPreop{.highest = AlState::preop};

void say_too_far(const Bus& bus, const ec_slave_config& config) {
    say("configuration %u:%u stays offline: there can be %u slaves with those before it", config.alias, config.position,
        bus.ctx->limits().slaves);
}

// Slaves that may appear anywhere; their numbers follow the numbers of the line.
std::size_t count_anywhere(const std::vector<ExpectedSlave>& expected) {
    return static_cast<std::size_t>(std::ranges::count(expected, 0, &ExpectedSlave::number));
}

}  // namespace

// The position of the first slave with this alias, from 1 on; 0: there is none.
int Operation::first_with(std::uint16_t alias) const {
    int first = 0;
    for (const Slave& slave : bus_.ctx->slaves())
        if (slave.alias == alias && slave.ring_position != 0 && (first == 0 || slave.ring_position < first))
            first = slave.ring_position;
    return first;
}

// A slave that is identified by its place.
void Operation::add_expected(ec_slave_config& config) {
    int number = config.position + 1;
    if (config.alias != 0) {
        const int first = first_with(config.alias);
        if (first == 0) return;  // add_by_alias()
        number += first - 1;
    }
    if (number > bus_.ctx->limits().slaves) return say_too_far(bus_, config);
    for (const ExpectedSlave& other : expected_)
        if (other.number == number) {
            say("configurations for the same slave at position %d: %u:%u is left out", number - 1, config.alias,
                config.position);
            return;
        }
    ExpectedSlave slave{.number = static_cast<std::uint16_t>(number),
                        .vendor = config.vendor,
                        .product = config.product,
                        .config = &config.plan.configuration};
    if (config.alias != 0 && config.position == 0) slave.alias = config.alias;
    expected_.push_back(slave);
}

// The slaves with and behind an alias that no slave has at present: they may appear anywhere.
void Operation::add_by_alias(const ec_slave_config& config) {
    std::map<std::uint16_t, ec_slave_config*> at;
    for (const auto& other : bus_.configs) {
        if (other->alias != config.alias) continue;
        if (at.empty() && other.get() != &config) return;  // the first one adds all
        at[other->position] = other.get();
    }
    const std::size_t others = line_end() + count_anywhere(expected_);
    while (!at.empty() && others + at.rbegin()->first + 1 > bus_.ctx->limits().slaves) {
        say_too_far(bus_, *at.rbegin()->second);
        at.erase(std::prev(at.end()));
    }
    if (at.empty()) return;
    const std::uint16_t last = at.rbegin()->first;
    const bool alone = last == 0;
    std::uint8_t group = 0;
    for (const ExpectedSlave& other : expected_) group = std::max(group, other.hot_connect);
    ++group;
    for (std::uint16_t position = 0; position <= last; ++position) {
        ExpectedSlave slave{.hot_connect = alone ? std::uint8_t{0} : group};
        if (position == 0) slave.alias = config.alias;
        const auto found = at.find(position);
        if (found != at.end()) {
            slave.vendor = found->second->vendor;
            slave.product = found->second->product;
            slave.config = &found->second->plan.configuration;
        }
        expected_.push_back(slave);
    }
}

// The greatest number of a slave that is expected at its place, or that is there.
std::size_t Operation::line_end() const {
    std::size_t last = 0;
    for (const ExpectedSlave& slave : expected_) last = std::max<std::size_t>(last, slave.number);
    for (const Slave& slave : bus_.ctx->slaves()) last = std::max<std::size_t>(last, slave.ring_position);
    return last;
}

// The positions without a configuration.
void Operation::add_unconfigured() {
    const std::size_t room = bus_.ctx->limits().slaves - count_anywhere(expected_);
    std::set<std::size_t> used;
    for (const ExpectedSlave& slave : expected_) used.insert(slave.number);
    const std::size_t last = std::min(line_end() + kNewcomers, room);
    for (std::size_t number = 1; number <= last; ++number)
        if (!used.contains(number))
            expected_.push_back(
                {.number = static_cast<std::uint16_t>(number), .optional = true, .config = &kOnlyPreop});
}

// The entry of each configuration; the order of the list has changed.
void Operation::find_expected() {
    for (const auto& config : bus_.configs) {
        config->expected = nullptr;
        for (const ExpectedSlave& slave : expected_)
            if (slave.config == &config->plan.configuration) config->expected = &slave;
    }
}

int Operation::plan_expected() {
    expected_.clear();
    for (const auto& config : bus_.configs) add_expected(*config);
    for (const auto& config : bus_.configs)
        if (config->alias != 0 && first_with(config->alias) == 0) add_by_alias(*config);
    add_unconfigured();
    std::ranges::stable_sort(expected_, {}, [](const ExpectedSlave& slave) {
        return slave.number == 0 ? 0x10000 + (slave.hot_connect != 0 ? 1 : 0) : slave.number;
    });
    find_expected();
    (void)tolerate(*bus_.ctx, {.unexpected_slaves = true});
    const auto told = expect(*bus_.ctx, expected_);
    if (!told) {
        say_error(bus_, "the configured slaves", told.error());
        return -EINVAL;
    }
    return 0;
}

}  // namespace margay::compat::ecrt
