#include "mailbox/coe_pdo_write.hpp"

#include "mailbox/arena_buffer.hpp"
#include "mailbox/coe_complete.hpp"
#include "mailbox/coe_list.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint16_t kAssignment = 0x1C10;
constexpr std::size_t kCountBytes = 2;  // octets of subindex 0 in a complete access

// A list that is to be written: its elements in sequence. Either an assignment or a mapping.
struct WantedList {
    const SmPdos* assignment = nullptr;  // or
    const Pdo* mapping = nullptr;

    [[nodiscard]] std::uint16_t index() const {
        return mapping != nullptr ? mapping->index : static_cast<std::uint16_t>(kAssignment + assignment->sync_manager);
    }
    [[nodiscard]] std::size_t count() const {
        return mapping != nullptr ? mapping->entries.size() : assignment->pdos.size();
    }
    [[nodiscard]] std::size_t element_bytes() const { return mapping != nullptr ? 4 : 2; }
    [[nodiscard]] std::uint32_t element(std::size_t n) const {
        if (mapping == nullptr) return assignment->pdos[n].index;
        const PdoEntry& e = mapping->entries[n];
        return std::uint32_t{e.index} << 16 | std::uint32_t{e.subindex} << 8 | e.bits;
    }
    [[nodiscard]] std::size_t bytes() const { return kCountBytes + count() * element_bytes(); }
    void store(MutableBytes into) const {
        store_le<std::uint16_t>(into, 0, static_cast<std::uint16_t>(count()));
        for (std::size_t n = 0; n < count(); ++n) {
            const std::size_t at = kCountBytes + n * element_bytes();
            if (mapping != nullptr)
                store_le<std::uint32_t>(into, at, element(n));
            else
                store_le<std::uint16_t>(into, at, static_cast<std::uint16_t>(element(n)));
        }
    }
};

// The difference between the list in the slave and the wanted list: the first element that differs, 0 the count.
struct Difference {
    bool any = false;
    bool readable = true;  // a list that cannot be read may still be writable
    std::uint8_t subindex = 0;
    std::uint32_t wanted = 0;
    std::uint32_t has = 0;
};

Task<Result<Difference>> compare(MailboxChannel& channel, WantedList wanted, const MailPatience& patience) {
    SdoList list(channel, wanted.index(), wanted.element_bytes(), patience);
    auto count = co_await list.open();
    if (!count && !is_refusal(count.error())) co_return count.error();
    if (!count) co_return Difference{.any = true, .readable = false};
    if (*count != wanted.count())
        co_return Difference{.any = true, .wanted = static_cast<std::uint32_t>(wanted.count()), .has = *count};
    for (unsigned n = 0; n < wanted.count(); ++n) {
        auto element = co_await list.element(n + 1);
        if (!element && !is_refusal(element.error())) co_return element.error();
        if (!element) co_return Difference{.any = true, .readable = false};
        if (*element == wanted.element(n)) continue;
        co_return Difference{
            .any = true, .subindex = static_cast<std::uint8_t>(n + 1), .wanted = wanted.element(n), .has = *element};
    }
    co_return Difference{};
}

Task<Result<>> write_empty(MailboxChannel& channel, std::uint16_t index, const MailPatience& patience) {
    static constexpr std::array kZero{std::byte{0}};
    co_return co_await required(sdo_download_once(channel, {.index = index}, kZero, patience));
}

// Writes the list by complete access if the slave supports it. Otherwise, or when the slave refuses it, element by
// element: the error then contains the element that the slave refuses.
Task<Result<>> write_list(MailboxChannel& channel, WantedList wanted, const MailPatience& patience) {
    ArenaBuffer buffer(channel.arena());
    if (!buffer.reserve(wanted.bytes()))
        co_return channel.station().error(Errc::capacity, Step::sdo_download, wanted.index());
    const Bytes whole = buffer.bytes().first(wanted.bytes());
    wanted.store(buffer.bytes());
    const bool complete = channel.whole_objects() && (channel.slave().coe_details & coe_detail::kCompleteAccess) != 0;
    if (complete && wanted.count() != 0) {
        auto emptied = co_await write_empty(channel, wanted.index(), patience);
        if (!emptied && !is_refusal(emptied.error())) co_return emptied;
        auto written =
            co_await sdo_download_once(channel, {.index = wanted.index(), .complete = true}, whole, patience);
        if (written || !is_refusal(written.error())) co_return written;
        if (is_complete_access_refused(written.error())) channel.no_complete_access = true;
    }
    co_return co_await required(
        sdo_download_singly(channel, {.index = wanted.index(), .complete = true}, whole, patience));
}

// For a list that the slave does not allow to be emptied: the error contains the first element that differs.
Error with_difference(Error error, const Difference& difference) {
    if (error.code != Errc::sdo_abort || error.subindex != 0 || !difference.readable) return error;
    error.subindex = difference.subindex;
    error.expected = difference.wanted;
    error.actual = difference.has;
    return error;
}

Task<Result<>> write_mapping(MailboxChannel& channel, const Pdo& pdo, const MailPatience& patience) {
    auto written = co_await write_list(channel, {.mapping = &pdo}, patience);
    if (written || !is_refusal(written.error()) || written.error().subindex != 0) co_return written;
    auto difference = co_await compare(channel, {.mapping = &pdo}, patience);
    co_return difference ? with_difference(written.error(), *difference) : written.error();
}

// The mappings that differ, one bit for each. Mappings without listed entries do not differ.
struct Differing {
    std::array<std::uint32_t, 8> bits{};
    [[nodiscard]] bool any() const {
        return std::ranges::any_of(bits, [](std::uint32_t b) { return b != 0; });
    }
    void set(std::size_t n) { bits[n / 32] |= 1U << (n % 32); }
    [[nodiscard]] bool test(std::size_t n) const { return (bits[n / 32] >> (n % 32) & 1U) != 0; }
};

Task<Result<>> compare_mappings(MailboxChannel& channel, const SmPdos& wanted, Differing& differing,
                                const MailPatience& patience) {
    for (std::size_t n = 0; n < wanted.pdos.size(); ++n) {
        if (wanted.pdos[n].entries.empty()) continue;
        const auto difference = co_await required(compare(channel, {.mapping = &wanted.pdos[n]}, patience));
        if (difference.any) differing.set(n);
    }
    co_return Nothing{};
}

}  // namespace

Task<Result<>> write_sm_pdos(MailboxChannel& channel, const SmPdos& wanted, const MailPatience& patience) {
    Differing differing;
    co_await required(compare_mappings(channel, wanted, differing, patience));
    auto assignment = co_await compare(channel, {.assignment = &wanted}, patience);
    if (!assignment) co_return assignment.error();
    if (!assignment->any && !differing.any()) co_return Nothing{};
    auto emptied =
        co_await write_empty(channel, static_cast<std::uint16_t>(kAssignment + wanted.sync_manager), patience);
    // An assignment may be fixed while its mappings are writable.
    const bool fixed = !emptied && is_refusal(emptied.error()) && !assignment->any;
    if (!emptied && !fixed) co_return with_difference(emptied.error(), *assignment);
    for (std::size_t n = 0; n < wanted.pdos.size(); ++n) {
        if (!differing.test(n)) continue;
        co_await required(write_mapping(channel, wanted.pdos[n], patience));
    }
    if (fixed) co_return Nothing{};
    co_return co_await required(write_list(channel, {.assignment = &wanted}, patience));
}

}  // namespace margay
