// The library's devices that run the slave stack, by name.
#pragma once

#include "sim/devices.hpp"
#include "sim/library/model.hpp"

namespace margay::sim {

// All kinds, in the order of their names in device_names().
[[nodiscard]] std::span<const Blueprint* const> blueprints();

// Each in a file of its own.
extern const Blueprint kDigitalIo;
extern const Blueprint kAnalogIo;
extern const Blueprint kEncoder;
extern const Blueprint kDrive;
extern const Blueprint kSoeDrive;
extern const Blueprint kBootloader;
extern const Blueprint kOddDevice;

// The SII image of a kind, with PDO assignment as `dictionary` has it now.
[[nodiscard]] std::vector<std::byte> sii_of(const Blueprint& blueprint, const subdevice::ObjectDictionary& dictionary);

// A device of that kind: its SII image generated from description and dictionary, its firmware ready to start.
[[nodiscard]] Device build(const Blueprint& blueprint);

}  // namespace margay::sim
