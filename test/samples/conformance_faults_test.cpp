// The checks of subdevice_check: faults of one device, made between its firmware and its ESC, are found by name.
#include "samples/conformance_faults.hpp"

#include <set>

namespace margay::samples::conformance {
namespace {

constexpr Fault kFaults[] = {
    {.check = "modules.lists",
     .what = "a PDO of an empty slot",
     .write = show_number<0xF050, 2, 0>,
     .device = "modular_io"},
    {.check = "modules.lists", .what = "too many slots", .write = show_number<0xF000, 2, 3>, .device = "modular_io"},
    {.check = "modules.lists",
     .what = "profiles of other slots",
     .write = show_number<0xF010, 0, 2>,
     .device = "modular_io"},
    {.check = "modules.match", .what = "a right list is refused", .read = take_module<0x77>, .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "another module is accepted",
     .read = take_module<0x04>,
     .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "another code",
     .write = replace_code<0x0070, 0x0001>,
     .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "only the first module is compared",
     .read = take_right_module<2, 0x208>,
     .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "the last module is not compared",
     .read = take_right_module<4, 0x401>,
     .device = "modular_io"},
    // Further SyncManagers of a direction.
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
    {.check = "process_data.inputs",
     .what = "the inputs of SyncManager 5 stay locked",
     .write =
         [](std::uint16_t address, Octets& data) {
             if (address == 0x082F) data[0] |= std::byte{wire::sm_pdi_control::kDeactivate};
             return true;
         },
     .device = "split_io"},
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
    {.check = "sync.types", .what = "every type is accepted", .write = grant<0x1C32, 1, 0x1100>, .device = "split_io"},
    {.check = "sync.types",
     .what = "a type that is announced is refused",
     .read =
         [](std::uint16_t address, MutableBytes data) {
             // An expedited download of type 2 reaches the firmware as one of type 99.
             if (address != 0x1006 || data.size() < 10 || load_le<std::uint16_t>(data, 3) != 0x1C33) return;
             if ((std::to_integer<unsigned>(data[2]) >> 5) == coe::request::kDownload && data[6] == std::byte{2})
                 data[6] = std::byte{99};
         },
     .device = "split_io"},
    {"mailbox.states", "no reply in SAFEOP and OP",
     [](std::uint16_t address, Octets& data) {
         static unsigned state = 0;
         if (address == reg::kAlStatus.address) state = std::to_integer<unsigned>(data[0]) & 0x0F;
         return state < 4 || address < 0x1400 || address >= 0x1480;
     }},
    {"mailbox.states", "the first request in OP leads to SAFEOP",
     [](std::uint16_t address, Octets& data) {
         static bool op = false;
         if (address == reg::kAlStatus.address) op = data[0] == std::byte{8};
         if (op && is_mail(address, data)) leave_op = true;
         return true;
     },
     nullptr,
     [](subdevice::EscAccess& esc) {
         if (std::exchange(leave_op, false)) set_al_status(esc, 0x14, 0x0001);
     }},
    {"sdo.read_only", "a read-only entry is written", grant<0x1018, 1>},
    {"sdo.read_only", "a write to a read-only entry gets no reply",
     [](std::uint16_t address, Octets& data) {
         return !is_mail(address, data) || data.size() < 16 || data[8] != std::byte{0x80} ||
                load_le<std::uint32_t>(data, 12) != 0x06010002;
     }},
    {"sdo.rights", "the count is written in SAFEOP and OP", grant<0x1C13, 0>},
    {"sdo.complete_download", "complete access is for uploads only", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x33)) data[2] = std::byte{0xE0};
     }},
    {"sdo.complete_download", "the last entry of a mapping is another one", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x31) && load_le<std::uint16_t>(data, 3) == 0x1600 && data.size() > 25)
             data[25] = std::byte{5};
     }},
    {"sdo.complete_objects", "another value in 0x1C00",
     [](std::uint16_t address, Octets& data) {
         if (is_whole(address, data, 0x1C00)) data[18] ^= std::byte{4};
         return true;
     }},
    {"sdo.complete_objects", "another value in 0x1C00 from subindex 1 on",
     [](std::uint16_t address, Octets& data) {
         if (is_whole(address, data, 0x1C00, 1)) data[12] ^= std::byte{4};
         return true;
     }},
    {"sdo.complete_objects", "subindex 0 of a mapping has 8 bits",
     [](std::uint16_t address, Octets& data) {
         if (!is_whole(address, data, 0x1600)) return true;
         store_le(MutableBytes(data), 0, static_cast<std::uint16_t>(load_le<std::uint16_t>(data, 0) - 1));
         store_le(MutableBytes(data), 12, load_le<std::uint32_t>(data, 12) - 1);
         data.erase(data.begin() + 17);
         data.push_back(std::byte{0});
         return true;
     }},
    {"sdo.complete_objects", "an object is refused with an abort code that says nothing",
     refuse_whole<0x1A00, 0x08000000>},
    {.check = "sdo.complete_objects",
     .what = "one of the objects is refused",
     .write = refuse_whole<0x1A00, 0x06010004>,
     .severity = kRemark},
    {.check = "sdo.complete_objects",
     .what = "the SII does not announce complete access, and one object refuses it",
     .write = refuse_whole<0x1A00, 0x06010004>,
     .prepare = hide_complete_access,
     .severity = kRemark},
    {.check = "sdo.complete_objects",
     .what = "complete access that is not announced has another value",
     .write =
         [](std::uint16_t address, Octets& data) {
             if (is_whole(address, data, 0x1C00)) data[18] ^= std::byte{4};
             return true;
         },
     .prepare = hide_complete_access},
    {"segments.download", "the toggle bit of a download is read the wrong way", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         const bool segment = address == 0x1006 && data.size() >= 10 &&
                              coe::load_header(data).service == coe::Service::sdo_request &&
                              (std::to_integer<unsigned>(data[2]) & 0xE1) == 0x01;
         if (segment) data[2] ^= std::byte{0x10};
     }},
    {"segments.toggle", "only the first toggle bit is compared", count_segments, read_right_toggle},
    {"segments.download", "the toggle bit of a response is always 0",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_response) && data[8] == std::byte{0x30})
             data[8] = std::byte{0x20};
         return true;
     }},
    {"segments.download", "the last of many segments is stored wrongly", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static bool many = false;
         if (!is_download_segment(address, data)) return;
         if (many && (data[2] & std::byte{1}) != std::byte{0}) data[3] ^= std::byte{1};
         many = (data[2] & std::byte{1}) == std::byte{0};
     }},
    {"segments.download_toggle", "only the first toggle bit of a download is compared", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static unsigned segments = 0;
         if (is_request(address, data, 0x21)) segments = 0;
         if (!is_download_segment(address, data)) return;
         constexpr std::byte kToggle{0x10};
         if (segments > 0) data[2] = (data[2] & ~kToggle) | (segments % 2 != 0 ? kToggle : std::byte{0});
         ++segments;
     }},
    {"segments.download_abort", "an abort in a download is taken as the next segment", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x80)) data[2] = std::byte{0x10};
     }},
    {"segments.download_length", "fewer octets are announced than come", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x21) && load_le<std::uint32_t>(data, 6) == 1023)
             store_le(data, 6, std::uint32_t{1024});
     }},
    {"segments.download_toggle", "another abort code", replace_abort<0x05030000, 0x08000000>},
    {.check = "sm.boot_settings",
     .what = "another code",
     .write = replace_code<0x0015, 0x0001>,
     .device = "bootloader"},
    {.check = "sm.boot_settings",
     .what = "SyncManager 1 is not checked",
     .read = read_right_sync_manager<1, 0x1400, 512, 0x22>,
     .device = "bootloader"},
    {"information.subindices", "subindex 0 is higher than the description says",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::object_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1018)
             data[16] = std::byte{3};
         return true;
     }},
    {"messages.headers", "the channel is 1",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data)) data[4] |= std::byte{1};
         return true;
     }},
    {"messages.headers", "the number of CoE is 1",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && (std::to_integer<unsigned>(data[5]) & 0x0F) == 3) data[6] |= std::byte{1};
         return true;
     }},
    {"messages.headers", "bit 7 of the octet with the counter is 1",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data)) data[5] |= std::byte{0x80};
         return true;
     }},
    {"messages.headers", "an abort is an SDO response",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_request)) data[7] = std::byte{0x30};
         return true;
     }},
    {"messages.headers", "complete access is not confirmed",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_response) && (data[8] & std::byte{0xF0}) == std::byte{0x50})
             data[8] &= std::byte{0xEF};
         return true;
     }},
    {"messages.headers", "each upload is one of complete access",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_response) && (data[8] & std::byte{0xF0}) == std::byte{0x40})
             data[8] |= std::byte{0x10};
         return true;
     }},
    {"information.lists", "another list is named",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::list_response)) data[12] = std::byte{0};
         return true;
     }},
    {"information.entries", "another object is described",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::object_response)) data[13] = std::byte{0x77};
         return true;
     }},
    {"information.entries", "the data type has another size",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1000)
             data[16] = std::byte{3};
         return true;
     }},
    {"pdos.mapping", "the count is acknowledged and not written", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         // An expedited download of 0x1600:00 reaches the firmware as one of its own value.
         if (!is_request(address, data, 0x2F) || load_le<std::uint16_t>(data, 3) != 0x1600 || data[5] != std::byte{0})
             return;
         data[2] = std::byte{0x40};
     }},
    {.check = "sync.types",
     .what = "a type is acknowledged and not written",
     .write = [](std::uint16_t address, Octets& data) { return show_number<0x1C32, 1, 5>(address, data); },
     .device = "split_io"},
    {"states.up", "a reserved bit of the AL status is 1",
     [](std::uint16_t address, Octets& data) {
         if (address == reg::kAlStatus.address) data[0] |= std::byte{0x80};
         return true;
     }},
    {.check = "mailbox.type",
     .what = "the SII announces FoE",
     .prepare = [](sim::Device& device) { device.sii[0x1C * 2] |= std::byte{mailbox_protocol::kFoE}; }},
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
         [](sim::Device& device) {
             device.sii[category_at(device, wire::sii::category::kSyncManager) + 22] = {};
         },
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
    {"clock.cycle_zero", "another code", replace_code<0x0036, 0x0001>},
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
    {"sdo.write_only", "a write-only entry is read",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1000)
             data[20] = std::byte{0x38};
         return true;
     }},
    {"segments.client_abort", "an abort is answered", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x80)) data[2] = std::byte{0x60};
     }},
    {"segments.new_request", "a new request ends the transfer without a reply", note_segments,
     [](std::uint16_t address, MutableBytes data) {
         if (!in_segments || !is_request(address, data, 0x40) || load_le<std::uint16_t>(data, 3) != 0x1000) return;
         data[2] = std::byte{0x80};
         in_segments = false;
     }},
    {"pdos.assignment", "a value is written while the count is not 0", grant<0x1C12, 1>},
    {"pdos.unknown", "a PDO that does not exist", grant<0x1C12, 1>},
    {"pdos.locked", "the count of the assignment is written in SAFEOP", grant<0x1C12, 0>},
    {"pdos.locked", "the count of the mapping is written in OP",
     [](std::uint16_t address, Octets& data) {
         static bool op = false;
         if (address == reg::kAlStatus.address) op = data[0] == std::byte{8};
         return !op || grant<0x1600, 0>(address, data);
     }},
    {"messages.lengths", "the length is one octet too long",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && load_le<std::uint16_t>(data, 0) == coe::kSdoBytes)
             store_le(MutableBytes(data), 0, std::uint16_t{coe::kSdoBytes + 1});
         return true;
     }},
    {.check = "clock.cycle_short",
     .what = "SYNC0 is not compared with the shortest cycle",
     .write = show_number<0x1C32, 5, 100'000>,
     .severity = kRemark,
     .device = "split_io"},
    {"mailbox.octets", "the reply to a message of the size of the mailbox is empty",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && full_message) store_le<std::uint16_t>(data, 0, 0);
         return true;
     },
     [](std::uint16_t address, MutableBytes data) {
         if (address == 0x1000 && data.size() >= 6) full_message = load_le<std::uint16_t>(data, 0) == 128 - 6;
     }},
    {"mailbox.full", "every fourth reply has another type",
     [](std::uint16_t address, Octets& data) {
         static unsigned count = 0;
         if (is_mail(address, data) && ++count % 4 == 0) data[5] |= std::byte{0x0F};
         return true;
     }},
    {.check = "mailbox.channel",
     .what = "the channel is not checked",
     .read =
         [](std::uint16_t address, MutableBytes data) {
             if (address == 0x1000 && data.size() >= 6) data[4] &= std::byte{0xC0};
         },
     .severity = kRemark},
    {.check = "clock.rate",
     .what = "the quartz is a tenth too fast",
     .prepare = [](sim::Device& device) { device.chip.clock.drift_ppb = 100'000'000; }},
    {"clock.lost", "another code", replace_code<0x002C, 0x0001>},
    {.check = "eeprom.ownership",
     .what = "the slave reports an error while the master has the EEPROM",
     .step =
         [](subdevice::EscAccess& esc) {
             std::array<std::byte, 1> owner{};
             esc.read(reg::kSiiConfig.address, owner);
             if ((owner[0] & std::byte{1}) == std::byte{0} && al_status_of(esc) == 2) set_al_status(esc, 0x12, 0x0050);
         }},
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
    {"mailbox.duplicate", "each message looks new", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static unsigned count = 0;
         if (address == 0x1000 && data.size() >= 6)
             data[5] = (data[5] & std::byte{0x8F}) | static_cast<std::byte>((++count % 7 + 1) << 4);
     }},
    {"mailbox.repeat", "a repeat is never acknowledged",
     [](std::uint16_t address, Octets& data) {
         if (address == 0x080F) data[0] &= ~std::byte{wire::sm_pdi_control::kRepeatAcknowledge};
         return true;
     }},
    {"mailbox.type", "another detail", replace_error_detail},
    {"mailbox.length", "another detail", replace_error_detail},
    {"messages.counters", "the counter runs from 1 to 6",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && (std::to_integer<unsigned>(data[5]) >> 4) == 7) data[5] &= std::byte{0x1F};
         return true;
     }},
    {"information.identity", "another product code",
     [](std::uint16_t address, Octets& data) {
         if (is_upload(address, data, 0x1018, 2)) data[12] ^= std::byte{1};
         return true;
     }},
    {"information.lists", "a wrong length",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::list_response) && data[12] == std::byte{0})
             data[14] ^= std::byte{1};
         return true;
     }},
    {"information.entries", "another number of bits",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1000)
             data[18] ^= std::byte{8};
         return true;
     }},
    {"information.errors", "another abort code", replace_abort<0x06020000, 0x08000000>},
    {"sdo.aborts", "another abort code", replace_abort<0x06010002, 0x08000000>},
    {"sdo.aborts", "another abort code for a subindex", replace_abort<0x06090011, 0x08000000>},
    {"sdo.write", "wrong lengths have another abort code", replace_abort<0x06070012, 0x08000000>},
    {"segments.toggle", "another abort code", replace_abort<0x05030000, 0x08000000>},
    {"segments.without_begin", "another abort code", replace_abort<0x05040001, 0x08000000>},
    {"pdos.mapped", "an entry is not mappable",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x7000)
             data[20] &= ~std::byte{0x40};
         return true;
     }},
    {"watchdog.expires", "another code", replace_code<0x001B, 0x001A>},
    {"watchdog.expires", "the expired watchdog is not seen", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         read_bits<0x0220, 0, 0x40>(address, data);
         read_bits<0x0440, 1>(address, data);
     }},
    {"process_data.outputs", "outputs always look written", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         read_bits<0x0440, 1>(address, data);
         read_bits<0x0221, 0x04>(address, data);
         read_bits<0x0220, 0, 0x40>(address, data);
     }},
    {"clock.sync0", "SYNC0 is not supported", nullptr,
     [](std::uint16_t address, MutableBytes data) { read_bits<0x0981, 0x01, 0x02>(address, data); }},
    {"clock.cycle_zero", "the cycle time is not checked", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (address == 0x09A0 && load_le<std::uint32_t>(data, 0) == 0) store_le<std::uint32_t>(data, 0, 1'000'000'000);
         read_bits<0x0220, 0x04>(address, data);
     }},
};

