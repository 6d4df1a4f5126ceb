// What a slave must check before it uses its SyncManagers: wrong settings of the master are refused at the transition,
// and a SyncManager that is switched off while it is used leads to a lower state.
#include "subdevice_check/check.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using wire::AlStatusCode;
using wire::SyncManager;

// One wrong setting.
struct Mistake {
    std::string_view what;
    void (*spoil)(SyncManager& setting);
};

constexpr Mistake kMailboxMistakes[] = {
    {"switched off", [](SyncManager& sm) { sm.activate = 0; }},
    {"with a length of 0", [](SyncManager& sm) { sm.length_bytes = 0; }},
    {"with a length of 4, less than a header", [](SyncManager& sm) { sm.length_bytes = 4; }},
    {"with three buffers", [](SyncManager& sm) { sm.control = static_cast<std::uint8_t>(sm.control & ~3U); }},
    {"in the wrong direction", [](SyncManager& sm) { sm.control ^= wire::sm_control::kEcatWrites; }},
    {"behind the end of the memory", [](SyncManager& sm) { sm.physical_start = 0xFFF0; }},
};
constexpr Mistake kProcessMistakes[] = {
    {"behind the end of the memory", [](SyncManager& sm) { sm.physical_start = 0xFFF0; }},
    {"switched off", [](SyncManager& sm) { sm.activate = 0; }},
    {"one octet longer", [](SyncManager& sm) { ++sm.length_bytes; }},
    {"one octet shorter", [](SyncManager& sm) { --sm.length_bytes; }},
    {"in the wrong direction", [](SyncManager& sm) { sm.control ^= wire::sm_control::kEcatWrites; }},
};

void needs_checks(Bench& bench) {
    if (bench.emulation()) bench.skip("the ESC mirrors AL control (0x0141 bit 0): nobody checks the SyncManagers");
}

// The slave must stay in `state`, with one of these codes; another code is a remark.
void expect_transition_refused(Bench& bench, AlState state, AlState to, std::initializer_list<AlStatusCode> codes,
                               const std::string& what) {
    const auto status = bench.go(to, false);
    if (status.state != state || !status.error) {
        bench.fail(fmt::format("{}: the slave is in {}", what, status_text(status)));
    } else if (std::find(codes.begin(), codes.end(), static_cast<AlStatusCode>(status.code)) == codes.end()) {
        bench.fail(fmt::format("{}: the AL status code is 0x{:04x} ({}), expected 0x{:04x} ({})", what, status.code,
                               wire::al_status_text(status.code), static_cast<unsigned>(*codes.begin()),
                               wire::to_text(*codes.begin())),
                   "ETG.1000.6, table AL Status Codes");
    }
}

// Each mistake in each mailbox, on the way from INIT to `to` (PREOP or BOOT).
void expect_mistakes_refused(Bench& bench, AlState to, std::initializer_list<AlStatusCode> codes) {
    for (unsigned n = 0; n < 2; ++n)
        for (const auto& mistake : kMailboxMistakes) {
            bench.reset();
            bench.configure_mailboxes(to == AlState::boot);
            bench.give_eeprom(true);
            auto setting = bench.read_sync_manager(n);
            mistake.spoil(setting);
            bench.write_sync_manager(n, setting);
            expect_transition_refused(
                bench, AlState::init, to, codes,
                fmt::format("INIT to {} with SyncManager {} {}", state_text(to), n, mistake.what));
        }
}

void check_mailbox_settings(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    if (!bench.has_mailbox()) bench.skip("the SII describes no mailbox");
    expect_mistakes_refused(
        bench, AlState::preop,
        {AlStatusCode::invalid_mailbox_configuration, AlStatusCode::invalid_sync_manager_configuration});
}

void check_boot_settings(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    if (!bench.slave().boot_mailbox.present()) bench.skip("the SII describes no mailbox for BOOT");
    bench.enter(AlState::boot);
    expect_mistakes_refused(
        bench, AlState::boot,
        {AlStatusCode::invalid_boot_mailbox_configuration, AlStatusCode::invalid_mailbox_configuration,
         AlStatusCode::invalid_sync_manager_configuration});
}

void check_mailbox_overlap(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    if (!bench.has_mailbox()) bench.skip("the SII describes no mailbox");
    bench.reset();
    bench.configure_mailboxes();
    bench.give_eeprom(true);
    auto setting = bench.read_sync_manager(1);
    setting.physical_start = bench.slave().mailbox.out_start;
    bench.write_sync_manager(1, setting);
    expect_transition_refused(
        bench, AlState::init, AlState::preop,
        {AlStatusCode::invalid_mailbox_configuration, AlStatusCode::invalid_sync_manager_configuration},
        "INIT to PREOP with both mailboxes at the same address");
}

