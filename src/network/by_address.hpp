// Slaves by their station addresses.
#pragma once

#include "network/network.hpp"

namespace margay {

// Finds slaves of the table by their station addresses. Most slaves have the same order in the ring and in the table,
// so each search begins behind the slave that was found last.
class ByAddress {
  public:
    explicit ByAddress(Network& network) : network_(network) {}
    // nullptr: no slave of the table has this address.
    [[nodiscard]] Slave* find(std::uint16_t address) {
        for (std::size_t n = 0; n < network_.count; ++n) {
            if (last_ >= network_.count) last_ = 0;
            Slave& slave = network_.slave(++last_);
            if (slave.station_address.value == address) return &slave;
        }
        return nullptr;
    }

  private:
    Network& network_;
    std::size_t last_ = 0;
};

}  // namespace margay
