// The segment that a plan expects: wrong slaves, missing slaves, slaves that are switched off at first, and a hot
// connect group.
#include "storm/world.hpp"
#include "wire/sii.hpp"

namespace margay::storm {
namespace {

constexpr std::uint16_t kHeadAlias = 0x0A1A;
constexpr std::uint8_t kMostEntryBits = 64;

}  // namespace

// The device itself, then the devices that are connected to it and behind it.
std::vector<std::uint32_t> World::group_behind(std::uint32_t first) const {
    std::vector<std::uint32_t> found{first};
    for (std::uint32_t n = first + 1; n < plan_.devices.size(); ++n) {  // a parent is before its children
        const auto parent = plan_.devices[n].parent;
        const bool behind = std::ranges::any_of(
            found, [&](std::uint32_t one) { return parent == static_cast<std::int32_t>(ids_[one]); });
        if (behind) found.push_back(n);
    }
    return found;
}

// Chooses one device and all devices behind it, if they are the devices that their SIIs describe. The first one is
// identified by an alias.
void World::choose_group() {
    if (plan_.settings.expect != 5) return;
    if (segment_.size() > 1) group_ = group_behind(1 + static_cast<std::uint32_t>(plan_.seed % (segment_.size() - 1)));
    if (group_.empty() || !std::ranges::all_of(group_, [this](std::uint32_t n) { return clean(n); })) {
        plan_.settings.expect = 1;
        return group_.clear();
    }
    const MutableBytes image = segment_.slave(group_.front()).sii().image();
    auto configuration = wire::sii::load_configuration(image);
    configuration.alias = kHeadAlias;
    wire::sii::store_configuration(image, configuration);
}

// The last one or two slaves of the ring, behind which no slave is connected.
void World::choose_away() {
    away_.clear();
    if (plan_.settings.expect == 5) {
        if ((plan_.seed >> 3) % 2 != 0) away_ = group_;
        return;
    }
    const auto order = segment_.order();
    for (std::size_t n = order.size(); n-- > 1 && away_.size() < 1 + plan_.seed % 2;)
        if (clean(order[n]))
            away_.push_back(order[n]);
        else
            break;
}

// The process data of the devices that are away or may leave as a group, as the PDOs of their setup describe it.
void World::keep_places() {
    choose_away();
    segment_order_ = segment_.order();
    for (const Slave& slave : ctx_->slaves()) {
        const auto devices = devices_at(slave.number);
        if (devices.empty()) continue;
        const auto device = devices.front();
        const auto is = [&](const std::vector<std::uint32_t>& list) {
            return std::ranges::find(list, device) != list.end();
        };
        if (!is(away_) && !is(group_)) continue;
        KeptPlace& kept = kept_[device];
        const auto sms = std::span(slave.config.sms).first(slave.config.sm_count);
        std::size_t entries = 0;
        for (const ProcessSm& sm : sms) entries += (sm.bits + kMostEntryBits - 1) / kMostEntryBits;
        kept.entries.reserve(entries);
        kept.pdos.reserve(sms.size());
        for (const ProcessSm& sm : sms) {
            if (sm.bits == 0) continue;
            const std::size_t first = kept.entries.size();
            for (std::uint32_t left = sm.bits; left > 0;) {
                const auto bits = static_cast<std::uint8_t>(std::min<std::uint32_t>(left, kMostEntryBits));
                kept.entries.push_back({.bits = bits});
                left -= bits;
            }
            const unsigned index = (sm.direction == Direction::outputs ? 0x1600U : 0x1A00U) + sm.number;
            kept.pdos.push_back({.index = static_cast<std::uint16_t>(index),
                                 .entries = {&kept.entries[first], kept.entries.size() - first}});
            kept.sms.push_back({.sync_manager = sm.number, .pdos = {&kept.pdos.back(), 1}});
        }
        kept.setup.pdos = Borrowed<SmPdos>(kept.sms.data(), kept.sms.size());
        kept.config.fixed_pdos = true;
        kept.config.setup = &kept.setup;
        kept.config.group = slave.config.group;
    }
}

void World::switch_away() {
    if (away_.empty()) return;
    if (plan_.settings.expect == 5)
        segment_.set_cable({away_.front(), 0}, false);
    else
        for (const auto n : away_) segment_.set_power(n, false, osal_.now());
    note_presence(true);
    run_for(std::chrono::milliseconds(5));
}

// Some time after the steps have begun the devices come, in the order of the ring. Only this order distinguishes equal
// slaves.
void World::come_back() {
    Time at = osal_.now() + std::chrono::milliseconds(plan_.seed % 200);
    auto order = away_;
    if (plan_.settings.expect != 5) std::ranges::reverse(order);  // choose_away() begins at the end
    for (const auto n : order) {
        const Op op = plan_.settings.expect == 5 ? Op::mend : Op::power_on;
        const Due due{at, {0, op, {ids_[n]}}};
        insert_due(due);
        at += std::chrono::milliseconds(7);
    }
}

// Uses the slaves that the first scan has found.
void World::expect_slaves() {
    const auto slaves = ctx_->slaves();
    expected_.clear();
    std::map<std::uint32_t, ExpectedSlave> members;
    std::uint16_t number = 0;
    bool wanted_is_missing = plan_.settings.expect == 2 || plan_.settings.expect == 3;
    for (const Slave& slave : slaves) {
        const auto devices = devices_at(slave.number);  // at the time before some devices were switched off
        const auto device = devices.empty() ? std::uint32_t{0xFFFF'FFFF} : devices.front();
        ExpectedSlave wanted{.vendor = slave.identity.vendor, .product = slave.identity.product};
        if (const auto kept = kept_.find(device); kept != kept_.end()) wanted.config = &kept->second.config;
        if (std::ranges::find(group_, device) != group_.end()) {
            wanted.hot_connect = 1;
            if (device == group_.front()) wanted.alias = kHeadAlias;
            members[device] = wanted;
            continue;
        }
        wanted.number = ++number;
        if (std::ranges::find(away_, device) != away_.end()) {
            wanted.optional = (plan_.seed >> 4) % 2 != 0;
            wanted_is_missing = wanted_is_missing || !wanted.optional;
        }
        expected_.push_back(wanted);
    }
    // The order of the ring is the order of the first scan.
    for (const auto n : segment_order_)
        if (members.contains(n)) expected_.push_back(members[n]);
    if (plan_.settings.expect == 2 && !expected_.empty()) {
        auto& one = expected_[plan_.seed % expected_.size()];
        one.product = *one.product + 0x7000'0000;
        wrong_ = one.number;
    }
    if (plan_.settings.expect == 3) {
        expected_configuration_ = {};
        expected_configuration_.source = ConfigurationSource::application;
        expected_configuration_.add({0, Direction::outputs, 0x64, 0x1100, 16});
        expected_configuration_.add({1, Direction::inputs, 0x20, 0x1400, 16});
        expected_.push_back({.number = static_cast<std::uint16_t>(slaves.size() + 1),
                             .vendor = 0x4D47,
                             .product = 0x7FFF'FFFF,
                             .config = &expected_configuration_});
    }
    if (!expect(*ctx_, expected_)) fail("expect() is refused", "");
    auto found = scan_now();
    if (plan_.settings.bring_up_drop != 0 && !found) {
        nic_->settle();
        found = scan_now();
    }
    look_around();
    if (wanted_is_missing && found) fail("bring-up", "config_init() succeeds without a wanted slave");
    blame("bring-up", found.error());
}

}  // namespace margay::storm
