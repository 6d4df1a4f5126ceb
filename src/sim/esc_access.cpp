// Esc: how an access finds its memory, by address or by FMMU.
#include "sim/esc.hpp"

#include <algorithm>
#include <cstring>

namespace margay::sim {

namespace {

namespace reg = wire::reg;
constexpr std::uint32_t kAddressSpace = 0x10000;
constexpr std::uint32_t kDigitalOutputs = 0x0F00;  // process data that is not in RAM

}  // namespace

bool Esc::ecat_read(std::uint32_t address, MutableBytes data, Time at) {
    return access(Side::ecat, false, address, data.data(), data.size(), at);
}

bool Esc::ecat_write(std::uint32_t address, Bytes data, Time at) {
    return access(Side::ecat, true, address, const_cast<std::byte*>(data.data()), data.size(), at);
}

// Cuts an access into parts of one owner each: a SyncManager, or nobody.
bool Esc::access(Side side, bool write, std::uint32_t address, std::byte* data, std::size_t length, Time at) {
    const auto end = static_cast<std::uint32_t>(std::min<std::size_t>(address + length, kAddressSpace));
    if (!sync_managers_.any_enabled()) {
        return address < end && access_plain(side, write, address, data, end - address, at);
    }
    bool any = false;
    SyncManagers::Events events;
    while (address < end) {
        const auto part = sync_managers_.part_at(address, end);
        const std::size_t count = part.stop - address;
        if (part.channel < 0) {
            any |= access_plain(side, write, address, data, count, at);
        } else {
            const auto n = static_cast<unsigned>(part.channel);
            if (const auto shift = sync_managers_.open(n, side, write, address, part.stop, events)) {
                const bool done = address < reg::kProcessRam
                                      ? access_plain(side, write, address, data, count, at)
                                      : access_ram(write, address + *shift, data, count);
                if (done) sync_managers_.touched(n, side, part.stop, events);
                any |= done;
            }
        }
        data += count;
        address = part.stop;
    }
    handle(events, at);
    return any;
}

bool Esc::access_plain(Side side, bool write, std::uint32_t address, std::byte* data, std::size_t length,
                       Time at) {
    bool any = false;
    if (address < reg::kProcessRam) {
        const auto count = std::min<std::size_t>(length, reg::kProcessRam - address);
        any = !write              ? read_registers(side, address, data, count, at)
              : side == Side::pdi ? write_registers_pdi(address, data, count, at)
                                  : write_registers(address, data, count);
        data += count;
        length -= count;
        address += static_cast<std::uint32_t>(count);
    }
    if (length == 0) return any;
    if (write && side == Side::ecat && !writable(address)) return any;
    return access_ram(write, address, data, length) || any;
}

bool Esc::access_ram(bool write, std::uint32_t address, std::byte* data, std::size_t length) {
    const std::size_t at = address - reg::kProcessRam;
    if (at >= ram_.size()) return false;
    const auto count = std::min(length, ram_.size() - at);
    if (write)
        std::memcpy(ram_.data() + at, data, count);
    else
        std::memcpy(data, ram_.data() + at, count);
    return count != 0;
}

bool Esc::read_registers(Side side, std::uint32_t address, std::byte* data, std::size_t length, Time at) {
    const auto flags = registers_.flags_in(address, length);
    if ((flags & access::kRead) == 0) return false;
    if ((flags & access::kDynamic) != 0) refresh(address, length, side, at);
    const auto bytes = registers_.bytes();
    for (std::size_t i = 0; i < length; ++i)
        if ((registers_.flags(static_cast<std::uint32_t>(address + i)) & access::kRead) != 0)
            data[i] = bytes[address + i];
    if ((flags & access::kReadEffect) != 0) was_read(address, length, side);
    return true;
}

// May the master write here at all? ESC data sheets, "Write protection".
bool Esc::writable(std::uint32_t address) const {
    const auto protects = [this](wire::Register r) {
        return (registers_.get<std::uint8_t>(r.address) & 1) != 0;
    };
    if (protects(reg::kEscWriteProtection) && !esc_writes_enabled_)
        return address == reg::kEscWriteEnable.address || address == reg::kWriteRegisterEnable.address;
    if (address < reg::kUserRam && protects(reg::kWriteRegisterProtection) && !register_writes_enabled_)
        return address == reg::kEscWriteEnable.address || address == reg::kWriteRegisterEnable.address;
    return true;
}

bool Esc::write_registers(std::uint32_t address, const std::byte* data, std::size_t length) {
    if (address >= reg::kUserRam) {  // no shadow buffers there
        if (!writable(address)) return false;
        std::copy_n(data, length, registers_.bytes().begin() + address);
        return true;
    }
    const bool al_blocked = al_control_unread_;
    bool any = false;
    for (std::uint32_t a = address; a < address + length && !any; ++a) {
        const bool blocked = al_blocked && a >= reg::kAlControl.address && a < reg::kAlControl.end();
        any = (registers_.flags(a) & access::kEcatWrite) != 0 && !blocked && writable(a);
    }
    if (!any) return false;
    if (address >=
        kDigitalOutputs) {  // process data, handed over by its SyncManager and not by a shadow buffer
        for (std::size_t i = 0; i < length; ++i)
            if ((registers_.flags(static_cast<std::uint32_t>(address + i)) & access::kEcatWrite) != 0)
                registers_.bytes()[address + i] = data[i];
        return true;
    }
    if (writes_ == kMaxWrites || write_bytes_used_ + length > write_bytes_.size())
        return true;  // only FMMUs mapped over each other get here: more octets than a frame has
    const auto covers = [&](wire::Register r) {
        return address <= r.address && r.address < address + length;
    };
    if (covers(reg::kWriteRegisterEnable)) register_writes_enabled_ = true;
    if (covers(reg::kEscWriteEnable)) esc_writes_enabled_ = true;
    std::copy_n(data, length, write_bytes_.begin() + static_cast<std::ptrdiff_t>(write_bytes_used_));
    write_list_[writes_++] = {static_cast<std::uint16_t>(address), static_cast<std::uint16_t>(length),
                              static_cast<std::uint16_t>(write_bytes_used_)};
    write_bytes_used_ += length;
    return true;
}

bool Esc::write_registers_pdi(std::uint32_t address, const std::byte* data, std::size_t length, Time at) {
    bool any = false;
    bool effect = false;
    for (std::size_t i = 0; i < length; ++i) {
        const auto a = static_cast<std::uint32_t>(address + i);
        const auto flags = registers_.flags(a);
        if ((flags & access::kPdiWrite) == 0) continue;
        const bool sii = a >= reg::kSiiControl.address && a < reg::kSiiData.end();
        if (sii && !sii_.accepts(true)) continue;
        registers_.bytes()[a] = data[i];
        any = true;
        effect |= (flags & access::kWriteEffect) != 0;
    }
    if (effect) written(address, length, true, at);
    return any;
}

// --- FMMUs: ETG.1000.4 "Fieldbus memory management unit" ---

void Esc::reload_mappings() {
    mapping_count_ = 0;
    std::uint64_t first = UINT64_MAX;
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
        mappings_[mapping_count_++] = {
            start,  end,     std::uint64_t{f.physical_start} * 8 + f.physical_start_bit,
            f.read, f.write, f.logical_start_bit == 0 && f.logical_end_bit == 7 && f.physical_start_bit == 0};
        first = std::min(first, start / 8);
        last = std::max(last, (end - 1) / 8);
    }
    logical_first_ = mapping_count_ == 0 ? 1 : static_cast<std::uint32_t>(first);
    logical_last_ =
        mapping_count_ == 0 ? 0 : static_cast<std::uint32_t>(std::min<std::uint64_t>(last, UINT32_MAX));
    ++configuration_;
}

