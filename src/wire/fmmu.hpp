// FMMU entity, 16 octets from 0x0600 (ETG.1000.4 table "Fieldbus memory management unit (FMMU) entity").
#pragma once

#include "util/bytes.hpp"
#include "wire/esc.hpp"

#include <margay/address.hpp>

namespace margay::wire {

struct Fmmu {
    LogicalAddress logical_start;
    std::uint16_t length_bytes = 0;  // number of logical octets, including partially used octets
    std::uint8_t logical_start_bit = 0;
    std::uint8_t logical_end_bit = 0;  // inclusive
    std::uint16_t physical_start = 0;
    std::uint8_t physical_start_bit = 0;
    bool read = false;   // copies the memory of the slave into the datagram
    bool write = false;  // copies the datagram into the memory of the slave
    bool active = false;
    friend constexpr bool operator==(const Fmmu&, const Fmmu&) = default;
};

struct FmmuLayout {
    using logical_start = Field<std::uint32_t, 0>;
    using length = Field<std::uint16_t, 4>;
    using logical_start_bit = Field<std::uint8_t, 6>;
    using logical_end_bit = Field<std::uint8_t, 7>;
    using physical_start = Field<std::uint16_t, 8>;
    using physical_start_bit = Field<std::uint8_t, 10>;
    using type = Field<std::uint8_t, 11>;
    using activate = Field<std::uint8_t, 12>;
};

// `at` must have reg::kFmmuStride octets.
[[nodiscard]] constexpr Fmmu load_fmmu(Bytes at) {
    using L = FmmuLayout;
    const auto type = L::type::load(at);
    return {.logical_start = {L::logical_start::load(at)},
            .length_bytes = L::length::load(at),
            .logical_start_bit = static_cast<std::uint8_t>(L::logical_start_bit::load(at) & 7),
            .logical_end_bit = static_cast<std::uint8_t>(L::logical_end_bit::load(at) & 7),
            .physical_start = L::physical_start::load(at),
            .physical_start_bit = static_cast<std::uint8_t>(L::physical_start_bit::load(at) & 7),
            .read = (type & 1) != 0,
            .write = (type & 2) != 0,
            .active = (L::activate::load(at) & 1) != 0};
}

constexpr void store_fmmu(MutableBytes at, const Fmmu& f) {
    using L = FmmuLayout;
    L::logical_start::store(at, f.logical_start.value);
    L::length::store(at, f.length_bytes);
    L::logical_start_bit::store(at, f.logical_start_bit);
    L::logical_end_bit::store(at, f.logical_end_bit);
    L::physical_start::store(at, f.physical_start);
    L::physical_start_bit::store(at, f.physical_start_bit);
    L::type::store(at, static_cast<std::uint8_t>((f.read ? 1 : 0) | (f.write ? 2 : 0)));
    L::activate::store(at, f.active ? 1 : 0);
    for (std::size_t i = L::activate::end; i < reg::kFmmuStride; ++i) at[i] = std::byte{0};
}

}  // namespace margay::wire
