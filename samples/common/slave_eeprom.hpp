// The EEPROM of a slave on a segment, accessed through the public API.
#pragma once

#include "common/eeprom.hpp"

#include <margay/context.hpp>

namespace margay::samples {

// config_init() must have succeeded for `ctx`, and `ctx` must outlive the object.
class SlaveEeprom final : public Eeprom {
  public:
    SlaveEeprom(Context& ctx, std::uint16_t number) : ctx_(ctx), number_(number) {}

    [[nodiscard]] std::string name() const override { return "slave " + std::to_string(number_); }
    [[nodiscard]] std::string read(std::uint32_t word, MutableBytes into) override;
    [[nodiscard]] Written write(std::uint32_t word, Bytes octets) override;

  private:
    Context& ctx_;
    std::uint16_t number_;
};

}  // namespace margay::samples
