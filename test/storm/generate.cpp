// Generates a plan from a seed.
#include "storm/operations.hpp"
#include "storm/plan.hpp"

#include "oshw/filters/chance.hpp"
#include "sim/devices.hpp"
#include "sim/library/quirks.hpp"

#include <algorithm>
#include <initializer_list>

namespace margay::storm {
namespace {

// more_harm() chooses quirks that were added to the table later, so the plans of old seeds do not change.
constexpr std::size_t kQuirksOfOldSeeds = 51;
// Devices that were added to the library later. The plans of old seeds do not contain them.
constexpr std::size_t kLaterDevices = 6;
// The same for the kinds of requests, which more_mail() chooses.
std::size_t old_kinds() { return kinds().size() - later_kinds().size(); }

class Maker {
  public:
    explicit Maker(std::uint64_t seed) : chance_(seed) { plan_.seed = seed; }

    Plan make() {
        settings();
        devices();
        steps();
        more_settings();
        more_harm();
        more_mail();
        more_mistakes();
        return std::move(plan_);
    }

  private:
    std::uint32_t below(std::uint32_t bound) { return static_cast<std::uint32_t>(chance_.below(bound)); }
    bool one_in(std::uint32_t count) { return below(count) == 0; }
    std::uint32_t any(std::initializer_list<std::uint32_t> list) {
        return list.begin()[below(static_cast<std::uint32_t>(list.size()))];
    }
    std::uint32_t rate() { return any({1'000, 10'000, 50'000, 100'000, 300'000}); }

    void settings() {
        Settings& s = plan_.settings;
        s.calm = one_in(2) ? 1 : 0;
        s.cycle_us = any({1000, 1000, 1000, 500, 2000, 4000});
        s.groups = any({1, 1, 1, 2, 3});
        s.bits = below(2);
        s.overlapped = one_in(3) ? 1 : 0;
        s.group_lrd_lwr = one_in(5) ? 1 : 0;
        s.slave_lrd_lwr = one_in(5) ? 2 + below(3) : 0;
        s.in_flight = one_in(5) ? 2 + below(3) : 1;
        s.acyclic_bytes = any({1498, 1498, 0, 100, 20});
        s.al_status = one_in(4) ? 1 : 0;
        s.mailbox_status = one_in(3) ? 1 + below(2) : 0;
        s.watchdog_us = any({0, 0, 0, 20'000, 100'000});
        s.tasks = any({0, 0, 1, 2, 4});
        s.frames = any({64, 64, 8, 2, 1, 128});
        s.process_frames = 8 + 8 * s.in_flight * s.groups;
        s.expect = any({0, 0, 0, 1, 2, 3});
        s.hooks = any({0, 0, 1, 2, 3});
        s.startup = one_in(4) ? 1 : 0;
        s.callback = one_in(3) ? 1 : 0;
        s.wire_time = one_in(3) ? 1 : 0;
        s.round_trip_us = any({100, 100, 20, 300});
        s.supervise_target = one_in(8) ? 4 : 8;
        s.line_ms = one_in(3) ? 10 + below(500) : 0;
        s.close_busy = one_in(4) ? 1 : 0;
    }

    // Mailbox faults during bring-up, EEPROMs with mailboxes that no frame carries, hostile register writes, and writes
    // to the EEPROM beside faults of the power supply. They have a separate random sequence, too.
    void more_harm() {
        Chance chance(plan_.seed * 40503ULL + 2);
        const auto below = [&](std::size_t bound) { return static_cast<std::uint32_t>(chance.below(bound)); };
        if (below(4) == 0) lose_mail(chance);
        if (below(8) == 0) too_large_mailbox(chance);
        if (below(5) == 0)
            for (std::uint32_t n = 1 + below(3); n > 0; --n) hostile_writes(chance);
        if (below(4) == 0)
            for (std::uint32_t n = 1 + below(3); n > 0; --n) eeprom_updates(chance);
    }

    // Devices with mailbox protocols that were added later, in place of other devices, and requests for them. They have
    // a separate random sequence, too.
    void more_mail() {
        Chance chance(plan_.seed * 2246822519ULL + 3);
        const auto below = [&](std::size_t bound) { return static_cast<std::uint32_t>(chance.below(bound)); };
        if (plan_.settings.calm != 0 || below(4) != 0) return;
        const auto names = sim::device_names().last(kLaterDevices);
        for (auto& device : plan_.devices)
            if (device.name != "junction" && device.name != "coupler" && below(3) == 0) {
                device.name = names[below(names.size())];
                device.quirks.clear();
            }
        for (std::uint32_t n = 5 + below(20); n > 0; --n) {
            const auto kind = static_cast<std::uint32_t>(old_kinds()) + below(later_kinds().size());
            const bool other = kinds()[kind].mail && below(2) == 0;
            insert(chance, {{below(20'000),
                             other ? Op::submit_other : Op::submit,
                             {below(24), kind, below(plan_.devices.size() + 2), below(1 << 16), below(64)}}});
        }
    }

    // Replies without a mark, and sequences without memory. The plans of the seeds in README.md do not change, because
    // none of these seeds is divisible by 8.
    void more_mistakes() {
        constexpr std::uint64_t kOldSeeds = 400;
        if (plan_.seed <= kOldSeeds && plan_.seed % 8 != 0) return;
        Chance chance(plan_.seed * 3266489917ULL + 4);
        if (chance.below(4) == 0) plan_.settings.unmarked = 1;
        if (chance.below(2) == 0) return;
        for (auto n = 1 + chance.below(3); n > 0; --n)
            insert(chance, {{static_cast<std::uint32_t>(chance.below(20'000)),
                             Op::hoard,
                             {static_cast<std::uint32_t>(1 + chance.below(chance.below(2) == 0 ? 5 : 300)),
                              static_cast<std::uint32_t>(chance.below(160))}}});
    }

    // Replies of devices whose SII does not list their PDOs are lost, some of them for good.
    void lose_mail(Chance& chance) {
        constexpr std::array kManners{"never_replies", "never_replies", "empty_repeats", "slow_replies",
                                      "short_replies", "empty_replies", "mailbox_full"};
        constexpr std::array<std::uint32_t, 4> kRates{0, 30'000, 100'000, 200'000};
        if (plan_.settings.expect < 4) plan_.settings.bring_up_drop = kRates[chance.below(kRates.size())];
        for (auto& device : plan_.devices) {
            if (!device.quirks.empty() || chance.below(3) != 0) continue;
            // The order matters, because a quirk of the firmware writes the SII again.
            device.quirks.emplace_back(kManners[chance.below(kManners.size())]);
            device.quirks.emplace_back("sii_no_pdos");
            if (chance.below(2) == 0) device.quirks.emplace_back("sii_sync_managers_off");
        }
    }

    void too_large_mailbox(Chance& chance) {
        constexpr std::array kNames{"sii_mailbox_1487", "sii_mailbox_large", "sii_mailbox_in_large"};
        auto& device = plan_.devices[chance.below(plan_.devices.size())];
        device.quirks.emplace_back(kNames[chance.below(kNames.size())]);
    }

    void insert(Chance& chance, std::initializer_list<Step> steps) {
        const auto at = static_cast<std::ptrdiff_t>(chance.below(plan_.steps.size() + 1));
        plan_.steps.insert(plan_.steps.begin() + at, steps);
    }

    void hostile_writes(Chance& chance) {
        const auto device = plan_.devices[chance.below(plan_.devices.size())].id;
        const auto write = [&](std::uint32_t address, std::uint32_t value, std::uint32_t octets) {
            return Step{static_cast<std::uint32_t>(chance.below(300)), Op::hostile, {device, address, value, octets}};
        };
        if (chance.below(2) == 0) {  // SYNC pulses, as fast as possible
            const auto nanoseconds = static_cast<std::uint32_t>(1 + chance.below(chance.below(2) == 0 ? 3 : 5000));
            insert(chance, {write(0x09A0, nanoseconds, 4), write(0x09A4, nanoseconds, 4), write(0x0990, 20'000'000, 8),
                            write(0x0981, 0x07 | static_cast<std::uint32_t>(chance.below(256)), 1)});
            return;
        }
        // DL control, watchdogs, FMMUs, SyncManagers, clock, SYNC and latch.
        constexpr std::array<std::pair<std::uint32_t, std::uint32_t>, 7> kAreas{{{0x0100, 4},
                                                                                 {0x0400, 0x22},
                                                                                 {0x0600, 0x80},
                                                                                 {0x0800, 0x80},
                                                                                 {0x0910, 0x26},
                                                                                 {0x0980, 0x08},
                                                                                 {0x0990, 0x40}}};
        for (auto n = 1 + chance.below(4); n > 0; --n) {
            const auto [base, size] = kAreas[chance.below(kAreas.size())];
            const auto address = base + static_cast<std::uint32_t>(chance.below(size));
            const auto value = static_cast<std::uint32_t>(chance.next());
            insert(chance, {write(address, value, static_cast<std::uint32_t>(1 + chance.below(8)))});
        }
    }

    // A write, and then: the power is switched off before the write ends, the EEPROM does not acknowledge for a time,
    // or nothing happens.
    void eeprom_updates(Chance& chance) {
        const auto device = plan_.devices[chance.below(plan_.devices.size())].id;
        const Step write{
            1'000,
            Op::eeprom_update,
            {device, static_cast<std::uint32_t>(chance.below(0x10000)), static_cast<std::uint32_t>(chance.below(2))}};
        const auto later = static_cast<std::uint32_t>(chance.below(25'000));
        switch (chance.below(3)) {
            case 0: insert(chance, {write, {later, Op::power_off, {device}}, {5'000, Op::power_on, {device}}}); break;
            case 1:
                insert(chance,
                       {write, {later, Op::eeprom_deaf, {device, static_cast<std::uint32_t>(110 + chance.below(80))}}});
                break;
            default: insert(chance, {write});
        }
    }

    // These settings have a separate random sequence, so the earlier choices for a seed do not change.
    void more_settings() {
        Chance chance(plan_.seed * 2654435761ULL + 1);
        Settings& s = plan_.settings;
        if (s.callback != 0) s.callback = 1 + static_cast<std::uint32_t>(chance.below(3));
        if (s.hooks != 0 && chance.below(4) == 0) s.hooks = 4;
        s.shared = chance.below(4) == 0 ? 1 : 0;
        s.copies = s.calm != 0 && chance.below(3) == 0 ? 1 : 0;
        if (s.calm != 0 && chance.below(3) == 0) s.expect = 4 + static_cast<std::uint32_t>(chance.below(2));
    }

    void devices() {
        const std::uint32_t count = 1 + below(one_in(4) ? 20 : 7);
        std::vector<std::pair<std::uint32_t, std::uint32_t>> open;  // free ports of devices
        for (std::uint32_t id = 0; id < count; ++id) {
            DevicePlan d;
            d.id = id;
            const auto all_names = sim::device_names();
            const auto names = all_names.first(all_names.size() - kLaterDevices);
            d.name = std::string(one_in(6) ? std::string_view("junction")
                                           : names[below(static_cast<std::uint32_t>(names.size()))]);
            if (one_in(5)) {
                const auto all = sim::quirks().first(kQuirksOfOldSeeds);
                for (std::uint32_t n = 1 + below(2); n > 0; --n)
                    d.quirks.emplace_back(all[below(static_cast<std::uint32_t>(all.size()))].name);
            }
            if (id != 0) {
                const auto at = one_in(3) ? below(static_cast<std::uint32_t>(open.size()))
                                          : static_cast<std::uint32_t>(open.size()) - 1;
                d.parent = static_cast<std::int32_t>(open[at].first);
                d.port = open[at].second;
                open.erase(open.begin() + static_cast<std::ptrdiff_t>(at));
            }
            if (d.name == "junction") {
                open.emplace_back(id, 2);
                open.emplace_back(id, 3);
            } else if (d.name == "coupler") {
                open.emplace_back(id, 2);
            }
            open.emplace_back(id, 1);
            plan_.devices.push_back(std::move(d));
        }
    }

    Step fault() {
        const auto device = below(static_cast<std::uint32_t>(plan_.devices.size()));
        switch (below(22)) {
            case 0:
            case 1: return {0, Op::cut, {device}};
            case 2:
            case 3:
            case 4: return {0, Op::mend, {device}};
            case 5: return {0, Op::power_off, {device}};
            case 6:
            case 7:
            case 8: return {0, Op::power_on, {device}};
            case 9: return {0, Op::noise, {one_in(2) ? 0 : rate(), one_in(2) ? 0 : rate()}};
            case 10: return {0, Op::eeprom_nacks, {device, 1 + below(20)}};
            case 11: return {0, Op::halt, {device}};
            case 12: return {0, Op::replug, {device}};
            case 13: return {0, Op::drop, {one_in(2) ? 0 : rate(), one_in(2) ? 0 : rate()}};
            case 14: return {0, Op::duplicate, {one_in(2) ? 0 : rate(), one_in(2) ? 0 : rate()}};
            case 15: return {0, Op::delay, {one_in(2) ? 0 : rate(), any({50, 500, 5'000, 30'000})}};
            case 16: return {0, Op::busy, {one_in(2) ? 0 : rate(), any({10, 100, 1'000, 50'000})}};
            case 17:
                if (plan_.settings.calm == 0 && one_in(3)) return {0, Op::flip, {rate()}};
                return {0, Op::flip, {0}};
            case 18:
                if (plan_.settings.calm == 0) return {0, Op::eeprom_word, {device, below(0x80), below(0x10000)}};
                return {0, Op::replug, {device}};
            case 19: return {0, Op::quirk, {device, below(33)}};
            case 20: return {0, Op::drop, {}};
            default: return {0, Op::noise, {}};
        }
    }

    Step operation() {
        const auto slave = below(static_cast<std::uint32_t>(plan_.devices.size()) + 2);
        const auto slot = below(24);
        switch (below(20)) {
            case 0: return {0, Op::cancel, {slot}};
            case 1: return {0, Op::destroy, {slot}};
            case 2: return {0, Op::ask_cancel, {slot}};
            case 3: return {0, Op::late, {any({0, 0, 100, 3'000, 20'000})}};
            case 4: return {0, Op::watch, {any({0, 1'000, 20'000})}};
            case 5:
                if (plan_.settings.calm == 0) return {0, Op::cycles, {below(2)}};
                break;
            case 6:
                if (plan_.settings.calm == 0) return {0, Op::map, {below(4)}};
                break;
            case 7:
                if (plan_.settings.calm == 0) return {0, Op::configure, {slave, below(6), below(6)}};
                break;
            case 8:
                if (plan_.settings.calm == 0) return {0, Op::write_state, {slave, below(4)}};
                break;
            default: break;
        }
        for (;;) {
            const auto kind = below(static_cast<std::uint32_t>(old_kinds()));
            const KindInfo& of = kinds()[kind];
            if (plan_.settings.calm != 0 && !of.reads) continue;
            const bool other = of.mail && one_in(2);
            return {0, other ? Op::submit_other : Op::submit, {slot, kind, slave, below(1 << 16), below(64)}};
        }
    }

    void steps() {
        const std::uint32_t count = 5 + below(one_in(3) ? 150 : 40);
        const std::uint32_t pace = any({200, 2'000, 20'000, 100'000});
        const std::uint32_t faults = any({0, 2, 3, 5});  // a fault occurs in one of `faults` steps; 0: never
        if (plan_.settings.calm == 0) {
            // Most plans begin like an application: scan, map, supervise.
            if (!one_in(4)) plan_.steps.push_back({0, Op::submit, {0, *kind_by_name("scan"), 0, 0, 0}});
            if (!one_in(4)) plan_.steps.push_back({any({100'000, 1'000'000, 5'000'000}), Op::map, {0}});
            if (!one_in(3))
                plan_.steps.push_back({below(100'000), Op::submit, {1, *kind_by_name("supervise"), 0, 0, below(2)}});
        }
        for (std::uint32_t n = 0; n < count; ++n) {
            Step step = faults != 0 && one_in(faults) ? fault() : operation();
            step.after_us = one_in(4) ? 0 : below(pace);
            plan_.steps.push_back(step);
        }
    }

    Chance chance_;
    Plan plan_;
};

}  // namespace

Plan make_plan(std::uint64_t seed) { return Maker(seed).make(); }

}  // namespace margay::storm
