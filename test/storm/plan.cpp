#include "storm/plan.hpp"

#include "storm/operations.hpp"

#include <algorithm>
#include <charconv>
#include <set>
#include <sstream>

namespace margay::storm {
namespace {

constexpr OpInfo kOps[] = {
    {"cut", 1, Actor::world, true},         {"mend", 1, Actor::world, true},
    {"power_off", 1, Actor::world, true},   {"power_on", 1, Actor::world, true},
    {"noise", 2, Actor::world, false},      {"eeprom_nacks", 2, Actor::world, true},
    {"eeprom_word", 3, Actor::world, true}, {"halt", 1, Actor::world, true},
    {"quirk", 2, Actor::world, true},       {"replug", 1, Actor::world, true},
    {"drop", 2, Actor::world, false},       {"duplicate", 2, Actor::world, false},
    {"delay", 2, Actor::world, false},      {"flip", 1, Actor::world, false},
    {"busy", 2, Actor::world, false},       {"submit_other", 5, Actor::other, false},
    {"ask_cancel", 1, Actor::other, false}, {"submit", 5, Actor::owner, false},
    {"cancel", 1, Actor::owner, false},     {"destroy", 1, Actor::owner, false},
    {"cycles", 1, Actor::owner, false},     {"map", 1, Actor::owner, false},
    {"late", 1, Actor::owner, false},       {"watch", 1, Actor::owner, false},
    {"configure", 3, Actor::owner, false},  {"write_state", 2, Actor::owner, false},
    {"hostile", 4, Actor::owner, true},     {"eeprom_update", 3, Actor::owner, true},
    {"eeprom_deaf", 2, Actor::world, true}, {"hoard", 2, Actor::world, false},
};
static_assert(std::size(kOps) == static_cast<std::size_t>(Op::count_of_ops));

bool is_submit(Op op) { return op == Op::submit || op == Op::submit_other; }

template <class T>
bool read_number(std::istringstream& in, T& value) {
    std::int64_t number = 0;
    if (!(in >> number)) return false;
    value = static_cast<T>(number);
    return true;
}

bool read_device(std::istringstream& in, DevicePlan& device) {
    std::string word;
    if (!read_number(in, device.id) || !(in >> device.name) || !read_number(in, device.parent) ||
        !read_number(in, device.port))
        return false;
    while (in >> word) device.quirks.push_back(word);
    return true;
}

bool read_step(std::istringstream& in, Step& step) {
    std::string word;
    if (!read_number(in, step.after_us) || !(in >> word)) return false;
    const auto* const found =
        std::find_if(std::begin(kOps), std::end(kOps), [&](const auto& o) { return o.name == word; });
    if (found == std::end(kOps)) return false;
    step.op = static_cast<Op>(found - std::begin(kOps));
    for (unsigned n = 0; n < found->args; ++n) {
        if (n == 1 && is_submit(step.op)) {
            const bool named = static_cast<bool>(in >> word);
            const auto kind = named ? kind_by_name(word) : std::nullopt;
            if (!kind) return false;
            step.args[n] = *kind;
        } else if (!read_number(in, step.args[n])) {
            return false;
        }
    }
    return true;
}

bool read_setting(std::istringstream& in, Settings& settings) {
    std::string word;
    if (!(in >> word)) return false;
    for (const auto& one : setting_infos())
        if (one.name == word) return read_number(in, settings.*one.value);
    return false;
}

}  // namespace

const OpInfo& info(Op op) { return kOps[static_cast<std::size_t>(op)]; }

const std::vector<SettingInfo>& setting_infos() {
    static const std::vector<SettingInfo> kAll{
        {"calm", &Settings::calm},
        {"cycle_us", &Settings::cycle_us},
        {"groups", &Settings::groups},
        {"bits", &Settings::bits},
        {"overlapped", &Settings::overlapped},
        {"group_lrd_lwr", &Settings::group_lrd_lwr},
        {"slave_lrd_lwr", &Settings::slave_lrd_lwr},
        {"in_flight", &Settings::in_flight},
        {"acyclic_bytes", &Settings::acyclic_bytes},
        {"reserve_bytes", &Settings::reserve_bytes},
        {"al_status", &Settings::al_status},
        {"mailbox_status", &Settings::mailbox_status},
        {"watchdog_us", &Settings::watchdog_us},
        {"tasks", &Settings::tasks},
        {"frames", &Settings::frames},
        {"process_frames", &Settings::process_frames},
        {"expect", &Settings::expect},
        {"hooks", &Settings::hooks},
        {"startup", &Settings::startup},
        {"callback", &Settings::callback},
        {"copies", &Settings::copies},
        {"shared", &Settings::shared},
        {"wire_time", &Settings::wire_time},
        {"round_trip_us", &Settings::round_trip_us},
        {"supervise_target", &Settings::supervise_target},
        {"line_ms", &Settings::line_ms},
        {"bring_up_drop", &Settings::bring_up_drop},
        {"close_busy", &Settings::close_busy},
        {"unmarked", &Settings::unmarked},
    };
    return kAll;
}

std::string to_text(const Plan& plan) {
    std::ostringstream out;
    out << "seed " << plan.seed << "\n";
    const Settings usual;
    for (const auto& one : setting_infos())
        if (plan.settings.*one.value != usual.*one.value)
            out << "set " << one.name << " " << plan.settings.*one.value << "\n";
    for (const auto& d : plan.devices) {
        out << "device " << d.id << " " << d.name << " " << d.parent << " " << d.port;
        for (const auto& quirk : d.quirks) out << " " << quirk;
        out << "\n";
    }
    for (const auto& step : plan.steps) {
        out << "after " << step.after_us << " " << info(step.op).name;
        for (unsigned n = 0; n < info(step.op).args; ++n) {
            out << " ";
            if (n == 1 && is_submit(step.op))
                out << kind_name(step.args[n]);
            else
                out << step.args[n];
        }
        out << "\n";
    }
    return out.str();
}

std::optional<Plan> parse_plan(std::string_view text, std::string& why) {
    Plan plan;
    std::istringstream all{std::string(text)};
    std::string line;
    for (int number = 1; std::getline(all, line); ++number) {
        std::istringstream in(line);
        std::string word;
        if (!(in >> word) || word[0] == '#') continue;
        bool good = false;
        if (word == "seed") {
            good = static_cast<bool>(in >> plan.seed);
        } else if (word == "set") {
            good = read_setting(in, plan.settings);
        } else if (word == "device") {
            good = read_device(in, plan.devices.emplace_back());
        } else if (word == "after") {
            good = read_step(in, plan.steps.emplace_back());
        }
        if (good) continue;
        why = "line " + std::to_string(number) + ": " + line;
        return std::nullopt;
    }
    return plan;
}

Plan without_device(const Plan& plan, std::size_t which) {
    Plan smaller = plan;
    const DevicePlan gone = plan.devices[which];
    smaller.devices.erase(smaller.devices.begin() + static_cast<std::ptrdiff_t>(which));
    bool place = true;  // the parent's port of the removed device is free for one child
    for (auto& d : smaller.devices) {
        if (d.parent != static_cast<std::int32_t>(gone.id)) continue;
        d.parent = place ? gone.parent : -2;  // -2: removed below
        d.port = gone.port;
        place = false;
    }
    std::set<std::int32_t> there{-1};
    std::erase_if(smaller.devices, [&](const DevicePlan& d) {
        if (!there.contains(d.parent)) return true;
        there.insert(static_cast<std::int32_t>(d.id));
        return false;
    });
    std::erase_if(smaller.steps, [&](const Step& step) {
        return info(step.op).names_device && !there.contains(static_cast<std::int32_t>(step.args[0]));
    });
    return smaller;
}

}  // namespace margay::storm
