// Esc: logical addresses, through the FMMUs (ETG.1000.4 "Fieldbus memory management unit"; ESC data sheets, "FMMU").
#include "sim/esc.hpp"

#include <algorithm>
#include <limits>

namespace margay::sim {

namespace {

namespace reg = wire::reg;

}  // namespace

// "If two or more FMMUs with the same direction are configured for the same logical byte, the FMMU with the lower
// number is used, the other ones are ignored": octets that earlier FMMUs map are removed from the new mapping.
void Esc::Mappings::add(Mapping mapping) {
    const auto taken = count;
    for (unsigned n = 0; n < taken; ++n) {
        const auto begin = at[n].logical / 8 * 8;
        const auto end = (at[n].logical_end + 7) / 8 * 8;
        if (end <= mapping.logical || mapping.logical_end <= begin) continue;
        if (end < mapping.logical_end) {
            auto behind = mapping;
            behind.logical = end;
            behind.physical += end - mapping.logical;
            add(behind);
        }
        if (begin <= mapping.logical) return;
        mapping.logical_end = begin;
    }
    mapping.octets = (mapping.logical | mapping.logical_end | mapping.physical) % 8 == 0;
    if (count < at.size()) at[count++] = mapping;
}

void Esc::reload_mappings() {
    read_mappings_.count = write_mappings_.count = 0;
    std::uint64_t first = std::numeric_limits<std::uint64_t>::max();
    std::uint64_t last = 0;
    const bool bits = (description_.features & wire::features::kFmmuBitOperationNotSupported) == 0;
    for (unsigned n = 0; n < description_.fmmus; ++n) {
        auto f = wire::load_fmmu(Bytes(registers_.bytes()).subspan(reg::fmmu(n).address, reg::kFmmuStride));
        if (!f.active || f.length_bytes == 0 || (!f.read && !f.write)) continue;
        if (!bits) f.logical_start_bit = f.physical_start_bit = 0, f.logical_end_bit = 7;
        const std::uint64_t start = std::uint64_t{f.logical_start.value} * 8 + f.logical_start_bit;
        const std::uint64_t end =
            (std::uint64_t{f.logical_start.value} + f.length_bytes - 1) * 8 + f.logical_end_bit + 1;
        if (end <= start) continue;
        const Mapping mapping{start, end, std::uint64_t{f.physical_start} * 8 + f.physical_start_bit};
        if (f.read) read_mappings_.add(mapping);
        if (f.write) write_mappings_.add(mapping);
        first = std::min(first, start / 8);
        last = std::max(last, (end - 1) / 8);
    }
    const bool none = read_mappings_.count + write_mappings_.count == 0;
    logical_first_ = none ? 1 : static_cast<std::uint32_t>(first);
    logical_last_ = none ? 0 : static_cast<std::uint32_t>(std::min<std::uint64_t>(last, UINT32_MAX));
    exchanges_ = false;
    for (unsigned r = 0; r < read_mappings_.count; ++r)
        for (unsigned w = 0; w < write_mappings_.count; ++w)
            exchanges_ |= read_mappings_.at[r].logical / 8 <= (write_mappings_.at[w].logical_end - 1) / 8 &&
                          write_mappings_.at[w].logical / 8 <= (read_mappings_.at[r].logical_end - 1) / 8;
    link_mappings();
    ++configuration_;
}

// Detects the common case once: an FMMU that maps exactly the buffer of one SyncManager.
void Esc::link_mappings() {
    for (std::size_t n = 0; n < mapped_ram_.size(); ++n) {
        const auto& first = (n == 0 ? read_mappings_ : write_mappings_).at[0];
        const auto count = (n == 0 ? read_mappings_ : write_mappings_).count;
        const auto offset = first.physical / 8 - reg::kProcessRam;
        mapped_ram_[n] = count != 0 && offset < ram_.size() ? static_cast<std::uint32_t>(offset) : 0;
    }
    for (auto* mappings : {&read_mappings_, &write_mappings_})
        for (unsigned n = 0; n < mappings->count; ++n) {
            auto& mapping = mappings->at[n];
            const auto start = mapping.physical / 8;
            const auto stop = start + (mapping.logical_end - mapping.logical) / 8;
            mapping.channel = static_cast<std::int8_t>(
                mapping.octets && stop <= 0xFFFF
                    ? sync_managers_.exactly_at(static_cast<std::uint32_t>(start), static_cast<std::uint32_t>(stop))
                    : -1);
        }
}

std::uint16_t Esc::ecat_logical(bool read, bool write, std::uint32_t address, MutableBytes data, Time at) {
    if (!read) return map_all(write_mappings_, true, address, data, at) ? 1 : 0;
    if (!write) return map_all(read_mappings_, false, address, data, at) ? 1 : 0;
    if ((description_.features & wire::features::kLrwNotSupported) != 0) return 0;
    if (exchanges_) return ecat_exchange(address, data, at);
    const bool was_read = map_all(read_mappings_, false, address, data, at);
    const bool was_written = map_all(write_mappings_, true, address, data, at);
    return static_cast<std::uint16_t>((was_read ? 1 : 0) + (was_written ? 2 : 0));
}

// The slave must write the data that arrived in the frame, although it reads its own data into the same octets.
// Therefore the data that is read goes into a separate buffer first.
std::uint16_t Esc::ecat_exchange(std::uint32_t address, MutableBytes data, Time at) {
    const auto end = std::min<std::uint64_t>(std::uint64_t{logical_last_} + 1, std::uint64_t{address} + data.size());
    const std::uint64_t begin = std::max<std::uint64_t>(logical_first_, address);
    if (begin >= end) return 0;
    const auto window = data.subspan(static_cast<std::size_t>(begin - address), static_cast<std::size_t>(end - begin));
    std::array<std::byte, wire::kMaxFrameBytes> out;
    std::copy(window.begin(), window.end(), out.begin());
    const auto shadow = MutableBytes(out).first(window.size());
    const bool was_read = map_all(read_mappings_, false, static_cast<std::uint32_t>(begin), shadow, at);
    const bool was_written = map_all(write_mappings_, true, address, data, at);
    std::copy(shadow.begin(), shadow.end(), window.begin());
    return static_cast<std::uint16_t>((was_read ? 1 : 0) + (was_written ? 2 : 0));
}

bool Esc::map_all(const Mappings& mappings, bool write, std::uint32_t address, MutableBytes data, Time at) {
    bool any = false;
    for (unsigned n = 0; n < mappings.count; ++n) any |= map(mappings.at[n], write, address, data, at);
    return any;
}

bool Esc::map(const Mapping& mapping, bool write, std::uint32_t address, MutableBytes data, Time at) {
    const std::uint64_t first = std::max(mapping.logical, std::uint64_t{address} * 8);
    const std::uint64_t end = std::min(mapping.logical_end, (std::uint64_t{address} + data.size()) * 8);
    if (first >= end) return false;
    if (mapping.channel >= 0 && first == mapping.logical && end == mapping.logical_end)
        return map_buffer(mapping, write, data.data() + (first / 8 - address), at);
    if (!mapping.octets) return map_bits(mapping, write, first, end, address, data, at);
    const auto physical = static_cast<std::uint32_t>((mapping.physical + (first - mapping.logical)) / 8);
    return access(Side::ecat, write, physical, data.data() + (first / 8 - address),
                  static_cast<std::size_t>((end - first) / 8), at);
}

bool Esc::map_buffer(const Mapping& mapping, bool write, std::byte* data, Time at) {
    const auto n = static_cast<unsigned>(mapping.channel);
    const auto start = static_cast<std::uint32_t>(mapping.physical / 8);
    const auto length = static_cast<std::size_t>((mapping.logical_end - mapping.logical) / 8);
    const auto stop = static_cast<std::uint32_t>(start + length);
    if (write && !writable(start)) return false;
    SyncManagers::Events events;
    const auto shift = sync_managers_.open(n, Side::ecat, write, start, stop, events);
    if (!shift) return false;
    const bool done = access_ram(write, start + *shift, data, length);
    if (done) sync_managers_.touched(n, Side::ecat, stop, events);
    handle(events, at);
    return done;
}

// Mappings that do not start and end at octet boundaries. ESC data sheets, "FMMU": only the digital outputs
// (0x0F00–0x0F03) support bit-wise writing. In other memory the bits that are not mapped are undefined after a write;
// here they are inverted, so that a program that relies on them fails.
bool Esc::map_bits(const Mapping& mapping, bool write, std::uint64_t first, std::uint64_t end, std::uint32_t address,
                   MutableBytes data, Time at) {
    const std::uint64_t physical = mapping.physical + (first - mapping.logical);
    const std::uint64_t base = physical / 8;
    const auto octets = static_cast<std::size_t>((physical + (end - first) + 7) / 8 - base);
    std::array<std::byte, wire::kMaxFrameBytes + 1> memory{};
    const auto test = [](const std::byte* from, std::uint64_t bit) {
        return (std::to_integer<unsigned>(from[bit / 8]) >> (bit % 8) & 1) != 0;
    };
    const auto put = [](std::byte* to, std::uint64_t bit, bool value) {
        const auto mask = static_cast<std::byte>(1u << (bit % 8));
        to[bit / 8] = value ? to[bit / 8] | mask : to[bit / 8] & ~mask;
    };
    const std::uint64_t data_base = std::uint64_t{address} * 8;
    const auto at_address = static_cast<std::uint32_t>(base);
    if (!write) {
        if (!access(Side::ecat, false, at_address, memory.data(), octets, at)) return false;
        for (std::uint64_t i = 0; i < end - first; ++i)
            put(data.data(), first + i - data_base, test(memory.data(), physical - base * 8 + i));
        return true;
    }
    before_write(at_address, MutableBytes(memory).first(octets));
    for (std::uint64_t i = 0; i < end - first; ++i)
        put(memory.data(), physical - base * 8 + i, test(data.data(), first + i - data_base));
    return access(Side::ecat, true, at_address, memory.data(), octets, at);
}

// The octets that a bit-wise write starts from.
void Esc::before_write(std::uint32_t address, MutableBytes into) const {
    for (std::size_t i = 0; i < into.size(); ++i) {
        const auto a = static_cast<std::uint32_t>(address + i);
        if (a < reg::kProcessRam) {
            const bool digital_outputs = a >= 0x0F00 && a < 0x0F04;
            into[i] = digital_outputs ? registers_.bytes()[a] : ~registers_.bytes()[a];
        } else if (const auto at = sync_managers_.write_address(a) - reg::kProcessRam; at < ram_.size()) {
            into[i] = ~ram_[at];
        }
    }
}

}  // namespace margay::sim
