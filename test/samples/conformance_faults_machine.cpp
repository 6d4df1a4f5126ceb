// Faults of the state machine, the SyncManagers, the watchdog, the clocks and the EEPROM, which subdevice_check finds.
#include "samples/conformance_faults.hpp"

namespace margay::samples::conformance {
namespace {

constexpr Fault kMachineFaults[] = {
    {.check = "sm.process_settings",
     .what = "SyncManager 4 is not checked",
     .read = read_right_sync_manager<4, 0x1400, 4, 0x64>,
     .device = "split_io"},
    {.check = "sm.process_settings",
     .what = "SyncManager 5 is not checked",
     .read = read_right_sync_manager<5, 0x1500, 4, 0x20>,
     .device = "split_io"},
    {.check = "sm.process_data_off",
     .what = "SyncManager 4 always looks switched on",
     .read = read_bits<0x0826, 1>,
     .device = "split_io"},
    {.check = "sm.process_data_off",
     .what = "SyncManager 5 always looks switched on",
     .read = read_bits<0x082E, 1>,
     .device = "split_io"},
    {.check = "sm.boot_settings",
     .what = "another code",
     .write = replace_code<0x0015, 0x0001>,
     .device = "bootloader"},
    {.check = "sm.boot_settings",
     .what = "SyncManager 1 is not checked",
     .read = read_right_sync_manager<1, 0x1400, 512, 0x22>,
     .device = "bootloader"},
    {"sm.mailbox_settings", "another code", replace_code<0x0016, 0x0001>},
    {"sm.mailbox_settings", "SyncManager 0 is not checked", nullptr, read_right_sync_manager<0, 0x1000, 128, 0x26>},
    {"sm.mailbox_overlap", "SyncManager 1 is not checked", nullptr, read_right_sync_manager<1, 0x1400, 128, 0x22>},
    {"sm.process_settings", "another code for outputs", replace_code<0x001D, 0x0001>},
    {"sm.process_settings", "SyncManager 3 is not checked", nullptr, read_right_sync_manager<3, 0x1A00, 8, 0x20>},
    {"sm.process_settings", "the start of SyncManager 2 is not checked", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (address == reg::sync_manager(2).address && data.size() >= 8) store_le<std::uint16_t>(data, 0, 0x1800);
     }},
    {"sm.mailbox_off", "SyncManager 0 always looks switched on", nullptr, read_bits<0x0806, 1>},
    {"sm.mailbox_off", "SyncManager 0 always looks switched on in OP", note_status,
     [](std::uint16_t address, MutableBytes data) {
         if (al_status_now == std::byte{8}) read_bits<0x0806, 1>(address, data);
     }},
    {"sm.process_data_off", "SyncManager 2 always looks switched on in SAFEOP", note_status,
     [](std::uint16_t address, MutableBytes data) {
         if (al_status_now == std::byte{4}) read_bits<0x0816, 1>(address, data);
     }},
    {"sm.process_data_off", "SyncManager 2 always looks switched on", nullptr, read_bits<0x0816, 1>},
    {.check = "process_data.inputs",
     .what = "the inputs of SyncManager 5 stay locked",
     .write =
         [](std::uint16_t address, Octets& data) {
             if (address == 0x082F) data[0] |= std::byte{wire::sm_pdi_control::kDeactivate};
             return true;
         },
     .device = "split_io"},
    {.check = "process_data.exchange",
     .what = "OP ends after 50 ms",
     .step =
         [](subdevice::EscAccess& esc) {
             static unsigned steps = 0;
             if (al_status_of(esc) == 8 && ++steps > 50) set_al_status(esc, 0x14, 0x0001);
         }},
    {"process_data.inputs", "the inputs stay locked",
     [](std::uint16_t address, Octets& data) {
         if (address == 0x081F) data[0] |= std::byte{wire::sm_pdi_control::kDeactivate};
         return true;
     }},
    {"process_data.outputs", "outputs always look written", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         read_bits<0x0440, 1>(address, data);
         read_bits<0x0221, 0x04>(address, data);
         read_bits<0x0220, 0, 0x40>(address, data);
     }},
    {"clock.lost", "a SYNC0 of long ago leads to OP again", note_any_error, read_sync0_after_error},
    {"clock.lost", "OP is refused again with another code", replace_code<0x002D, 0x0001>},
    {.check = "clock.sync1",
     .what = "the SII announces a SYNC1 that the device does not need",
     .prepare = announce_sync1,
     .severity = kRemark},
    {.check = "clock.sync1",
     .what = "a missing SYNC1 has another code",
     .write = replace_code<0x0030, 0x0035>,
     .read = need_sync1,
     .prepare = announce_sync1},
    {"clock.cycle_zero", "another code", replace_code<0x0036, 0x0001>},
    {.check = "clock.cycle_short",
     .what = "SYNC0 is not compared with the shortest cycle",
     .write = show_number<0x1C32, 5, 100'000>,
     .severity = kRemark,
     .device = "split_io"},
    {.check = "clock.rate",
     .what = "the quartz is a tenth too fast",
     .prepare = [](sim::Device& device) { device.chip.clock.drift_ppb = 100'000'000; }},
    {"clock.lost", "another code", replace_code<0x002C, 0x0001>},
    {"clock.sync0", "SYNC0 is not supported", nullptr,
     [](std::uint16_t address, MutableBytes data) { read_bits<0x0981, 0x01, 0x02>(address, data); }},
    {"clock.cycle_zero", "the cycle time is not checked", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (address == 0x09A0 && load_le<std::uint32_t>(data, 0) == 0) store_le<std::uint32_t>(data, 0, 1'000'000'000);
         read_bits<0x0220, 0x04>(address, data);
     }},
    {"states.up", "a reserved bit of the AL status is 1",
     [](std::uint16_t address, Octets& data) {
         if (address == reg::kAlStatus.address) data[0] |= std::byte{0x80};
         return true;
     }},
    {"states.restart", "only the first start works",
     [](std::uint16_t address, Octets& data) {
         static unsigned starts = 0;
         if (address == reg::kAlStatus.address && data[0] == std::byte{2} && ++starts > 2) data[0] = std::byte{0x11};
         return true;
     }},
    {.check = "states.device_id",
     .what = "the SII announces an ID that the device does not have",
     .prepare =
         [](sim::Device& device) {
             const auto general = wire::sii::find_category(device.sii, wire::sii::category::kGeneral);
             ASSERT_TRUE(general);
             const auto at = static_cast<std::size_t>(general->data() - device.sii.data()) + 11;
             device.sii[at] |= std::byte{wire::sii::general_flag::kIdentAlStatus};
         }},
    {"states.up", "OP has a code",
     [](std::uint16_t address, Octets& data) {
         if (address == reg::kAlStatusCode.address) data[0] |= std::byte{1};
         return true;
     }},
    {"states.up", "SAFEOP is never reached",
     [](std::uint16_t address, Octets& data) {
         if (address == reg::kAlStatus.address && data[0] == std::byte{4}) data[0] = std::byte{2};
         return true;
     }},
    {"states.down", "SAFEOP is shown as OP",
     [](std::uint16_t address, Octets& data) {
         static bool op = false;
         if (address != reg::kAlStatus.address) return true;
         const bool down = op && data[0] == std::byte{4};
         op = data[0] == std::byte{8};
         return !down;
     }},
    {"states.same", "a request for the same state is an error",
     [](std::uint16_t address, Octets& data) {
         static std::byte last{};
         if (address != reg::kAlStatus.address) return true;
         if (data[0] == last && last == std::byte{2}) data[0] |= std::byte{0x10};
         last = data[0];
         return true;
     }},
    {"states.up_again", "SAFEOP is reached once between two INIT", note_up,
     [](std::uint16_t address, MutableBytes data) {
         if (address == reg::kAlControl.address && was_up && data[0] == std::byte{4}) data[0] = std::byte{2};
     }},
    {"states.acknowledge", "an error stays in SAFEOP", note_status, read_request<0x14, 0x14, 0x04>},
    {"states.acknowledge", "an error stays in OP", note_status, read_request<0x18, 0x18, 0x08>},
    {"states.same", "a request for OP in OP leads to SAFEOP", note_status, read_request<8, 8, 4>},
    {"states.skipped", "another code", replace_code<0x0011, 0x0001>},
    {"states.skipped", "no error indication", no_error_bit},
    {"states.unknown", "another code", replace_code<0x0012, 0x0011>},
    {"states.unknown", "a state that does not exist leads from OP to SAFEOP", note_status, read_request<8, 5, 4>},
    {.check = "states.unknown",
     .what = "a state that does not exist leads from BOOT to INIT",
     .write = note_status,
     .read = read_request<3, 7, 1>,
     .device = "bootloader"},
    {"states.boot", "another code", replace_code<0x0013, 0x0001>},
    {"states.acknowledge", "the code stays",
     [](std::uint16_t address, Octets& data) {
         return address != reg::kAlStatusCode.address || load_le<std::uint16_t>(data, 0) != 0;
     }},
    {"states.error_stays", "every request acknowledges", nullptr, read_bits<0x0120, 0x10>},
    {"states.error_stays", "a request for OP acknowledges in SAFEOP", note_status, read_request<0x14, 0x08, 0x18>},
    {"states.init_clears", "an error stays in PREOP", note_status, read_request<0x12, 0x11, 0x02>},
    {.check = "eeprom.agrees",
     .what = "SyncManager 1 has another length",
     .prepare =
         [](sim::Device& device) {
             device.sii[category_at(device, wire::sii::category::kSyncManager) + 10] ^= std::byte{4};
         }},
    {.check = "eeprom.agrees",
     .what = "no FMMU is for inputs",
     .prepare =
         [](sim::Device& device) {
             const auto at = category_at(device, wire::sii::category::kFmmu);
             device.sii[at] = device.sii[at + 1] = std::byte{1};
         }},
    {.check = "eeprom.agrees",
     .what = "SyncManager 2 is switched off",
     .prepare =
         [](sim::Device& device) { device.sii[category_at(device, wire::sii::category::kSyncManager) + 22] = {}; },
     .severity = kRemark},
    {.check = "eeprom.agrees",
     .what = "CoE without SDO",
     .prepare =
         [](sim::Device& device) {
             device.sii[category_at(device, wire::sii::category::kGeneral) + 5] &= std::byte{0xFE};
         }},
    {.check = "eeprom.agrees",
     .what = "another version",
     .prepare = [](sim::Device& device) { device.sii[0x3F * 2] = std::byte{7}; },
     .severity = kRemark},
    {.check = "eeprom.ownership",
     .what = "the slave reports an error while the master has the EEPROM",
     .step =
         [](subdevice::EscAccess& esc) {
             std::array<std::byte, 1> owner{};
             esc.read(reg::kSiiConfig.address, owner);
             if ((owner[0] & std::byte{1}) == std::byte{0} && al_status_of(esc) == 2) set_al_status(esc, 0x12, 0x0050);
         }},
    {"watchdog.time", "the time is taken as too long", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static bool longer = false;
         if (address == reg::kProcessDataWatchdogTime.address) longer = load_le<std::uint16_t>(data, 0) > 1000;
         if (longer) read_bits<0x0440, 0, 1>(address, data);
     }},
    {"watchdog.off", "a time of 0 counts as expired", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static bool off = false;
         if (address == reg::kProcessDataWatchdogTime.address) {
             off = load_le<std::uint16_t>(data, 0) == 0;
             if (off) store_le<std::uint16_t>(data, 0, 1000);
         }
         if (off) read_bits<0x0440, 0, 1>(address, data);
     }},
    {"watchdog.expires", "another code", replace_code<0x001B, 0x001A>},
    {"watchdog.expires", "the expired watchdog is not seen", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         read_bits<0x0220, 0, 0x40>(address, data);
         read_bits<0x0440, 1>(address, data);
     }},
};

}  // namespace

std::span<const Fault> machine_faults() { return kMachineFaults; }

}  // namespace margay::samples::conformance
