// The EEPROM of a slave through the registers of its ESC, by station address or by position.
#pragma once

#include "compat/soem/facade.hpp"

#include <optional>

namespace margay::soem {

class Eeprom {
  public:
    // `address`: a station address, or 1 minus the number of the slave for a position.
    Eeprom(Session& session, std::uint16_t address, bool by_position)
        : session_(session), address_(address), by_position_(by_position) {}

    // Waits until the interface is not busy; the last status is in `status`.
    bool wait_ready(std::uint16_t& status, Duration timeout);
    // Begins to read at a word address. False: the interface is busy, or the slave does not answer.
    bool begin_read(std::uint16_t word, Duration timeout);
    // Waits for the words. The upper half has a meaning only if the chip reads eight octets at once.
    std::optional<std::uint64_t> end_read(Duration timeout);
    std::optional<std::uint64_t> read(std::uint16_t word, Duration timeout);
    bool write(std::uint16_t word, std::uint16_t value, Duration timeout);

  private:
    bool get(std::uint16_t reg, std::span<std::byte> data);
    bool put(std::uint16_t reg, std::span<std::byte> data);
    bool command(std::uint16_t command, std::uint16_t word);
    void repeat_read();

    Session& session_;
    std::uint16_t address_;
    bool by_position_;
};

// Takes the EEPROM from the processor of the slave, and reads at a word address. nullopt: it cannot be read.
[[nodiscard]] std::optional<std::uint64_t> read_sii(ecx_contextt& context, std::uint16_t slave, std::uint16_t word);

}  // namespace margay::soem