std::uint16_t Esc::ecat_logical(bool read, bool write, std::uint32_t address, MutableBytes data, Time at) {
    bool any_read = false;
    bool any_write = false;
    if (read && write) {
        if ((description_.features & wire::features::kLrwNotSupported) != 0) return 0;
        // What goes into the slave is what came in, even where its own data goes out at the same place.
        bool reads = false;
        bool writes = false;
        for (unsigned n = 0; n < mapping_count_; ++n)
            reads |= mappings_[n].read, writes |= mappings_[n].write;
        if (reads && writes) {
            const auto end = std::min<std::uint64_t>(std::uint64_t{logical_last_} + 1,
                                                     std::uint64_t{address} + data.size());
            const std::uint64_t begin = std::max<std::uint64_t>(logical_first_, address);
            if (begin >= end) return 0;
            const auto window =
                data.subspan(static_cast<std::size_t>(begin - address), static_cast<std::size_t>(end - begin));
            std::array<std::byte, wire::kMaxFrameBytes> out;
            std::copy(window.begin(), window.end(), out.begin());
            const auto shadow = MutableBytes(out).first(window.size());
            logical_reads(static_cast<std::uint32_t>(begin), shadow, at, any_read);
            for (unsigned n = 0; n < mapping_count_; ++n)
                if (mappings_[n].write) any_write |= map(mappings_[n], true, address, data, at);
            std::copy(shadow.begin(), shadow.end(), window.begin());
            return static_cast<std::uint16_t>((any_read ? 1 : 0) + (any_write ? 2 : 0));
        }
    }
    if (write)
        for (unsigned n = 0; n < mapping_count_; ++n)
            if (mappings_[n].write) any_write |= map(mappings_[n], true, address, data, at);
    if (read) logical_reads(address, data, at, any_read);
    return static_cast<std::uint16_t>((any_read ? 1 : 0) + (!any_write ? 0 : read ? 2 : 1));
}

