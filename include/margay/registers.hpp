// Access to the registers and the memory of a slave's ESC, by the addresses of the data sheets, for uses that no other
// function covers. The library does not know what the application writes here, and may write the same registers itself.
//
//     margay::RegisterReadRequest request;         // beside the cycle: sent in the frames of the cycle
//     request.slave = 2;
//     request.address = 0x092C;                    // system time difference
//     request.data = octets;
//     margay::submit(ctx, request);
//
//     const auto difference = margay::read_register<std::uint32_t>(ctx, 2, 0x092C);   // waits
#pragma once

#include <margay/borrowed.hpp>
#include <margay/coe.hpp>
#include <margay/request.hpp>

namespace margay {

// Reads `data.size()` octets from `address` on, in one datagram: 1 to 1486 octets, not beyond 0xFFFF. The caller's
// memory.
struct RegisterReadRequest : SlaveRequest {
    RegisterReadRequest();
    std::uint16_t address = 0;
    std::span<std::byte> data;
};

// Writes `data` from `address` on, in one datagram, within the same bounds. A lost frame is sent again: a write with an
// effect at each access may have the effect twice. Nothing is written while the slave is missing (missing_slave), or
// after it was away, until its identity is compared (identity_unread): another device may have its station address now.
// Only a supervision, or readstate(), shows that the slave was away: without a supervision call readstate() first after
// a pause of more than a second.
struct RegisterWriteRequest : SlaveRequest {
    RegisterWriteRequest();
    std::uint16_t address = 0;
    Borrowed<std::byte> data;
};

// The same as functions that wait; see wait(). Errors: unknown_slave, invalid_argument (no octets, or too many),
// working_counter (the slave does not answer, or has no such register), no_frame; missing_slave and identity_unread
// (writing only).
Result<> read_register(Context& ctx, std::uint16_t slave, std::uint16_t address, std::span<std::byte> data);
Result<> write_register(Context& ctx, std::uint16_t slave, std::uint16_t address, std::span<const std::byte> data);

template <SdoValue T>
Result<T> read_register(Context& ctx, std::uint16_t slave, std::uint16_t address) {
    std::array<std::byte, sizeof(T)> octets{};
    const auto read = read_register(ctx, slave, address, std::span<std::byte>(octets));
    if (!read) return read.error();
    return value_from_octets<T>(octets);
}

template <SdoValue T>
Result<> write_register(Context& ctx, std::uint16_t slave, std::uint16_t address, T value) {
    const auto octets = octets_of(value);
    return write_register(ctx, slave, address, std::span<const std::byte>(octets));
}

}  // namespace margay