void check_process_settings(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    bench.enter(AlState::safeop);  // also finds out whether the slave needs the clock
    bench.enter(AlState::preop);
    bench.configure_process_data();
    if (bench.area(true) == nullptr && bench.area(false) == nullptr) bench.skip("the slave has no process data");
    const auto areas = bench.areas();
    for (std::size_t n = 0; n < areas.size(); ++n) {
        if (areas[n].setting.length_bytes == 0) continue;
        const bool outputs = areas[n].outputs;
        for (const auto& mistake : kProcessMistakes) {
            bench.enter(AlState::preop);
            bench.configure_process_data();
            const auto area = bench.areas()[n];
            auto setting = area.setting;
            mistake.spoil(setting);
            bench.write_sync_manager(area.sync_manager, setting);
            expect_transition_refused(
                bench, AlState::preop, AlState::safeop,
                {outputs ? AlStatusCode::invalid_output_configuration : AlStatusCode::invalid_input_configuration,
                 AlStatusCode::invalid_sync_manager_configuration, AlStatusCode::invalid_sync_manager_types},
                fmt::format("PREOP to SAFEOP with SyncManager {} ({}) {}", area.sync_manager,
                            outputs ? "outputs" : "inputs", mistake.what));
        }
    }
}

// Some masters write the control octet of the SII, others one of their own with other interrupt bits.
void check_control_bits(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    bench.enter(AlState::safeop);  // also finds out whether the slave needs the clock
    bench.enter(AlState::preop);
    bench.configure_process_data();
    if (bench.area(true) == nullptr && bench.area(false) == nullptr) bench.skip("the slave has no process data");
    for (const auto& area : bench.areas()) {
        if (area.setting.length_bytes == 0) continue;
        auto setting = area.setting;
        setting.control |= wire::sm_control::kEcatInterrupt;
        bench.write_sync_manager(area.sync_manager, setting);
    }
    const auto status = bench.go(AlState::safeop);
    if (status.state != AlState::safeop || status.error)
        bench.remark(fmt::format("with bit 4 (ECAT interrupt) of the control octets set, the slave is in {}",
                                 status_text(status)));
}

// Waits for the error that follows a change of the master.
AlStatus after_change(Bench& bench, AlState from, bool cyclic) {
    const auto changed = [&] {
        const auto status = bench.al_status();
        return status.state != from && status.error;
    };
    if (cyclic) {
        (void)bench.run(500ms, changed);
    } else {
        for (const Time until = bench.now() + 500ms; bench.now() < until && !changed();) bench.wait(1ms);
    }
    return bench.al_status();
}

void check_mailbox_off(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    if (!bench.has_mailbox()) bench.skip("the SII describes no mailbox");
    for (const auto from : {AlState::preop, AlState::safeop, AlState::op})
        for (const unsigned n : {0U, 1U}) {
            bench.enter(from);
            const auto frames = bench.frames_in(from);
            bench.write<std::uint8_t>(static_cast<std::uint16_t>(reg::sync_manager(n).address + 6), 0);
            const auto status = after_change(bench, from, from == AlState::op);
            if (status.state != AlState::init || !status.error)
                bench.fail(fmt::format("SyncManager {} was switched off in {}, and the slave is in {}", n,
                                       state_text(from), status_text(status)));
        }
}

void check_process_data_off(Session& session) {
    auto& bench = session.bench;
    needs_checks(bench);
    bench.enter(AlState::safeop);
    if (bench.area(true) == nullptr && bench.area(false) == nullptr) bench.skip("the slave has no process data");
    for (const auto from : {AlState::safeop, AlState::op})
        for (std::size_t nth = 0; nth < bench.areas().size(); ++nth) {
            bench.enter(from);
            const auto frames = bench.frames_in(from);
            const auto area = bench.areas()[nth];
            if (area.setting.length_bytes == 0) continue;
            const auto n = area.sync_manager;
            bench.write<std::uint8_t>(static_cast<std::uint16_t>(reg::sync_manager(n).address + 6), 0);
            const auto status = after_change(bench, from, from == AlState::op);
            if ((status.state != AlState::preop && status.state != AlState::init) || !status.error)
                bench.fail(fmt::format("SyncManager {} ({}) was switched off in {}, and the slave is in {}", n,
                                       area.outputs ? "outputs" : "inputs", state_text(from), status_text(status)));
        }
}

constexpr std::string_view kSettings = "ETG.1000.6, EtherCAT State Machine (check of the SyncManager settings)";

constexpr Check kSyncManagerChecks[] = {
    {"sm.mailbox_settings", "wrong SyncManagers of the mailbox are refused with 0x0016", kSettings,
     check_mailbox_settings},
    {"sm.boot_settings", "wrong SyncManagers of the mailbox for BOOT are refused with 0x0015", kSettings,
     check_boot_settings},
    {"sm.mailbox_overlap", "mailboxes that share memory are refused", kSettings, check_mailbox_overlap},
    {"sm.process_settings", "wrong SyncManagers of process data are refused with 0x001D and 0x001E", kSettings,
     check_process_settings},
    {"sm.control_bits", "interrupt bits that the master chooses are accepted", "ETG.1000.4, SyncManager channel",
     check_control_bits},
    {"sm.mailbox_off", "PREOP ends when a mailbox is switched off", "ETG.1000.6, EtherCAT State Machine (SM change)",
     check_mailbox_off},
    {"sm.process_data_off", "OP ends when a SyncManager of process data is switched off",
     "ETG.1000.6, EtherCAT State Machine (SM change)", check_process_data_off},
};

}  // namespace

std::span<const Check> sync_manager_checks() { return kSyncManagerChecks; }

}  // namespace margay::samples::conformance
