#include "network/entries.hpp"

#include "network/expectation.hpp"
#include "network/pdo_lists.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint16_t kAssignment = 0x1C10;
constexpr std::uint8_t kReal32 = 0x08;
constexpr std::uint8_t kReal64 = 0x11;

Error fault(Errc code, const EntryAddress& address) {
    Error error{.code = code, .step = Step::map_process_data, .slave = address.slave};
    error.index = address.pdo == 0 ? address.index : static_cast<std::uint16_t>(kAssignment + address.sync_manager);
    error.subindex = address.pdo == 0 ? address.subindex : address.pdo;
    error.detail = address.pdo == 0 ? 0 : address.entry;
    return error;
}

bool is(const FoundEntry& entry, const EntryAddress& address) {
    if (address.pdo != 0)
        return entry.sync_manager == address.sync_manager && entry.pdo_place == address.pdo &&
               entry.entry_place == address.entry;
    return entry.index != 0 && entry.index == address.index && entry.subindex == address.subindex;
}

void note(EntryHandle& handle, const FoundEntry& entry) {
    EntryAccess::Found& found = EntryAccess::found(handle);
    if (found.any) return;
    if (entry.direction != EntryAccess::direction(handle)) {
        found.other_direction = true;
        return;
    }
    found = {.any = true,
             .sync_manager = entry.sync_manager,
             .data_type = entry.data_type,
             .index = entry.index,
             .subindex = entry.subindex,
             .offset_bits = entry.offset_bits,
             .bits = entry.bits};
}

// Visits the entries of the SyncManagers whose entries the application lists completely.
template <class Visit>
void walk_lists(const Slave& slave, Visit visit) {
    for (const SmPdos& list : slave.config.pdos()) {
        if (list.sync_manager >= Slave::kSyncManagers || listed_bits(list).open != 0) continue;
        FoundEntry at{.direction = direction_of(slave, list), .sync_manager = list.sync_manager};
        for (const Pdo& pdo : list.pdos) {
            ++at.pdo_place;
            at.pdo = pdo.index;
            at.entry_place = 0;
            for (const PdoEntry& entry : pdo.entries) {
                ++at.entry_place;
                at.index = entry.index;
                at.subindex = entry.subindex;
                at.bits = entry.bits;
                visit(at);
                at.offset_bits += at.bits;
            }
        }
    }
}

// An optional slave may be absent: its entries are matched when it comes.
bool may_wait(const EntryHandle& handle, const Slave& slave) {
    return handle.optional || (is_optional(slave) && !slave.seen);
}

Error bind(EntryHandle& handle, const Slave& slave, ProcessGroup& group) {
    const EntryAddress& address = handle.address();
    if (!EntryAccess::found(handle).any)
        walk_lists(slave, [&](const FoundEntry& entry) {
            if (is(entry, address)) note(handle, entry);
        });
    const EntryAccess::Found& found = EntryAccess::found(handle);
    const auto place = place_of(slave, group, address, found);
    if (!place) return place.error();
    const Error wrong = check_entry_type(fault(Errc::none, address), EntryAccess::kind(handle),
                                         EntryAccess::type_bits(handle), found.bits, found.data_type);
    if (wrong.code != Errc::none) return wrong;
    const std::uint32_t octet = place->offset_bits / 8;
    EntryAccess::bind(handle, *place, group.image,
                      place->direction == Direction::inputs ? octet - group.output_bytes : octet);
    return {};
}

}  // namespace

void EntryAccess::bind(EntryHandle& handle, const EntryPlace& place, MutableBytes image, std::uint32_t half_octet) {
    handle.place_ = place;
    handle.octets_ = image.data() + place.offset_bits / 8;
    handle.shift_ = static_cast<std::uint8_t>(place.offset_bits % 8);
    handle.value_bits_ = static_cast<std::uint8_t>(std::min<std::uint32_t>(place.bits, 64));
    handle.half_octet_ = half_octet;
    const std::uint32_t end = handle.shift_ + place.bits;
    handle.mask_ = static_cast<std::byte>((0xFFU << handle.shift_) & (0xFFU >> (end < 8 ? 8 - end : 0)));
    handle.plain_ =
        handle.kind_ == EntryKind::boolean ? end <= 8 : handle.shift_ == 0 && place.bits == handle.type_bits_;
}

void EntryAccess::release(EntryHandle& handle) {
    handle.place_ = {};
    handle.own_ = {};
    handle.octets_ = handle.own_.data();
    handle.shift_ = 0;
    handle.mask_ = std::byte{0xFF};
    handle.plain_ = true;
    handle.half_octet_ = 0;
}

// ------------------------------------------------------------------ matching

EntryMatcher::EntryMatcher(std::span<EntryHandle* const> handles, const Slave& slave)
    : handles_(handles), slave_(slave) {
    wanted_ = std::ranges::any_of(
        handles, [&](const EntryHandle* h) { return h != nullptr && h->address().slave == slave.number; });
    for (const SmPdos& list : slave.config.pdos())
        if (list.sync_manager < Slave::kSyncManagers && listed_bits(list).open == 0)
            listed_ = static_cast<std::uint16_t>(listed_ | 1U << list.sync_manager);
    forget();
}

