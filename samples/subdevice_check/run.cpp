// Executes all checks on one slave.
#include "common/program.hpp"
#include "common/slave_eeprom.hpp"
#include "common/slave_report.hpp"
#include "subdevice_check/check.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;

constexpr int kTriesOfCheck = 2;
constexpr int kReadings = 4;

void read_content(Session& session) {
    SlaveEeprom eeprom(session.bench.context(), session.bench.number());
    // Lost frames are not a fault of the device, so a lost frame may be sent again here, as in the scan.
    auto& sendings = session.bench.context().link_settings().sendings;
    const auto once = std::exchange(sendings, LinkSettings{}.sendings);
    auto content = read_used_part(eeprom, no_progress());
    for (int n = 1; n < kReadings && !content.error.empty(); ++n) content = read_used_part(eeprom, no_progress());
    sendings = once;
    session.sii = std::move(content.octets);
    session.sii_fault = std::move(content.error);
}

CheckResult execute_check(Session& session, const Check& check) {
    CheckResult result;
    for (int n = 0; n < kTriesOfCheck; ++n) {
        result = {.name = std::string(check.name), .what = std::string(check.what)};
        session.bench.begin(result, check.clause);
        try {
            check.run(session);
        } catch (const NotJudged& not_judged) {
            result.reason = not_judged.reason;
            if (result.outcome == Outcome::passed) result.outcome = Outcome::not_applicable;
        } catch (const LineFault& fault) {
            result.outcome = Outcome::broken_off;
            result.reason = "the line loses frames: " + fault.reason;
        }
        // A second attempt would use the values of the first attempt as values of the device.
        if (const auto left = std::exchange(session.left_changed, {}); !left.empty()) {
            if (result.outcome != Outcome::failed) result.outcome = Outcome::broken_off;
            result.reason = result.reason.empty() ? left : left + "; " + result.reason;
            return result;
        }
        if (result.outcome != Outcome::broken_off) return result;
    }
    return result;
}

// These checks use the entries that information.entries reads.
bool uses_entries(std::string_view name) {
    return name.starts_with("sdo.") || name.starts_with("segments.") || name.starts_with("pdos.") ||
           name == "information.uses" || name == "information.limits";
}

// The names between the commas, without blanks around them.
std::vector<std::string_view> names_of(std::string_view list) {
    std::vector<std::string_view> names;
    while (!list.empty()) {
        const auto end = std::min(list.find(','), list.size());
        auto name = list.substr(0, end);
        while (name.starts_with(' ')) name.remove_prefix(1);
        while (name.ends_with(' ')) name.remove_suffix(1);
        names.push_back(name);
        list.remove_prefix(std::min(end + 1, list.size()));
    }
    return names;
}

bool begins_with_one_of(std::string_view name, std::string_view list) {
    return std::ranges::any_of(names_of(list), [&](std::string_view n) { return name.starts_with(n); });
}

// The first name of the list that no check has: a misspelled name must not look like a check that passed.
std::optional<std::string_view> name_without_check(const Options& options) {
    const auto checks = all_checks();
    for (const auto name : names_of(options.only))
        if (name.empty() || std::ranges::none_of(checks, [&](const Check& c) { return c.name.starts_with(name); }))
            return name;
    return std::nullopt;
}

std::vector<Check> chosen_checks(const Options& options) {
    auto checks = all_checks();
    if (options.only.empty()) return checks;
    const bool entries = std::ranges::any_of(checks, [&](const Check& check) {
        return uses_entries(check.name) && begins_with_one_of(check.name, options.only);
    });
    std::erase_if(checks, [&](const Check& check) {
        return !begins_with_one_of(check.name, options.only) && !(entries && check.name == "information.entries");
    });
    return checks;
}

// Leaves the slave as config_init() does: in INIT, without SyncManagers, and the EEPROM with the master.
void leave(Bench& bench) {
    CheckResult ignored;
    bench.begin(ignored, {});
    try {
        bench.reset();
    } catch (const NotJudged&) {
    } catch (const LineFault&) {
    }
}

}  // namespace

std::vector<Check> all_checks() {
    std::vector<Check> all;
    for (const auto& table :
         {eeprom_checks(), state_checks(), sync_manager_checks(), mailbox_checks(), information_checks(), sdo_checks(),
          complete_access_checks(), segment_checks(), pdo_checks(), module_checks(), sync_type_checks(),
          watchdog_checks(), clock_checks(), message_checks()})
        all.insert(all.end(), table.begin(), table.end());
    return all;
}

Checked check_device(Context& ctx, Osal& osal, WaitHandles nics, std::uint16_t number, const Options& options,
                     const std::function<void(std::string_view)>& progress) {
    const auto found = config_init(ctx);
    if (!found && found.error().slave == 0) return {.error = sentence(found.error())};
    const std::size_t count = ctx.slaves().size();
    if (number < 1 || number > count)
        return {.error = count == 1 ? "NUMBER: there is 1 slave, the first is 1"
                                    : fmt::format("NUMBER: there are slaves 1 to {}", count),
                .wrong_arguments = true};
    // The checks report the errors of this slave themselves.
    while (ctx.errors().take()) {
    }
    while (ctx.warnings().take()) {
    }
    if (const auto name = name_without_check(options))
        return {.error = fmt::format("no check has a name that begins with '{}'", *name), .wrong_arguments = true};
    Bench bench(ctx, osal, nics, number);
    MailBench mail(bench);
    SdoClient sdo(mail);
    Session session{bench, mail, sdo, options};
    bench.on_mailbox_start([&mail] { mail.restarted(); });
    bench.on_preop([&session] {
        find_process_data_lengths(session);
        find_shortest_cycle(session);
    });
    read_content(session);
    if (has_sync_mode(session))
        bench.on_clock([&session](unsigned attempt) { return activate_clock(session, attempt); },
                       clock_attempts(session));

    const auto& slave = bench.slave();
    Report report{number, std::string(slave.name().empty() ? "a device without a name" : slave.name()),
                  slave.identity.vendor, slave.identity.product, slave.identity.revision};
    for (const auto& check : chosen_checks(options)) {
        if (stop_asked()) break;
        if (progress) progress(check.name);
        report.checks.push_back(execute_check(session, check));
    }
    leave(bench);
    if (stop_asked()) return {.report = std::move(report), .error = "stopped"};
    return {.report = std::move(report)};
}

}  // namespace margay::samples::conformance
