#include "sim/sync_managers.hpp"

#include "sim/events.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace margay::sim {

namespace {

namespace reg = wire::reg;
using Layout = wire::SyncManagerLayout;

std::uint16_t field(unsigned n, std::size_t offset) {
    return static_cast<std::uint16_t>(reg::sync_manager(n).address + offset);
}

}  // namespace

void SyncManagers::Channel::reset() {
    opened[0] = opened[1] = false;
    full = fresh = written = false;
    interrupts = 0;
    write_buffer = 0;
    read_buffer = 1;
    latest = 2;
}

void SyncManagers::power_up(RegisterFile& registers, unsigned count, std::uint32_t ram_bytes) {
    registers_ = &registers;
    count_ = count;
    ram_end_ = reg::kProcessRam + ram_bytes;
    channels_.fill({});
    enabled_ = closing_ = singles_ = triggered_ = 0;
    stale_ = (1u << count_) - 1;
}

bool SyncManagers::reconfigure(unsigned n) {
    auto& channel = channels_[n];
    const auto raw = wire::load_sync_manager(Bytes(registers_->bytes()).subspan(reg::sync_manager(n).address));
    const auto pdi = registers_->get<std::uint8_t>(field(n, Layout::pdi_control::offset));
    const bool locked = (pdi & wire::sm_pdi_control::kDeactivate) != 0;
    const bool was_on = channel.enabled && !channel.locked_by_pdi;
    channel.start = raw.physical_start;
    channel.length = raw.length_bytes;
    channel.control = raw.control;
    channel.activate = raw.activate;
    channel.locked_by_pdi = locked;
    const bool over_data = raw.physical_start >= kDigitalOutputs;
    channel.enabled = raw.enabled() && raw.length_bytes > 1 && over_data;
    const bool single = raw.enabled() && raw.length_bytes == 1 && !locked && over_data;
    singles_ = single ? singles_ | (1u << n) : singles_ & ~(1u << n);
    const bool in_ram = channel.start >= reg::kProcessRam;
    channel.three = !channel.mailbox() && in_ram && channel.start + 3 * channel.length <= ram_end_;
    channel.reachable = !in_ram || channel.stop() <= ram_end_;
    const bool anew = was_on != (channel.enabled && !locked);
    if (anew) {
        channel.reset();
        closing_ &= ~(1u << n);
    }
    enabled_ = channel.enabled ? enabled_ | (1u << n) : enabled_ & ~(1u << n);
    show(n);
    return anew;
}

SyncManagers::Part SyncManagers::part_at(std::uint32_t address, std::uint32_t end) const {
    Part part{-1, end};
    for (auto left = enabled_; left != 0; left &= left - 1) {
        const auto n = static_cast<unsigned>(std::countr_zero(left));
        const auto& channel = channels_[n];
        if (channel.stop() <= address || channel.start >= part.stop) continue;
        if (channel.start > address) {
            // A channel with a lower number, or with a higher number after memory without owner.
            part.stop = channel.start;
        } else {
            part.channel = static_cast<int>(n);
            part.stop = std::min(part.stop, channel.stop());
            break;  // the lowest number has priority when channels overlap
        }
    }
    return part;
}

std::optional<std::uint32_t> SyncManagers::open(unsigned n, Side side, bool write, std::uint32_t address,
                                                std::uint32_t stop, Events& events) {
    auto& channel = channels_[n];
    if (channel.locked_by_pdi || !channel.reachable || channel.writer_is(side) != write) return std::nullopt;
    const auto me = static_cast<std::size_t>(side);
    // "The end address cannot be accessed twice inside a frame."
    if (side == Side::ecat && ((closing_ >> n) & 1) != 0 && stop == channel.stop()) return std::nullopt;
    if (address == channel.start) {
        if (channel.mailbox() && channel.full == write) return std::nullopt;
        if (!channel.mailbox() && !write && !channel.written && channel.start >= reg::kProcessRam) return std::nullopt;
        channel.opened[me] = true;
        if (!channel.mailbox() && !write && channel.fresh) {
            std::swap(channel.read_buffer, channel.latest);
            channel.fresh = false;
        }
        channel.interrupts &=
            static_cast<std::uint8_t>(~(write ? wire::sm_status::kInterruptRead : wire::sm_status::kInterruptWrite));
        if (side == Side::pdi) {
            events.al_clear |= wire::al_event::sync_manager(n);
            events.pdi_start = true;
        } else if ((channel.control & wire::sm_control::kEcatInterrupt) != 0) {
            events.ecat_clear |= ecat_event::sync_manager(n);
        }
        show(n);
    } else if (!channel.opened[me]) {
        return std::nullopt;
    }
    if (!channel.three) return 0;
    return channel.length * (write ? channel.write_buffer : channel.read_buffer);
}

void SyncManagers::touched(unsigned n, Side side, std::uint32_t stop, Events& events) {
    if (stop != channels_[n].stop()) return;
    if (side == Side::ecat)
        closing_ |= 1u << n;
    else
        finish_access(n, side, events);
}