// Backwards, so that the lowest number has the last word where FMMUs overlap.
void Esc::logical_reads(std::uint32_t address, MutableBytes data, Time at, bool& any) {
    for (unsigned n = mapping_count_; n-- > 0;)
        if (mappings_[n].read) any |= map(mappings_[n], false, address, data, at);
}

bool Esc::map(const Mapping& mapping, bool write, std::uint32_t address, MutableBytes data, Time at) {
    const std::uint64_t first = std::max(mapping.logical, std::uint64_t{address} * 8);
    const std::uint64_t end = std::min(mapping.logical_end, (std::uint64_t{address} + data.size()) * 8);
    if (first >= end) return false;
    if (!mapping.octets) return map_bits(mapping, write, first, end, address, data, at);
    const auto physical = static_cast<std::uint32_t>((mapping.physical + (first - mapping.logical)) / 8);
    return access(Side::ecat, write, physical, data.data() + (first / 8 - address),
                  static_cast<std::size_t>((end - first) / 8), at);
}

// Bits that do not lie on octets. A write leaves the slave's other bits of an octet as they are.
bool Esc::map_bits(const Mapping& mapping, bool write, std::uint64_t first, std::uint64_t end,
                   std::uint32_t address, MutableBytes data, Time at) {
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

// What a write of these octets would overwrite.
void Esc::before_write(std::uint32_t address, MutableBytes into) const {
    for (std::size_t i = 0; i < into.size(); ++i) {
        const auto a = static_cast<std::uint32_t>(address + i);
        if (a < reg::kProcessRam) {
            into[i] = registers_.bytes()[a];
        } else if (const auto at = sync_managers_.write_address(a) - reg::kProcessRam; at < ram_.size()) {
            into[i] = ram_[at];
        }
    }
}

std::vector<std::byte> Esc::peek(std::uint16_t address, std::size_t count) const {
    std::vector<std::byte> octets(count);
    for (std::size_t i = 0; i < count; ++i) {
        const auto a = address + i;
        if (a < reg::kProcessRam)
            octets[i] = registers_.bytes()[a];
        else if (a - reg::kProcessRam < ram_.size())
            octets[i] = ram_[a - reg::kProcessRam];
    }
    return octets;
}

}  // namespace margay::sim
