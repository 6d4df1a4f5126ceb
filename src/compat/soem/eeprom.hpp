// The EEPROM of a slave through the registers of its ESC, by station address or by position.
#pragma once

#include "compat/soem/facade.hpp"

#include <optional>

namespace margay::soem {

// Calls of several threads use the EEPROMs of a session one after the other. The library may read EEPROMs at the same
// time.
class Eeprom {
  public:
    // `address`: a station address, or 1 minus the number of the slave for a position.
    Eeprom(Session& session, std::uint16_t address, bool by_position)
        : session_(session), address_(address), by_position_(by_position) {}

    // Waits until the interface is not busy; the last status is in `status`.
    bool wait_ready(std::uint16_t& status, Duration timeout);
    // The words at a word address. The upper half has a meaning only if the chip reads eight octets at once.
    std::optional<std::uint64_t> read(std::uint16_t word, Duration timeout);
    // A reading in two calls: the first starts it, the second returns the words.
    void begin_half(std::uint16_t word, Duration timeout);
    std::optional<std::uint64_t> end_half(Duration timeout);
    bool write(std::uint16_t word, std::uint16_t value, Duration timeout);

  private:
    // The registers of the interface, read by one datagram, so that the data belongs to the address.
    struct Look {
        std::uint16_t status = 0;
        std::uint16_t word = 0;
        std::uint64_t data = 0;  // in the octet order of the wire
    };
    bool look(Look& shown);
    bool wait_ready(Look& shown, Duration timeout);
    bool command(std::uint16_t command, std::uint16_t word, std::uint16_t data = 0);
    bool clear_errors(const Look& shown);
    bool begin(std::uint16_t word, Duration timeout);
    std::optional<std::uint64_t> end(std::uint16_t word, Duration timeout);

    Session& session_;
    std::uint16_t address_;
    bool by_position_;
};

// Takes the EEPROM from the processor of the slave, and reads at a word address. nullopt: it cannot be read.
[[nodiscard]] std::optional<std::uint64_t> read_sii(ecx_contextt& context, std::uint16_t slave, std::uint16_t word);

}  // namespace margay::soem
