// The SII EEPROM interface of an ESC, registers 0x0500–0x050F, and the EEPROM behind it (ETG.1000.4 "SII
// access"; ESC data sheets, section "SII EEPROM").
#pragma once

#include "sim/register_file.hpp"

#include <margay/time.hpp>

#include <utility>
#include <vector>

namespace margay::sim {

class SiiUnit {
  public:
    // The EEPROM's content; words behind its end read as erased (0xFFFF) and do not take writes.
    explicit SiiUnit(std::vector<std::byte> image) : image_(std::move(image)) {}

    // Power: the configuration area is loaded as the chip does it. True when it was good.
    bool power_up(RegisterFile& registers, const SiiTiming& timing);

    // The master or the PDI has written [address, address + length) of the unit's registers.
    void written(std::uint16_t address, std::size_t length, bool from_pdi, Time at);
    // Do writes of this side to 0x0502–0x050F count now? Not while a command runs or the other side owns the
    // interface.
    [[nodiscard]] bool accepts(bool pdi) const;

    // Completes what is due by `now`. Returns when it wants to be called again.
    Time settle(Time now);

    // EEPROM emulation: the firmware answers commands (0x0502 bit 5). True while one waits for it.
    [[nodiscard]] bool emulated() const { return timing_.emulated; }
    [[nodiscard]] bool waits_for_pdi() const { return busy_ && emulated(); }
    // A reload has put new values into the configuration registers; asked once.
    [[nodiscard]] bool take_reloaded() { return std::exchange(reloaded_, false); }

    // Faults: the next `count` commands are not acknowledged by the EEPROM.
    void fail_next(unsigned count) { nacks_ = count; }
    [[nodiscard]] Bytes image() const { return image_; }
    [[nodiscard]] std::vector<std::byte>& image() { return image_; }

  private:
    bool load_configuration(bool power_up);
    void command(std::uint16_t control, bool write_enabled, Time at);
    void finish();
    void read_block();
    void show();
    [[nodiscard]] std::byte octet(std::size_t at) const { return at < image_.size() ? image_[at] : std::byte{0xFF}; }

    std::vector<std::byte> image_;
    RegisterFile* registers_ = nullptr;
    SiiTiming timing_;
    std::uint16_t command_ = 0;
    std::uint16_t errors_ = 0;
    std::uint16_t write_data_ = 0;
    std::uint32_t word_ = 0;
    bool busy_ = false;
    bool reloaded_ = false;
    Time done_ = kNever;
    Time stored_ = Time::min();  // when the EEPROM has stored the last word written
    bool acknowledged_ = true;   // the EEPROM was not storing a word when the running command came
    unsigned nacks_ = 0;
};

}  // namespace margay::sim