TEST(SubdeviceCheck, FaultsBetweenFirmwareAndEscAreFoundByName) {
    for (const auto& fault : kFaults) {
        auto device = sim::make_device(fault.device).value();
        if (fault.prepare != nullptr) fault.prepare(device);
        device.firmware = std::make_unique<FaultyFirmware>(std::move(device.firmware), fault);
        const auto checked = check_it(std::move(device), {.only = only(fault.check)});
        EXPECT_TRUE(has(checked.report, fault.check, fault.severity)) << fault.check << ": " << fault.what << "\n"
                                                                      << report_text(checked.report, true);
    }
}

TEST(SubdeviceCheck, ADeviceThatNeedsSync1PassesTheChecksOfTheClock) {
    static constexpr Fault kNeedsSync1{
        .check = "clock", .what = "needs SYNC1", .read = need_sync1, .prepare = announce_sync1};
    auto device = sim::make_device("odd_device").value();
    announce_sync1(device);
    device.firmware = std::make_unique<FaultyFirmware>(std::move(device.firmware), kNeedsSync1);
    const auto checked = check_it(std::move(device), {.only = "clock."});
    for (const auto& check : checked.report.checks)
        EXPECT_TRUE(check.findings.empty()) << check.name << "\n" << report_text(checked.report, true);
    const auto* const sync1 = find(checked.report, "clock.sync1");
    ASSERT_NE(sync1, nullptr);
    EXPECT_EQ(sync1->outcome, Outcome::passed) << sync1->reason;
}

