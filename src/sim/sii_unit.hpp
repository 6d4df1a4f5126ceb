// The SII EEPROM interface of an ESC, registers 0x0500–0x050F, and its EEPROM (ETG.1000.4 "SII access"; ESC data
// sheets, section "SII EEPROM").
#pragma once

#include "sim/register_file.hpp"

#include <margay/time.hpp>

#include <utility>
#include <vector>

namespace margay::sim {

class SiiUnit {
  public:
    // The content of the EEPROM. Words after its end read as erased (0xFFFF) and cannot be written.
    explicit SiiUnit(std::vector<std::byte> image) : image_(std::move(image)) {}

    // Loads the configuration area like the chip at power-up. Returns true when the area is valid.
    bool power_up(RegisterFile& registers, const SiiTiming& timing);

    // Call it after the master or the PDI has written the registers [address, address + length).
    void written(std::uint16_t address, std::size_t length, bool from_pdi, Time at);
    // Whether writes to 0x0502–0x050F from this side are effective now. They are not while a command is executing or
    // while the other side owns the interface.
    [[nodiscard]] bool accepts(bool pdi) const;

    // Completes commands that are due at `now`. Returns the time for the next call.
    Time settle(Time now);

    // EEPROM emulation (0x0502 bit 5): the firmware executes commands. waits_for_pdi() is true while a command waits
    // for the firmware.
    [[nodiscard]] bool emulated() const { return timing_.emulated; }
    [[nodiscard]] bool waits_for_pdi() const { return busy_ && emulated(); }
    // True once after a reload has written new values into the configuration registers.
    [[nodiscard]] bool reset_reloaded() { return std::exchange(reloaded_, false); }

    // Fault injection: the EEPROM does not acknowledge the next `count` commands.
    void fail_next(unsigned count) { nacks_ = count; }
    [[nodiscard]] Bytes image() const { return image_; }
    [[nodiscard]] std::vector<std::byte>& image() { return image_; }

  private:
    bool load_configuration(bool power_up);
    void reload_emulated();
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
    Time stored_ = Time::min();  // time at which the EEPROM has stored the last written word
    bool acknowledged_ = true;   // the EEPROM was not storing a word when the current command arrived
    unsigned nacks_ = 0;
};

}  // namespace margay::sim
