// Common parts of the tests of subdevice_check: a check of one simulated device, and the quirks that each check finds.
#pragma once

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/library/quirks.hpp"
#include "subdevice_check/check.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <algorithm>

namespace margay::samples::conformance {

inline Checked check_it(sim::Device device, const Options& options = {}) {
    sim::Segment segment;
    VirtualOsal osal;
    segment.add(std::move(device).assemble());
    EXPECT_TRUE(segment.connect_master({0, 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx{Limits{.slaves = 4}};
    EXPECT_TRUE(init(ctx, nic, osal).ok());
    return check_device(ctx, osal, nic.wait_handle(), 1, options);
}

inline const CheckResult* find(const Report& report, std::string_view name) {
    const auto found = std::ranges::find_if(report.checks, [&](const CheckResult& c) { return c.name == name; });
    return found == report.checks.end() ? nullptr : &*found;
}

inline bool has(const Report& report, std::string_view name, Severity severity) {
    const auto* const check = find(report, name);
    return check != nullptr &&
           std::ranges::any_of(check->findings, [&](const Finding& f) { return f.severity == severity; });
}

// The check that finds a quirk, and the text that it reports. Without a check: the quirk breaks no rule, and `reason`
// explains this.
struct QuirkRow {
    std::string_view quirk;
    std::string_view check;
    Severity severity = Severity::error;
    std::string_view no_rule = {};
};

inline constexpr auto kRemark = Severity::remark;
inline constexpr QuirkRow kQuirks[] = {
    {"sii_blank", "eeprom.content"},
    {"sii_bad_checksum", "eeprom.content"},
    {"sii_bad_checksum", "eeprom.loaded"},
    {"sii_no_mailbox_sizes", "eeprom.content"},
    {"sii_no_pdos", "eeprom.process_data", kRemark},
    {"sii_null_strings", "eeprom.strings"},
    {"sii_endless", "eeprom.content"},
    {"sii_no_watchdog_trigger", "watchdog.enabled", kRemark},
    {"sii_sync_managers_off", "eeprom.process_data", kRemark},
    {"sii_4_bytes", "", {}, "an ESC reads 4 or 8 octets, 0x0502 bit 6 says which"},
    {"sii_slow", "eeprom.read", kRemark},
    {"sii_busy_until_stored", "", {}, "an ESC may be busy until a word is stored"},
    {"sii_write_protected", "eeprom.write"},
    {"sii_nacks", "", {}, "an EEPROM may be busy after power-up; the scan has waited for it"},
    {"no_lrw", "eeprom.chip"},
    {"clock_32_bits", "", {}, "0x0008 bit 3 says how wide the clock is"},
    {"receive_times_only", "clock.registers"},
    {"no_clock", "clock.registers"},
    {"slow_firmware", "", {}, "5 ms are less than every time of the standard"},
    {"ignores_acknowledge", "states.acknowledge"},
    {"needs_eeprom", "states.eeprom_kept", kRemark},
    {"strict_sync_managers", "sm.control_bits", kRemark},
    {"slow_state_changes", "states.up", kRemark},
    {"refuses_op_once", "states.up"},
    {"no_cycle1", "clock.cycle1", kRemark},
    {"old_mail", "mailbox.empty"},
    {"old_mail", "mailbox.forgotten"},
    {"counter_zero", "messages.counters"},
    {"replies_twice", "mailbox.one_reply"},
    {"emergency_first", "messages.emergencies"},
    {"ethernet_first", "messages.unasked"},
    {"mail_for_others", "messages.unasked"},
    {"mailbox_full", "mailbox.taken", kRemark},
    {"slow_replies", "messages.times", kRemark},
    {"never_replies", "mailbox.answers"},
    {"error_replies", "mailbox.answers"},
    {"overlong_replies", "messages.lengths"},
    {"empty_replies", "messages.lengths"},
    {"short_replies", "messages.lengths"},
    {"foreign_replies", "messages.unasked"},
    {"empty_repeats", "mailbox.repeat"},
    {"refuses_complete_access", "sdo.complete_access"},
    {"unpadded_complete_access", "sdo.complete_access"},
    {"no_size_indicated", "sdo.upload"},
    {"never_expedited", "sdo.upload", kRemark},
    {"segments_only", "sdo.upload", kRemark},
    {"small_segments", "sdo.upload", kRemark},
    {"empty_segments", "messages.lengths"},
    {"aborts_midway", "segments.upload"},
    {"toggle_stuck", "segments.upload"},
    {"no_assignment", "pdos.objects"},
    {"few_mapping_entries", "pdos.mapping", kRemark},
    {"coe_disagrees", "pdos.sii"},
    {"other_pdos", "", {}, "one device alone is consistent"},
    {"sii_mailbox_1487", "eeprom.content"},
    {"sii_mailbox_large", "eeprom.content"},
    {"sii_mailbox_in_large", "eeprom.content"},
};

// The checks for one row. The checks of messages need messages.
inline std::string only(std::string_view check) {
    std::string names(check);
    if (check.starts_with("messages.")) names += ",mailbox.answers,mailbox.one_reply,segments.upload";
    if (check == "messages.headers") names += ",sdo.aborts,sdo.complete_access";
    return names;
}

}  // namespace margay::samples::conformance