std::string text_of(std::string_view device_name, const Fault& fault, std::string_view only_checks) {
    auto device = sim::make_device(device_name).value();
    device.firmware = std::make_unique<FaultyFirmware>(std::move(device.firmware), fault);
    return report_text(check_it(std::move(device), {.only = std::string(only_checks)}).report, true);
}

// A message that is no reply to the request is the cause, and not the lack of a reply.
TEST(SubdeviceCheck, AReplyThatIsNotTakenIsNamed) {
    static constexpr Fault kOtherSubindex{.check = "sdo",
                                          .what = "downloads are answered with subindex 9",
                                          .write = [](std::uint16_t address, Octets& data) {
                                              if (is_service(address, data, coe::Service::sdo_response) &&
                                                  data.size() >= 16 && data[8] == std::byte{0x60})
                                                  data[11] = std::byte{9};
                                              return true;
                                          }};
    const auto text = text_of("odd_device", kOtherSubindex, "sdo.write");
    EXPECT_NE(text.find("got no valid reply, but a message of protocol CoE"), std::string::npos) << text;
    static constexpr Fault kOtherStation{
        .check = "sdo", .what = "the address is 0x1234", .write = [](std::uint16_t address, Octets& data) {
            if (is_mail(address, data)) store_le<std::uint16_t>(data, 2, 0x1234);
            return true;
        }};
    const auto other = text_of("odd_device", kOtherStation, "mailbox.answers");
    EXPECT_NE(other.find("with the address 0x1234"), std::string::npos) << other;
}

// The SII announces VoE alone: the check has no message of a protocol that the slave has.
TEST(SubdeviceCheck, ASlaveWithoutCoEMayRefuseTheProtocolBeforeTheLength) {
    auto device = sim::make_device("odd_device").value();
    constexpr std::size_t kProtocols = 0x1C * 2;
    store_le<std::uint16_t>(device.sii, kProtocols, mailbox_protocol::kVoE);
    const auto report = check_it(std::move(device), {.only = "mailbox.length"}).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    EXPECT_EQ(find(report, "mailbox.length")->outcome, Outcome::passed);
}

// A check that nothing makes fail proves nothing.
TEST(SubdeviceCheck, EveryCheckHasAFaultThatItFinds) {
    std::set<std::string_view> found;
    for (const auto& row : kQuirks) found.insert(row.check);
    for (const auto& fault : kFaults) found.insert(fault.check);
    std::set<std::string> without;
    for (const auto& check : all_checks())
        if (!found.contains(check.name)) without.emplace(check.name);
    EXPECT_EQ(without, std::set<std::string>{});
}

}  // namespace
}  // namespace margay::samples::conformance
