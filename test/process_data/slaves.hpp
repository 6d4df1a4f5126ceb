// Makes slaves for the tests of process data.
#pragma once

#include "wire/sync_manager.hpp"

#include <margay/slave.hpp>

#include <vector>

namespace margay {

inline constexpr std::uint8_t kOutputControl = 0x64;
inline constexpr std::uint8_t kInputControl = 0x20;

inline Slave make_slave(std::uint16_t number, std::uint8_t fmmus = 8, std::uint8_t sync_managers = 8) {
    Slave slave;
    slave.number = number;
    slave.station_address.value = static_cast<std::uint16_t>(0x1000 + number);
    slave.dl.fmmus = fmmus;
    slave.dl.sync_managers = sync_managers;
    slave.dl.ram_kib = 8;
    return slave;
}

inline ProcessSm outputs_sm(std::uint8_t number, std::uint16_t start, std::uint32_t bits) {
    return {number, Direction::outputs, kOutputControl, start, bits};
}
inline ProcessSm inputs_sm(std::uint8_t number, std::uint16_t start, std::uint32_t bits) {
    return {number, Direction::inputs, kInputControl, start, bits};
}

// A slave with outputs in SyncManager 2 at 0x1100 and inputs in SyncManager 3 at 0x1400; sizes in bits.
inline Slave io_slave(std::uint16_t number, std::uint32_t output_bits, std::uint32_t input_bits) {
    Slave slave = make_slave(number);
    if (output_bits > 0) slave.config.add(outputs_sm(2, 0x1100, output_bits));
    if (input_bits > 0) slave.config.add(inputs_sm(3, 0x1400, input_bits));
    return slave;
}

}  // namespace margay
