// Esc: accesses by physical address.
#include "sim/esc.hpp"

#include <algorithm>
#include <cstring>

namespace margay::sim {

namespace {

namespace reg = wire::reg;
constexpr std::uint32_t kAddressSpace = 0x10000;

}  // namespace

bool Esc::ecat_read(std::uint32_t address, MutableBytes data, Time at) {
    return access(Side::ecat, false, address, data.data(), data.size(), at);
}

bool Esc::ecat_write(std::uint32_t address, Bytes data, Time at) {
    return access(Side::ecat, true, address, const_cast<std::byte*>(data.data()), data.size(), at);
}

// Splits an access into parts with one owner each: a SyncManager, or none.
bool Esc::access(Side side, bool write, std::uint32_t address, std::byte* data, std::size_t length, Time at) {
    const auto end = static_cast<std::uint32_t>(std::min<std::size_t>(address + length, kAddressSpace));
    if (side == Side::ecat) now_ = std::max(now_, at);
    const bool triggers = write && side == Side::ecat && sync_managers_.any_single();
    if (!sync_managers_.any_enabled()) {
        const bool done = address < end && access_plain(side, write, address, data, end - address, at);
        if (done && triggers) sync_managers_.wrote_singles(address, end);
        return done;
    }
    bool any = false;
    SyncManagers::Events events;
    while (address < end) {
        const auto part = sync_managers_.part_at(address, end);
        const std::size_t count = part.stop - address;
        if (part.channel < 0) {
            const bool done = access_plain(side, write, address, data, count, at);
            if (done && triggers) sync_managers_.wrote_singles(address, part.stop);
            any |= done;
        } else {
            const auto n = static_cast<unsigned>(part.channel);
            const bool allowed = !write || side == Side::pdi || writable(address);
            if (const auto shift =
                    allowed ? sync_managers_.open(n, side, write, address, part.stop, events) : std::nullopt) {
                const bool done = address < reg::kProcessRam ? access_plain(side, write, address, data, count, at)
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

bool Esc::access_plain(Side side, bool write, std::uint32_t address, std::byte* data, std::size_t length, Time at) {
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

// Whether the master may write to this address. ESC data sheets, "Write protection".
bool Esc::writable(std::uint32_t address) const {
    if (!protected_) return true;
    const auto protects = [this](wire::Register r) { return (registers_.get<std::uint8_t>(r.address) & 1) != 0; };
    if (protects(reg::kEscWriteProtection) && !esc_writes_enabled_)
        return address == reg::kEscWriteEnable.address || address == reg::kWriteRegisterEnable.address;
    if (address < reg::kUserRam && protects(reg::kWriteRegisterProtection) && !register_writes_enabled_)
        return address == reg::kEscWriteEnable.address || address == reg::kWriteRegisterEnable.address;
    return true;
}

bool Esc::write_registers(std::uint32_t address, const std::byte* data, std::size_t length) {
    if (address >= reg::kUserRam) {  // user RAM has no shadow buffers
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
    if (address >= kDigitalOutputs) {  // process data: handed over by its SyncManager, not by a shadow buffer
        for (std::size_t i = 0; i < length; ++i)
            if ((registers_.flags(static_cast<std::uint32_t>(address + i)) & access::kEcatWrite) != 0)
                registers_.bytes()[address + i] = data[i];
        return true;
    }
    if (writes_ == kMaxWrites || write_bytes_used_ + length > write_bytes_.size())
        return true;  // only overlapping FMMUs can cause this, because they write more octets than the frame contains
    const auto covers = [&](wire::Register r) { return address <= r.address && r.address < address + length; };
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
    if (address < reg::kSiiData.end() && address + length > reg::kSiiConfig.address) settle_sii(at);
    for (std::size_t i = 0; i < length; ++i) {
        const auto a = static_cast<std::uint32_t>(address + i);
        const auto flags = registers_.flags(a);
        if ((flags & access::kPdiWrite) == 0) continue;
        const bool sii = a >= reg::kSiiControl.address && a < reg::kSiiData.end();
        if (sii && !sii_.accepts(true)) continue;
        if (dc_on_ && a > reg::kCyclicUnitControl.address && a < reg::kLatch0Status.address &&
            !sync_registers_are_pdis(a))
            continue;
        registers_.bytes()[a] = data[i];
        any = true;
        effect |= (flags & access::kWriteEffect) != 0;
    }
    if (effect) written(address, length, true, at);
    return any;
}

std::vector<std::byte> Esc::peek(std::uint16_t address, std::size_t count) const {
    sync_managers_.settle();
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
