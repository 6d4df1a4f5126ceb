// Entries of process data for the public API: loading and storing values of any bits, and finding an entry without a
// list.
#include "api/mail.hpp"
#include "network/entries.hpp"
#include "network/entry_names.hpp"
#include "network/group_layout.hpp"
#include "network/pdos.hpp"
#include "network/wanted.hpp"

#include <margay/entry.hpp>
#include <margay/margay.hpp>

#include <algorithm>

namespace margay {

// ------------------------------------------------------------------ values

namespace detail {

std::uint64_t load_bits(const std::byte* from, unsigned shift, unsigned bits) {
    std::uint64_t value = 0;
    for (unsigned at = 0; at < bits;) {
        const unsigned part = std::min(8 - shift, bits - at);
        const std::uint64_t octet = (std::to_integer<unsigned>(*from++) >> shift) & (0xFFU >> (8 - part));
        value |= octet << at;
        at += part;
        shift = 0;
    }
    return value;
}

void store_bits(std::byte* to, unsigned shift, unsigned bits, std::uint64_t value) {
    for (unsigned at = 0; at < bits; ++to) {
        const unsigned part = std::min(8 - shift, bits - at);
        const unsigned mask = (0xFFU >> (8 - part)) << shift;
        const unsigned octet = static_cast<unsigned>(value >> at & 0xFFU) << shift & mask;
        *to = static_cast<std::byte>((std::to_integer<unsigned>(*to) & ~mask) | octet);
        at += part;
        shift = 0;
    }
}

}  // namespace detail

std::size_t OctetsEntry::read(std::span<std::byte> into) const {
    const std::size_t octets = mapped() ? std::min<std::size_t>(octets_count_, into.size()) : 0;
    for (std::size_t n = 0; n < octets; ++n)
        into[n] = static_cast<std::byte>(detail::load_bits(octets_ + n, shift_, 8));
    return octets;
}

std::string_view OctetsEntry::read_text(std::span<char> into) const {
    const std::size_t octets = read(std::as_writable_bytes(into));
    const std::string_view text(into.data(), octets);
    return text.substr(0, std::min(text.size(), text.find('\0')));
}

void OctetsEntry::store(std::span<const std::byte> value) {
    if (!mapped()) return;
    for (std::size_t n = 0; n < octets_count_; ++n)
        detail::store_bits(octets_ + n, shift_, 8, n < value.size() ? std::to_integer<std::uint64_t>(value[n]) : 0);
}

// ------------------------------------------------------------------ requests

namespace {

// The handle for the entry that an EntryRequest searches.
class Wanted final : public EntryHandle {
  public:
    Wanted(const EntryAddress& address, Direction direction) : EntryHandle(address, direction, EntryKind::any, 0) {}
};

Error error_at(Errc code, const EntryPlace& place) {
    return {.code = code,
            .step = Step::map_process_data,
            .slave = place.slave,
            .index = place.index,
            .subindex = place.subindex};
}

}  // namespace

static Error check(Network& network, const EntryRequest& r) {
    Error refused = check_slave(network, r.address.slave, Step::map_process_data);
    if (refused.code != Errc::none) return refused;
    const Slave& slave = network.slave(r.address.slave);
    if (network.supervised && slave.al.state == AlState::none)  // known to be lost: no need to wait for an answer
        return {.code = Errc::missing_slave, .step = Step::map_process_data, .slave = r.address.slave};
    if (is_mapped(network, slave)) return {};
    refused = unmapped_group(network, slave.config.group);
    refused.slave = r.address.slave;
    return refused;
}
static Error check(Network& network, const EntryNameRequest& r) {
    const Error refused = check_slave(network, r.slave, Step::discover_pdos);
    const bool lost =
        refused.code == Errc::none && network.supervised && network.slave(r.slave).al.state == AlState::none;
    if (!lost) return refused;
    return {.code = Errc::missing_slave, .step = Step::discover_pdos, .slave = r.slave};
}

static Task<Result<>> run(Network& network, EntryRequest& request) {
    request.place = {};
    const EntryAddress address = request.address;
    Slave& slave = network.slave(address.slave);
    Wanted out(address, Direction::outputs);
    Wanted in(address, Direction::inputs);
    EntryHandle* handles[] = {&out, &in};
    EntryMatcher matcher(handles, slave);
    co_await required(find_entries(network, slave, matcher));
    const Error changed = check(network, request);  // the configuration of the slave may have changed meanwhile
    if (changed.code != Errc::none) co_return changed;
    Wanted& first = request.one_direction && request.wanted == Direction::inputs ? in : out;
    const bool other = !request.one_direction && !EntryAccess::found(first).any;
    const auto place =
        place_of(slave, network.process.groups[slave.image.group], address, EntryAccess::found(other ? in : first));
    if (!place) co_return place.error();
    request.place = *place;
    co_return Nothing{};
}

static Task<Result<>> run(Network& network, EntryNameRequest& request) {
    auto named = co_await find_entry_name(network, network.slave(request.slave), request.index, request.subindex,
                                          request.into, patience_of(request));
    request.bytes = named ? *named : std::size_t{0};
    co_return named ? Result<>() : Result<>(named.error());
}

static constexpr OperationDescription kFind =
    describe_operation<EntryRequest, check, run>(Operation::find_entry, Step::map_process_data, Needs::its_slave);
static constexpr OperationDescription kName =
    describe_operation<EntryNameRequest, check, run>(Operation::find_entry, Step::discover_pdos, Needs::its_slave);
EntryRequest::EntryRequest() : Request(kFind) {}
EntryNameRequest::EntryNameRequest() : MailRequest(kName) {}

// ------------------------------------------------------------------ functions that wait

Result<EntryPlace> find_entry(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                              Duration timeout) {
    return find_entry(ctx, EntryAddress::object(slave, index, subindex), timeout);
}

Result<EntryPlace> find_entry(Context& ctx, const EntryAddress& address, Duration timeout) {
    EntryRequest request;
    request.address = address;
    request.timeout = timeout;
    return submit_and_wait(ctx, request, request.place);
}

Result<std::string_view> read_entry_name(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                                         std::span<char> into, Duration timeout) {
    EntryNameRequest request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.into = into;
    const auto done = submit_and_wait(ctx, request);
    if (!done) return done.error();
    if (request.bytes == 0)
        return Error{.code = Errc::unsupported,
                     .step = Step::sdo_information,
                     .slave = slave,
                     .index = index,
                     .subindex = subindex};
    return std::string_view(into.data(), request.bytes);
}

// ------------------------------------------------------------------ values by EntryPlace

Result<std::span<std::byte>> entry_octets(Context& ctx, const EntryPlace& place, EntryKind kind,
                                          std::uint32_t type_bits, bool write) {
    const Group& group = ctx.group(place.group);
    if (!group.mapped || place.mapping == 0 || place.mapping != group.mappings)
        return error_at(Errc::entry_stale, place);
    if (write && place.direction != Direction::outputs) return error_at(Errc::entry_direction, place);
    const Error wrong = check_entry_type(error_at(Errc::none, place), kind, type_bits, place.bits, place.data_type);
    if (wrong.code != Errc::none) return wrong;
    const std::size_t first = place.offset_bits / 8;
    const std::size_t end = (std::size_t{place.offset_bits} + place.bits + 7) / 8;
    if (end > group.image.size()) return error_at(Errc::entry_stale, place);
    return group.image.subspan(first, end - first);
}

}  // namespace margay