int SyncManagers::exactly_at(std::uint32_t start, std::uint32_t stop) const {
    const auto part = part_at(start, stop);
    if (part.channel < 0 || part.stop != stop || start < reg::kProcessRam) return -1;
    const auto& channel = channels_[static_cast<std::size_t>(part.channel)];
    return channel.start == start && channel.stop() == stop ? part.channel : -1;
}

void SyncManagers::wrote_singles(std::uint32_t address, std::uint32_t end) {
    for (auto left = singles_; left != 0; left &= left - 1) {
        const auto n = static_cast<unsigned>(std::countr_zero(left));
        const auto& channel = channels_[n];
        if (channel.ecat_writes() && channel.start >= address && channel.start < end) triggered_ |= 1u << n;
    }
}

bool SyncManagers::feeds_watchdog() const {
    for (auto left = enabled_ | singles_; left != 0; left &= left - 1) {
        const auto& channel = channels_[static_cast<std::size_t>(std::countr_zero(left))];
        if (channel.ecat_writes() && (channel.control & wire::sm_control::kWatchdogTrigger) != 0) return true;
    }
    return false;
}

void SyncManagers::frame_end(bool good, Events& events) {
    for (auto left = std::exchange(triggered_, 0u); left != 0 && good; left &= left - 1) {
        events.arrived = true;
        const auto& channel = channels_[static_cast<std::size_t>(std::countr_zero(left))];
        if ((channel.control & wire::sm_control::kWatchdogTrigger) != 0) events.watchdog = true;
    }
    for (auto left = std::exchange(closing_, 0u); left != 0; left &= left - 1) {
        const auto n = static_cast<unsigned>(std::countr_zero(left));
        if (good)
            finish_access(n, Side::ecat, events);
        else
            channels_[n].opened[0] = false;
    }
}

void SyncManagers::finish_access(unsigned n, Side side, Events& events) {
    auto& channel = channels_[n];
    channel.opened[static_cast<std::size_t>(side)] = false;
    if (side == Side::pdi) events.pdi_change = true;
    if (channel.writer_is(side)) {
        channel.interrupts |= wire::sm_status::kInterruptWrite;
        channel.full = channel.mailbox();
        channel.written = channel.fresh = true;
        std::swap(channel.write_buffer, channel.latest);
        if (side == Side::ecat) {
            events.arrived = true;
            if ((channel.control & wire::sm_control::kWatchdogTrigger) != 0) events.watchdog = true;
        }
    } else {
        channel.interrupts |= wire::sm_status::kInterruptRead;
        channel.full = false;
    }
    if (side == Side::ecat) {
        if ((channel.control & wire::sm_control::kPdiInterrupt) != 0) events.al_set |= wire::al_event::sync_manager(n);
    } else if ((channel.control & wire::sm_control::kEcatInterrupt) != 0) {
        events.ecat_set = static_cast<std::uint16_t>(events.ecat_set | ecat_event::sync_manager(n));
    }
    show(n);
}

std::optional<std::uint32_t> SyncManagers::last_written(unsigned n) const {
    const auto& channel = channels_[n];
    if (!channel.enabled || !channel.written) return std::nullopt;
    if (!channel.three) return channel.start;
    return channel.start + channel.length * (channel.fresh ? channel.latest : channel.read_buffer);
}

std::uint32_t SyncManagers::write_address(std::uint32_t address) const {
    const auto part = part_at(address, address + 1);
    if (part.channel < 0) return address;
    const auto& channel = channels_[static_cast<std::size_t>(part.channel)];
    return channel.three ? address + channel.length * channel.write_buffer : address;
}

// ETG.1000.4 table "Sync manager channel", status octet. Bits 6 and 7 show that a buffer is open: recorded on a LAN9252
// and on the FPGA of a drive, a mailbox shows 0x80 while the program writes a reply into it. A buffered channel that is
// off shows that no buffer was written (0x30).
std::uint8_t SyncManagers::status(unsigned n) const {
    const auto& channel = channels_[n];
    if (!channel.enabled || channel.locked_by_pdi)
        return channel.mailbox() ? std::uint8_t{0} : wire::sm_status::kLastBufferMask;
    unsigned status = channel.interrupts;
    if (channel.mailbox()) {
        if (channel.full) status |= wire::sm_status::kMailboxFull;
    } else {
        const unsigned last = !channel.written ? 3u : channel.fresh ? channel.latest : channel.read_buffer;
        status |= last << 4;
    }
    const auto writer = static_cast<std::size_t>(channel.ecat_writes() ? Side::ecat : Side::pdi);
    if (channel.opened[1 - writer]) status |= wire::sm_status::kReadBufferInUse;
    if (channel.opened[writer]) status |= wire::sm_status::kWriteBufferInUse;
    return static_cast<std::uint8_t>(status);
}

void SyncManagers::settle() const {
    for (auto left = std::exchange(stale_, 0u); left != 0; left &= left - 1) {
        const auto n = static_cast<unsigned>(std::countr_zero(left));
        registers_->set(field(n, Layout::status::offset), status(n));
    }
}

}  // namespace margay::sim
