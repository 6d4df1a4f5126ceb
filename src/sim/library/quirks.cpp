#include "sim/library/quirks.hpp"

#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>
#include <optional>

namespace margay::sim {

namespace {

namespace sii = wire::sii;

// --- SII images ---

constexpr std::size_t kFirstCategory = 0x40 * 2;

struct Category {
    std::size_t head = 0;  // type and length, one word each
    std::size_t data = 0;
    std::size_t bytes = 0;
};

// Iterates over the categories of an image that Margay has created.
template <class F>
void for_each_category(std::vector<std::byte>& image, F f) {
    for (std::size_t at = kFirstCategory; at + 4 <= image.size();) {
        const auto type = load_le<std::uint16_t>(image, at);
        const std::size_t bytes = std::size_t{load_le<std::uint16_t>(image, at + 2)} * 2;
        if (type == 0xFFFF || at + 4 + bytes > image.size()) return;
        f(type, Category{at, at + 4, bytes});
        at += 4 + bytes;
    }
}

constexpr std::uint16_t kStrings = 10;
constexpr std::uint16_t kSyncManagers = 41;
constexpr std::uint16_t kTxPdos = 50;
constexpr std::uint16_t kRxPdos = 51;
constexpr std::uint16_t kVendors = 0x0801;  // a vendor-specific category that no other software reads

bool blank(Device& device) {
    std::fill(device.sii.begin(), device.sii.end(), std::byte{0xFF});
    return true;
}
bool bad_checksum(Device& device) {
    if (device.sii.size() < 16) return false;
    device.sii[14] ^= std::byte{0x55};
    return true;
}
bool no_mailbox_sizes(Device& device) {
    if (device.sii.size() < kFirstCategory) return false;
    std::fill_n(device.sii.begin() + 0x14 * 2, 16, std::byte{0});  // boot and standard mailboxes; the protocols stay
    return true;
}
// Sizes of the mailboxes, in the words of the SII; 0: unchanged. From then on the device uses the generic program for
// its SII, because its own program would refuse such mailboxes.
bool set_mailbox_sizes(Device& device, std::uint16_t out_bytes, std::uint16_t in_bytes) {
    if (device.sii.size() < kFirstCategory) return false;
    auto at = MutableBytes(device.sii).subspan(sii::word::kBootMailbox * sii::kWordBytes, sii::kMailboxesBytes);
    auto boxes = sii::load_mailboxes(at);
    if (boxes.standard.out_bytes == 0 || boxes.standard.in_bytes == 0) return false;
    if (out_bytes != 0) boxes.standard.out_bytes = out_bytes;
    if (in_bytes != 0) boxes.standard.in_bytes = in_bytes;
    // The mailboxes follow each other, because a master would refuse overlapping mailboxes for this reason.
    boxes.standard.in_start = static_cast<std::uint16_t>(boxes.standard.out_start + boxes.standard.out_bytes);
    sii::store_mailboxes(at, boxes);
    device.firmware = device_from_sii(device.sii).firmware;
    return true;
}
bool mailbox_1487(Device& device) { return set_mailbox_sizes(device, 1487, 1487); }
bool mailbox_large(Device& device) { return set_mailbox_sizes(device, 4096, 4096); }
bool mailbox_in_large(Device& device) { return set_mailbox_sizes(device, 0, 1500); }
bool no_pdos(Device& device) {
    for_each_category(device.sii, [&](unsigned type, const Category& c) {
        if (type == kTxPdos || type == kRxPdos) store_le<std::uint16_t>(device.sii, c.head, kVendors);
    });
    return true;
}
bool null_strings(Device& device) {
    for_each_category(device.sii, [&](unsigned type, const Category& c) {
        if (type != kStrings) return;
        auto at = c.data + 1;
        const auto end = c.data + c.bytes;
        for (auto left = std::to_integer<unsigned>(device.sii[c.data]); left > 0 && at < end; --left) {
            const auto length = std::min<std::size_t>(std::to_integer<std::size_t>(device.sii[at]), end - at - 1);
            std::fill_n(device.sii.begin() + static_cast<std::ptrdiff_t>(at + 1), length, std::byte{0});
            at += 1 + length;
        }
    });
    return true;
}
bool endless(Device& device) {
    std::optional<Category> last;
    for_each_category(device.sii, [&](unsigned, const Category& c) { last = c; });
    if (!last) return false;
    store_le<std::uint16_t>(device.sii, last->head + 2, 0x7FFF);
    return true;
}
template <class F>
bool change_sync_managers(Device& device, F change) {
    for_each_category(device.sii, [&](unsigned type, const Category& c) {
        for (std::size_t at = c.data; type == kSyncManagers && at + 8 <= c.data + c.bytes; at += 8)
            change(MutableBytes(device.sii).subspan(at, 8));
    });
    return true;
}
bool no_watchdog_trigger(Device& device) {
    return change_sync_managers(device, [](MutableBytes sm) { sm[4] &= ~std::byte{0x40}; });
}
bool sync_managers_off(Device& device) {
    return change_sync_managers(device, [](MutableBytes sm) {
        if (std::to_integer<unsigned>(sm[7]) < 3) return;  // only process data
        store_le<std::uint16_t>(sm, 2, 0);
        sm[6] = std::byte{0};
    });
}

// --- Chips ---

bool reads_4_bytes(Device& device) {
    device.chip.sii.reads_8_bytes = false;
    return true;
}
bool slow_eeprom(Device& device) {
    device.chip.sii.read = std::chrono::milliseconds(3);
    device.chip.sii.write = std::chrono::milliseconds(10);
    return true;
}
bool busy_until_stored(Device& device) {
    device.chip.sii.write_busy = Duration::max();
    return true;
}
bool eeprom_nacks(Device& device) {
    device.chip.sii.nacks = 2;
    return true;
}
bool eeprom_write_protected(Device& device) {
    device.chip.sii.write_protected = true;
    return true;
}
bool no_lrw(Device& device) {
    device.chip.features |= wire::features::kLrwNotSupported;
    return true;
}
bool set_clock(Device& device, DcUnit unit) {
    namespace f = wire::features;
    device.chip.dc = unit;
    device.chip.dc_needs_enable = false;
    device.chip.features =
        static_cast<std::uint16_t>((device.chip.features & ~(f::kDistributedClocks | f::kDistributedClocks64Bit)) |
                                   (unit >= DcUnit::bits32 ? f::kDistributedClocks : 0) |
                                   (unit == DcUnit::bits64 ? f::kDistributedClocks64Bit : 0));
    return true;
}
bool clock_32_bits(Device& device) { return set_clock(device, DcUnit::bits32); }
bool receive_times_only(Device& device) { return set_clock(device, DcUnit::receive_times); }
bool no_clock(Device& device) { return set_clock(device, DcUnit::none); }
bool slow_firmware(Device& device) {
    device.chip.firmware_latency = std::chrono::milliseconds(5);
    return true;
}

// --- All quirks ---

struct Row {
    QuirkInfo info;
    bool (*change)(Device&) = nullptr;  // for quirks of SII or chip; for firmware quirks nullptr, and `quirk` is set
    Quirk quirk{};
};

constexpr Row kRows[] = {
    {{"sii_blank", "its EEPROM was never written"}, blank},
    {{"sii_bad_checksum", "the checksum of its EEPROM is wrong"}, bad_checksum},
    {{"sii_no_mailbox_sizes", "its SII has mailbox protocols, but the mailbox sizes are 0"}, no_mailbox_sizes},
    {{"sii_no_pdos", "its SII has no PDO categories"}, no_pdos},
    {{"sii_null_strings", "the strings of its SII are zeros"}, null_strings},
    {{"sii_endless", "the last category of its SII is longer than the EEPROM"}, endless},
    {{"sii_no_watchdog_trigger", "the SyncManagers in its SII do not trigger the watchdog"}, no_watchdog_trigger},
    {{"sii_sync_managers_off", "the process data SyncManagers in its SII have length 0 and are disabled"},
     sync_managers_off},
    {{"sii_4_bytes", "its EEPROM interface reads 4 octets at a time"}, reads_4_bytes},
    {{"sii_slow", "its EEPROM needs 3 ms for a read command and 10 ms to write a word"}, slow_eeprom},
    {{"sii_busy_until_stored", "its EEPROM interface stays busy until a written word is stored"}, busy_until_stored},
    {{"sii_nacks", "its EEPROM does not acknowledge the first two commands"}, eeprom_nacks},
    {{"no_lrw", "its ESC does not support LRW"}, no_lrw},
    {{"clock_32_bits", "its clock has 32 bits"}, clock_32_bits},
    {{"receive_times_only", "it has receive times, but no clock"}, receive_times_only},
    {{"no_clock", "it has no distributed clock"}, no_clock},
    {{"slow_firmware", "its firmware needs 5 ms to react to an event"}, slow_firmware},
    {{"ignores_acknowledge", "only a request for INIT clears an AL error, the acknowledge bit does not"},
     nullptr,
     Quirk::ignores_acknowledge},
    {{"needs_eeprom", "it refuses PREOP (0x0050) while the master has access to the EEPROM"},
     nullptr,
     Quirk::needs_eeprom},
    {{"strict_sync_managers", "it refuses SyncManager control octets that differ from its own (0x001D, 0x001E)"},
     nullptr,
     Quirk::strict_sync_managers},
    {{"slow_state_changes", "each transition to a higher state takes 300 ms"}, nullptr, Quirk::slow_state_changes},
    {{"refuses_op_once", "it refuses OP the first time (0x0052)"}, nullptr, Quirk::refuses_op_once},
    {{"no_cycle1", "it refuses SAFEOP (0x0037) when a SYNC1 cycle time is set"}, nullptr, Quirk::no_cycle1},
    {{"old_mail", "at startup its send mailbox has a reply to an old request"}, nullptr, Quirk::old_mail},
    {{"counter_zero", "its replies have the mailbox counter 0"}, nullptr, Quirk::counter_zero},
    {{"replies_twice", "it sends each reply twice"}, nullptr, Quirk::replies_twice},
    {{"emergency_first", "it sends an emergency before each reply"}, nullptr, Quirk::emergency_first},
    {{"ethernet_first", "it sends an EoE frame before each reply"}, nullptr, Quirk::ethernet_first},
    {{"mail_for_others", "it sends a message with another station address before each reply"},
     nullptr,
     Quirk::mail_for_others},
    {{"mailbox_full", "it reads a message from its receive mailbox only after 20 ms"}, nullptr, Quirk::mailbox_full},
    {{"slow_replies", "each reply takes 100 ms"}, nullptr, Quirk::slow_replies},
    {{"never_replies", "it reads messages, but does not reply"}, nullptr, Quirk::never_replies},
    {{"error_replies", "it replies to each request with a mailbox error"}, nullptr, Quirk::error_replies},
    {{"overlong_replies", "the length in its mailbox headers is larger than the mailbox"},
     nullptr,
     Quirk::overlong_replies},
    {{"empty_replies", "the length in its mailbox headers is 0"}, nullptr, Quirk::empty_replies},
    {{"short_replies", "its replies are too short for their protocol headers"}, nullptr, Quirk::short_replies},
    {{"foreign_replies", "it sends the reply to another request before each reply"}, nullptr, Quirk::foreign_replies},
    {{"empty_repeats", "it acknowledges a repeat request, but leaves its send mailbox empty"},
     nullptr,
     Quirk::empty_repeats},
    {{"refuses_complete_access", "its SII says that it supports complete access, but it refuses complete access"},
     nullptr,
     Quirk::refuses_complete_access},
    {{"unpadded_complete_access", "subindex 0 has 8 bits instead of 16 in its complete access"},
     nullptr,
     Quirk::unpadded_complete_access},
    {{"no_size_indicated", "its expedited uploads do not indicate their size"}, nullptr, Quirk::no_size_indicated},
    {{"never_expedited", "it replies to every upload by normal transfer, even for one octet"},
     nullptr,
     Quirk::never_expedited},
    {{"segments_only", "it sends upload data in segments only, the first reply has no data"},
     nullptr,
     Quirk::segments_only},
    {{"small_segments", "it sends uploads in segments of seven octets"}, nullptr, Quirk::small_segments},
    {{"empty_segments", "the segments of an upload have length 0"}, nullptr, Quirk::empty_segments},
    {{"aborts_midway", "it aborts at the second segment of an upload"}, nullptr, Quirk::aborts_midway},
    {{"toggle_stuck", "the toggle bit of its segments does not toggle"}, nullptr, Quirk::toggle_stuck},
    {{"no_assignment", "it has no objects for PDO assignment and mapping; only its SII lists the PDOs"},
     nullptr,
     Quirk::no_assignment},
    {{"few_mapping_entries", "it accepts at most eight entries per PDO"}, nullptr, Quirk::few_mapping_entries},
    {{"coe_disagrees", "its objects and its SII assign different PDOs"}, nullptr, Quirk::coe_disagrees},
    {{"other_pdos", "it has other PDOs than other devices of the same identity"}, nullptr, Quirk::other_pdos},
    {{"sii_mailbox_1487", "the mailboxes in its SII are one octet larger than a frame carries"}, mailbox_1487},
    {{"sii_mailbox_large", "the mailboxes in its SII have 4 KiB"}, mailbox_large},
    {{"sii_mailbox_in_large", "the send mailbox in its SII is larger than a frame carries"}, mailbox_in_large},
    {{"sii_write_protected", "its EEPROM takes written words and does not store them"}, eeprom_write_protected},
};

}  // namespace

std::span<const QuirkInfo> quirks() {
    static constexpr auto kInfos = [] {
        std::array<QuirkInfo, std::size(kRows)> infos{};
        for (std::size_t i = 0; i < infos.size(); ++i) infos[i] = kRows[i].info;
        return infos;
    }();
    return kInfos;
}

bool add_quirk(Device& device, std::string_view name) {
    const auto* const row =
        std::find_if(std::begin(kRows), std::end(kRows), [&](const Row& r) { return r.info.name == name; });
    if (row == std::end(kRows)) return false;
    if (row->change != nullptr) return row->change(device);
    return device.firmware != nullptr && device.firmware->add_quirk(row->quirk, device.sii);
}

}  // namespace margay::sim
