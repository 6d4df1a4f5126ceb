#include "mailbox/coe_pdo.hpp"

#include "mailbox/coe_list.hpp"

namespace margay {
namespace {

constexpr std::uint16_t kSmTypes = 0x1C00;
constexpr std::uint16_t kAssignment = 0x1C10;

// Returns the bits of the PDO at.pdo. Gaps are entries with index 0, and are included.
Task<Result<std::uint32_t>> pdo_bits(MailboxChannel& channel, FoundEntry at, const MailPatience& patience,
                                     EntrySink* sink) {
    SdoList entries(channel, at.pdo, 4, patience);
    const auto count = co_await required(entries.open());
    std::uint32_t bits = 0;
    for (unsigned n = 1; n <= count; ++n) {
        const auto entry = co_await required(entries.element(n));
        at.entry_place = static_cast<std::uint8_t>(n);
        at.index = static_cast<std::uint16_t>(entry >> 16);
        at.subindex = static_cast<std::uint8_t>(entry >> 8);
        at.bits = entry & 0xFFU;
        if (sink != nullptr) sink->add(at);
        at.offset_bits += at.bits;
        bits += at.bits;
    }
    co_return bits;
}

// Returns the bits of all PDOs that are assigned to a SyncManager.
Task<Result<std::uint32_t>> assigned_bits(MailboxChannel& channel, FoundEntry at, const MailPatience& patience,
                                          EntrySink* sink) {
    SdoList pdos(channel, static_cast<std::uint16_t>(kAssignment + at.sync_manager), 2, patience);
    const auto count = co_await required(pdos.open());
    for (unsigned n = 1; n <= count; ++n) {
        const auto pdo = co_await required(pdos.element(n));
        if (pdo == 0) continue;
        at.pdo = static_cast<std::uint16_t>(pdo);
        at.pdo_place = static_cast<std::uint8_t>(n);
        const auto one = co_await required(pdo_bits(channel, at, patience, sink));
        at.offset_bits += one;
    }
    co_return at.offset_bits;
}

}  // namespace

Task<Result<bool>> read_sm_types(MailboxChannel& channel, SmTypes& types, const MailPatience& patience) {
    types = {SmType::mailbox_out, SmType::mailbox_in, SmType::outputs, SmType::inputs};
    SdoList list(channel, kSmTypes, 1, patience);
    auto count = co_await list.open();
    if (!count && !is_refusal(count.error())) co_return count.error();
    if (!count || *count == 0) co_return false;
    types.fill(SmType::unused);
    for (unsigned n = 0; n < *count && n < types.size(); ++n) {
        auto type = co_await list.element(n + 1);
        if (!type && !is_refusal(type.error())) co_return type.error();
        if (type) types[n] = static_cast<SmType>(*type);
    }
    co_return true;
}

Task<Result<bool>> find_sms_by_coe(MailboxChannel& channel, const Slave& slave, const SmTypes& types, FoundSms& found,
                                   UndescribedPdos& undescribed, const MailPatience& patience, EntrySink* entries) {
    bool any = false;
    for (std::uint8_t n = 0; n < types.size(); ++n) {
        const bool outputs = types[n] == SmType::outputs;
        if ((!outputs && types[n] != SmType::inputs) || n >= slave.sm_count) continue;
        const auto direction = outputs ? Direction::outputs : Direction::inputs;
        auto bits = co_await assigned_bits(channel, {.direction = direction, .sync_manager = n}, patience, entries);
        if (!bits && !is_refusal(bits.error())) co_return bits.error();
        any = any || bits;
        // The slave has refused a PDO and not the assignment, so it may have PDOs.
        if (!bits && bits.error().index != kAssignment + n) undescribed[n] = bits.error().index;
        // The dictionary has no assignment for this direction: the length of the SII is used, because the process data
        // may be fixed.
        const std::uint32_t length = bits ? *bits : slave.sync_managers[n].length_bytes * 8U;
        if (bits || length != 0) found[n] = {.any = true, .direction = direction, .bits = length};
    }
    if (!any) found = {};
    co_return any;
}

}  // namespace margay
