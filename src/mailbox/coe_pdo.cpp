#include "mailbox/coe_pdo.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint16_t kSmTypes = 0x1C00;
constexpr std::uint16_t kAssignment = 0x1C10;
constexpr MailPatience kPatience{};

// A list of the dictionary: subindex 0 says how many, the others are alike. Read whole where the slave can and it is not long, else one by one.
template <class T>
class SdoList {
  public:
    SdoList(MailboxChannel& channel, std::uint16_t index) : channel_(channel), index_(index) {}
    [[nodiscard]] Arena& arena() { return channel_.arena(); }

    // The number of elements. Error sdo_abort: there is no such list.
    Task<Result<std::uint8_t>> open() {
        kept_ = 0;
        const bool whole = !channel_.no_complete_access && (channel_.slave().coe_details & coe_detail::kCompleteAccess) != 0;
        if (whole) {
            auto read = co_await sdo_upload_once(channel_, {.index = index_, .complete = true}, cache_, kPatience);
            if (read && is_list(*read)) {
                kept_ = static_cast<std::uint8_t>((*read - kHead) / sizeof(T));
                co_return std::to_integer<std::uint8_t>(cache_[0]);
            }
            if (read || is_complete_access_refused(read.error())) channel_.no_complete_access = true;
        }
        std::array<std::byte, 4> count{};
        auto read = co_await sdo_upload_once(channel_, {.index = index_}, count, kPatience);
        if (!read) co_return read.error();
        co_return std::to_integer<std::uint8_t>(count[0]);
    }

    // The n-th, from 1.
    Task<Result<T>> element(unsigned n) {
        if (n <= kept_) co_return load_le<T>(cache_, kHead + (n - 1) * sizeof(T));
        std::array<std::byte, sizeof(T)> value{};
        auto read = co_await sdo_upload_once(channel_, {.index = index_, .subindex = static_cast<std::uint8_t>(n)}, value, kPatience);
        if (!read) co_return read.error();
        co_return load_le<T>(value);
    }

  private:
    // Subindex 0 takes two octets there. Some slaves give it one: what they say is read singly.
    [[nodiscard]] bool is_list(std::size_t bytes) const {
        const std::size_t count = std::to_integer<std::size_t>(cache_[0]);
        return bytes >= kHead + std::min(count, kMostKept) * sizeof(T) && (bytes - kHead) % sizeof(T) == 0;
    }

    static constexpr std::size_t kHead = 2;
    static constexpr std::size_t kMostKept = 32;
    MailboxChannel& channel_;
    std::uint16_t index_;
    std::uint8_t kept_ = 0;
    std::array<std::byte, kHead + kMostKept * sizeof(T)> cache_{};
};

// The slave has answered that it does not have it: no failure.
bool is_refusal(const Error& error) { return error.code == Errc::sdo_abort || error.code == Errc::mailbox_error; }

// Bits of one PDO. Gaps are entries with index 0, and count.
Task<Result<std::uint32_t>> pdo_bits(MailboxChannel& channel, std::uint16_t pdo) {
    SdoList<std::uint32_t> entries(channel, pdo);
    auto count = co_await entries.open();
    if (!count) co_return count.error();
    std::uint32_t bits = 0;
    for (unsigned n = 1; n <= *count; ++n) {
        auto entry = co_await entries.element(n);
        if (!entry) co_return entry.error();
        bits += *entry & 0xFFU;
    }
    co_return bits;
}

// Bits of all PDOs that are assigned to a SyncManager.
Task<Result<std::uint32_t>> assigned_bits(MailboxChannel& channel, unsigned sync_manager) {
    SdoList<std::uint16_t> pdos(channel, static_cast<std::uint16_t>(kAssignment + sync_manager));
    auto count = co_await pdos.open();
    if (!count) co_return count.error();
    std::uint32_t bits = 0;
    for (unsigned n = 1; n <= *count; ++n) {
        auto pdo = co_await pdos.element(n);
        if (!pdo) co_return pdo.error();
        if (*pdo == 0) continue;
        auto one = co_await pdo_bits(channel, *pdo);
        if (!one) co_return one;
        bits += *one;
    }
    co_return bits;
}

using Types = std::array<SmType, Slave::kSyncManagers>;

// What each SyncManager is for. Without 0x1C00 as the standard has it by default.
Task<Result<>> read_types(MailboxChannel& channel, Types& types) {
    types = {SmType::mailbox_out, SmType::mailbox_in, SmType::outputs, SmType::inputs};
    SdoList<std::uint8_t> list(channel, kSmTypes);
    auto count = co_await list.open();
    if (!count) co_return is_refusal(count.error()) ? Result<>() : Result<>(count.error());
    if (*count == 0) co_return Result<>();
    types.fill(SmType::unused);
    for (unsigned n = 0; n < *count && n < types.size(); ++n) {
        auto type = co_await list.element(n + 1);
        if (!type && !is_refusal(type.error())) co_return type.error();
        if (type) types[n] = static_cast<SmType>(*type);
    }
    co_return Result<>();
}

}  // namespace

Task<Result<bool>> discover_pdos_from_coe(MailboxChannel& channel, Slave& slave) {
    if (!channel.is_open() || (slave.mailbox.protocols & mailbox_protocol::kCoE) == 0) co_return false;
    Types types{};
    auto typed = co_await read_types(channel, types);
    if (!typed) co_return typed.error();
    SlaveConfiguration found;
    bool any = false;
    for (std::uint8_t n = 0; n < types.size(); ++n) {
        const bool outputs = types[n] == SmType::outputs;
        if ((!outputs && types[n] != SmType::inputs) || n >= slave.sm_count) continue;
        auto bits = co_await assigned_bits(channel, n);
        if (!bits && !is_refusal(bits.error())) co_return bits.error();
        any = any || bits;
        // A direction that the dictionary does not know of may be fixed.
        const SmInfo& sm = slave.sync_managers[n];
        const std::uint32_t length = bits ? *bits : sm.length_bytes * 8U;
        if (!bits && length == 0) continue;
        (void)found.add({n, outputs ? Direction::outputs : Direction::inputs, sm.control, sm.start, length});
    }
    if (!any) co_return false;
    slave.config.sms = found.sms;
    slave.config.sm_count = found.sm_count;
    slave.config.source = ConfigurationSource::coe;
    co_return true;
}

}  // namespace margay
