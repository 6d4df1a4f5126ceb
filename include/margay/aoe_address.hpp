// The values of AoE that both ends use: addresses, states and transmission modes of devices (ETG.1020 "AoE").
#pragma once

#include <array>
#include <cstdint>

namespace margay {

// The address of a device with AoE: the NetID identifies a computer, a slave or a device behind a gateway; the port
// identifies a part of the device.
struct AoeNetId {
    std::array<std::uint8_t, 6> octets{};
    friend constexpr bool operator==(const AoeNetId&, const AoeNetId&) = default;
};

struct AoeAddress {
    AoeNetId net_id;
    std::uint16_t port = 0;
    friend constexpr bool operator==(const AoeAddress&, const AoeAddress&) = default;
};

// The states of an AoE device. The device defines the meaning of other numbers and of the device state.
enum class AdsState : std::uint16_t {
    invalid = 0,
    idle = 1,
    reset = 2,
    init = 3,
    start = 4,
    run = 5,
    stop = 6,
    save_config = 7,
    load_config = 8,
    power_failure = 9,
    power_good = 10,
    error = 11,
    shutdown = 12,
    suspend = 13,
    resume = 14,
    config = 15,
    reconfig = 16,
};

// When a device sends a notification: in each cycle, or when the value has changed.
enum class AoeTransmission : std::uint32_t { cyclic = 3, on_change = 4 };

}  // namespace margay
