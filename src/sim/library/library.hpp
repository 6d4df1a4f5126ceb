// The devices of the library, which execute the slave stack, by name.
#pragma once

#include "sim/devices.hpp"
#include "sim/library/model.hpp"

namespace margay::sim {

// All devices, in the order of their names in device_names().
[[nodiscard]] std::span<const Blueprint* const> blueprints();

// Each device has a file of its own.
extern const Blueprint kDigitalIo;
extern const Blueprint kAnalogIo;
extern const Blueprint kEncoder;
extern const Blueprint kDrive;
extern const Blueprint kSoeDrive;
extern const Blueprint kBootloader;
extern const Blueprint kOpenBootloader;
extern const Blueprint kOddDevice;
extern const Blueprint kVoeDevice;
extern const Blueprint kAoeGateway;
extern const Blueprint kEoeGateway;
extern const Blueprint kDcBridge;
extern const Blueprint kSplitIo;
extern const Blueprint kModularIo;

// Creates the SII image of a device, with the current PDO assignment of `dictionary`.
[[nodiscard]] std::vector<std::byte> sii_of(const Blueprint& blueprint, const subdevice::ObjectDictionary& dictionary);

// Creates a device: its SII image is generated from description and dictionary, and its firmware is ready to start.
[[nodiscard]] Device build(const Blueprint& blueprint);

}  // namespace margay::sim
