#include "sim/sii_unit.hpp"

#include "wire/sii.hpp"

#include <algorithm>
#include <utility>

namespace margay::sim {

namespace {

namespace reg = wire::reg;
namespace control = wire::sii_control;

// Time until a NACK is known, on an I²C bus of 100 kHz.
constexpr Duration kAddressOctet = std::chrono::microseconds(90);
}  // namespace

bool SiiUnit::power_up(RegisterFile& registers, const SiiTiming& timing) {
    registers_ = &registers;
    timing_ = timing;
    command_ = errors_ = write_data_ = 0;
    word_ = 0;
    busy_ = reloaded_ = false;
    done_ = kNever;
    stored_ = Time::min();
    acknowledged_ = true;
    if (timing.nacks != 0) nacks_ = timing.nacks;
    const bool good = load_configuration(true);
    show();
    return good;
}

// ETG.1000.6 "Slave information interface area", words 0–7. Invalid words are not loaded.
bool SiiUnit::load_configuration(bool power_up) {
    errors_ = static_cast<std::uint16_t>(errors_ & ~(control::kChecksumError | control::kNotLoaded));
    if (image_.size() < wire::sii::kConfigurationBytes || !wire::sii::checksum_right(image_)) {
        errors_ |= control::kChecksumError | control::kNotLoaded;
        return false;
    }
    registers_->set(reg::kPdiControl.address, load_le<std::uint16_t>(image_, 0));        // and 0x0141
    registers_->set(reg::kPdiConfiguration.address, load_le<std::uint16_t>(image_, 2));  // and 0x0151
    registers_->set(reg::kSyncPulseLength.address, load_le<std::uint16_t>(image_, 4));
    registers_->set(reg::kExtendedPdiConfiguration.address, load_le<std::uint16_t>(image_, 6));
    if (power_up) registers_->set(reg::kStationAlias.address, load_le<std::uint16_t>(image_, 8));
    return true;
}

// ESC register tables, 0x0508: at a reload, an ESC with EEPROM emulation takes over the alias and the enhanced link
// detection from the data of the firmware. The rest of the configuration is fixed in such a chip.
void SiiUnit::reload_emulated() {
    const auto data = registers_->get<std::uint32_t>(reg::kSiiData.address);
    constexpr unsigned kLinks = 0xF2;
    const auto links = (data >> 16 & 1U) << 1 | (data >> 17 & 0xFU) << 4;
    const auto other = registers_->get<std::uint8_t>(reg::kEscConfiguration.address) & ~kLinks;
    registers_->set(reg::kStationAlias.address, static_cast<std::uint16_t>(data));
    registers_->set(reg::kEscConfiguration.address, static_cast<std::uint8_t>(other | links));
    reloaded_ = true;
}

bool SiiUnit::accepts(bool pdi) const {
    if (busy_) return pdi && emulated();
    const auto config = registers_->get<std::uint8_t>(reg::kSiiConfig.address);
    const bool with_pdi = (registers_->get<std::uint8_t>(reg::kSiiPdiAccess.address) & 1) != 0;
    return pdi ? with_pdi && (config & wire::sii_config::kOfferedToPdi) != 0 : !with_pdi;
}

void SiiUnit::written(std::uint16_t address, std::size_t length, bool from_pdi, Time at) {
    const std::size_t end = address + length;
    const auto covers = [&](std::size_t octet_at) { return address <= octet_at && octet_at < end; };
    if (covers(reg::kSiiConfig.address) &&
        (registers_->get<std::uint8_t>(reg::kSiiConfig.address) & wire::sii_config::kForceEcat) != 0)
        registers_->set<std::uint8_t>(reg::kSiiPdiAccess.address, 0);
    if (from_pdi && covers(reg::kSiiPdiAccess.address)) {
        const bool offered =
            (registers_->get<std::uint8_t>(reg::kSiiConfig.address) & wire::sii_config::kOfferedToPdi) != 0;
        auto taken = static_cast<std::uint8_t>(registers_->get<std::uint8_t>(reg::kSiiPdiAccess.address) & 1);
        if (!offered) taken = 0;
        registers_->set(reg::kSiiPdiAccess.address, taken);
    }
    if (covers(reg::kSiiControl.address) || covers(reg::kSiiControl.address + 1u)) {
        const auto value = registers_->get<std::uint16_t>(reg::kSiiControl.address);
        if (from_pdi && waits_for_pdi()) {  // emulation: the firmware reports the end of the command
            errors_ = static_cast<std::uint16_t>((errors_ & (control::kChecksumError | control::kNotLoaded)) |
                                                 (value & (control::kMissingAcknowledge | control::kWriteEnableError)));
            if (command_ == control::kCommandReload && (value & control::kMissingAcknowledge) == 0) reload_emulated();
            busy_ = false;
            command_ = 0;
        } else if (!busy_) {
            // The enable bit clears itself: it is valid only for a command that is written together with it.
            const bool enabled = covers(reg::kSiiControl.address) && (value & control::kWriteEnable) != 0;
            if (covers(reg::kSiiControl.address + 1u)) command(value & control::kCommandMask, enabled, at);
        }
    }
    show();
}

// A new command, including "nothing", clears the error bits of the previous command.
void SiiUnit::command(std::uint16_t what, bool write_enabled, Time at) {
    errors_ = static_cast<std::uint16_t>(errors_ & (control::kChecksumError | control::kNotLoaded));
    command_ = 0;
    if (what == 0) return;
    if (what != control::kCommandRead && what != control::kCommandWrite && what != control::kCommandReload) {
        errors_ |= control::kMissingAcknowledge;  // two commands at once
        return;
    }
    if (what == control::kCommandWrite && !write_enabled) {
        errors_ |= control::kWriteEnableError;
        return;
    }
    command_ = what;
    word_ = registers_->get<std::uint32_t>(reg::kSiiAddress.address);
    write_data_ = registers_->get<std::uint16_t>(reg::kSiiData.address);
    busy_ = true;
    if (emulated()) {
        done_ = kNever;  // until the PDI reports the end
        return;
    }
    Duration takes = what == control::kCommandRead    ? timing_.read
                     : what == control::kCommandWrite ? std::min(timing_.write_busy, timing_.write)
                                                      : timing_.reload;
    acknowledged_ = at >= stored_;
    if (!acknowledged_) takes = std::min(takes, kAddressOctet);
    done_ = at + takes;
    if (acknowledged_ && what == control::kCommandWrite) stored_ = at + timing_.write;
}

Time SiiUnit::settle(Time now) {
    if (busy_ && done_ <= now) {
        finish();
        show();
    }
    return busy_ ? done_ : kNever;
}

void SiiUnit::finish() {
    busy_ = false;
    done_ = kNever;
    const auto command = std::exchange(command_, std::uint16_t{0});
    if (!acknowledged_ || nacks_ != 0) {
        if (acknowledged_) {
            --nacks_;
            stored_ = Time::min();
        }
        errors_ |= control::kMissingAcknowledge;
        return;
    }
    if (command == control::kCommandRead) {
        read_block();
    } else if (command == control::kCommandWrite) {
        const std::size_t at = std::size_t{word_} * 2;
        if (at + 2 <= image_.size() && timing_.write_protected)
            stored_ = Time::min();  // no write cycle
        else if (at + 2 <= image_.size())
            store_le(MutableBytes(image_), at, write_data_);
        else
            errors_ |= control::kMissingAcknowledge;
    } else {
        reloaded_ = load_configuration(false);
    }
}

void SiiUnit::read_block() {
    const std::size_t count = timing_.reads_8_bytes ? 8 : 4;
    for (std::size_t i = 0; i < count; ++i)
        registers_->set(static_cast<std::uint16_t>(reg::kSiiData.address + i), octet(std::size_t{word_} * 2 + i));
}

void SiiUnit::show() {
    unsigned status = timing_.status_bits | errors_ | command_;
    if (timing_.reads_8_bytes) status |= control::kReads8Bytes;
    if (timing_.emulated) status |= control::kEmulation;
    if (busy_) status |= control::kBusy;
    registers_->set(reg::kSiiControl.address, static_cast<std::uint16_t>(status));
}

}  // namespace margay::sim
