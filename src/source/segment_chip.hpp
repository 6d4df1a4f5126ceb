// Applies the description of a simulated slave to its chip and its EEPROM.
#pragma once

#include "sim/esc_description.hpp"
#include "source/description_reader.hpp"
#include "util/bytes.hpp"

namespace margay::hosted {

// Writes the serial number and the alias of a description into an image.
[[nodiscard]] Fault adjust_image(const DescriptionReader& reader, const toml::table& table, MutableBytes image);
// Applies all chip settings of a description.
[[nodiscard]] Fault adjust_chip(const DescriptionReader& reader, const toml::table& table, sim::EscDescription& chip);

}  // namespace margay::hosted