void EntryMatcher::forget() {
    for (EntryHandle* handle : handles_)
        if (handle != nullptr && handle->address().slave == slave_.number) EntryAccess::found(*handle) = {};
    if (wanted_) walk_lists(slave_, [this](const FoundEntry& entry) { match(entry); });
}

void EntryMatcher::add(const FoundEntry& entry) {
    if ((listed_ >> entry.sync_manager & 1U) == 0) match(entry);
}

void EntryMatcher::match(const FoundEntry& entry) {
    for (EntryHandle* handle : handles_)
        if (handle != nullptr && handle->address().slave == slave_.number && is(entry, handle->address()))
            note(*handle, entry);
}

void EntryMatcher::note_type(const FoundEntry& by_sii) {
    for (EntryHandle* handle : handles_) {
        if (handle == nullptr || handle->address().slave != slave_.number) continue;
        EntryAccess::Found& found = EntryAccess::found(*handle);
        const bool same = found.any && found.index == by_sii.index && found.subindex == by_sii.subindex;
        if (same && found.index != 0 && found.bits == by_sii.bits && found.data_type == 0)
            found.data_type = by_sii.data_type;
    }
}

std::span<EntryHandle* const> entries_of(const Network& network, const Slave& slave) {
    const ProcessGroup* group = group_of_entries(network, slave);
    if (group == nullptr) return {};
    return group->config.entries;
}

// ------------------------------------------------------------------ placing

Error check_entry_type(Error where, EntryKind kind, std::uint32_t type_bits, std::uint32_t bits,
                       std::uint8_t data_type) {
    where.expected = type_bits;
    where.actual = bits;
    bool fits = true;
    switch (kind) {
        case EntryKind::any: return {};
        case EntryKind::boolean: fits = bits >= 1 && bits <= 8; break;
        case EntryKind::unsigned_integer:
        case EntryKind::signed_integer:
            fits = bits >= 1 && bits <= type_bits && (type_bits == 8 || bits > type_bits / 2);
            break;
        case EntryKind::real:
        case EntryKind::octets: fits = bits == type_bits; break;
    }
    where.code = Errc::entry_size;
    if (!fits) return where;
    const bool real = data_type == kReal32 || data_type == kReal64;
    where.code = Errc::entry_type;
    where.actual = data_type;
    if (kind != EntryKind::octets && data_type != 0 && real != (kind == EntryKind::real)) return where;
    return {};
}

Result<EntryPlace> place_of(const Slave& slave, const ProcessGroup& group, const EntryAddress& address,
                            const EntryAccess::Found& found) {
    if (!is_as_mapped(slave)) return fault(Errc::remapping_needed, address);
    if (!found.any) return fault(found.other_direction ? Errc::entry_direction : Errc::entry_not_mapped, address);
    for (std::size_t n = 0; n < slave.config.used_sms().size(); ++n) {
        const ProcessSm& sm = slave.config.sms[n];
        const std::uint64_t end = std::uint64_t{found.offset_bits} + found.bits;
        if (sm.number != found.sync_manager || end > sm.bits || found.bits == 0) continue;
        const ImagePart& part = sm.direction == Direction::outputs ? slave.image.outputs : slave.image.inputs;
        if (part.bits == 0) break;
        return EntryPlace{.slave = slave.number,
                          .index = found.index,
                          .subindex = found.subindex,
                          .group = group.number,
                          .direction = sm.direction,
                          .data_type = found.data_type,
                          .offset_bits = sm_offset_bits(slave, group.layout.packing, n) + found.offset_bits,
                          .bits = found.bits,
                          .mapping = group.mappings};
    }
    return fault(Errc::entry_not_mapped, address);
}

Error place_entries(Network& network, ProcessGroup& group, const Slave* only) {
    Error first;
    for (EntryHandle* handle : group.config.entries) {
        if (handle == nullptr) continue;
        const std::uint16_t number = handle->address().slave;
        if (only != nullptr && only->number != number) continue;
        EntryAccess::release(*handle);
        Error error = fault(Errc::unknown_slave, handle->address());
        error.expected = network.count;
        if (number >= 1 && number <= network.count) {
            const Slave& slave = network.slave(number);
            error = slave.image.group == group.number ? bind(*handle, slave, group)
                                                      : fault(Errc::entry_not_mapped, handle->address());
            if (error.code == Errc::entry_not_mapped && may_wait(*handle, slave)) continue;
        }
        if (error.code == Errc::none) continue;
        network.errors.add(error);
        if (first.code == Errc::none) first = error;
    }
    return first;
}

void release_entries(ProcessGroup& group) {
    for (EntryHandle* handle : group.config.entries)
        if (handle != nullptr) EntryAccess::release(*handle);
}

}  // namespace margay
