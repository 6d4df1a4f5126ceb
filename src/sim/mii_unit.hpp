// MII management, registers 0x0510–0x051B, and the PHYs: one PHY per MII port, with the number of the port as its
// address (ETG.1000.4 "MII management"; IEEE 802.3 clause 22 for the registers of a PHY).
#pragma once

#include "sim/register_file.hpp"

#include <margay/time.hpp>

namespace margay::sim {

class MiiUnit {
  public:
    void power_up(RegisterFile& registers, const EscDescription& chip);
    void written(std::uint32_t address, std::size_t length, bool from_pdi, Time at);
    void set_link(unsigned port, bool link);
    void settle(Time now);

  private:
    void finish();
    void show(std::uint16_t status);
    [[nodiscard]] std::uint16_t phy_register(unsigned port, unsigned number) const;

    RegisterFile* registers_ = nullptr;
    std::array<bool, kMaxPorts> present_{};
    std::array<bool, kMaxPorts> link_{};
    std::array<std::array<std::uint16_t, 32>, kMaxPorts> written_{};
    Time done_ = kNever;
    std::uint16_t command_ = 0;
};

}  // namespace margay::sim
