// Register access to one slave by its station address. Each function returns an awaitable that needs no coroutine
// frame:
//
//     auto status = co_await read<std::uint16_t>(station, wire::reg::kAlStatus, Step::read_state);
// A reply whose working counter is not 1 is an error: the slave at this address did not take part.
#pragma once

#include "link/engine.hpp"
#include "wire/esc.hpp"

#include <margay/result.hpp>

#include <array>

namespace margay {

// One slave, as the protocol sequences address it.
struct Station {
    Engine& engine;
    StationAddress address;
    std::uint16_t number = 0;  // of the slave, for errors
    [[nodiscard]] Arena& arena() const { return engine.arena(); }
    [[nodiscard]] Error error(Errc code, Step step, std::uint16_t index = 0) const {
        return {.code = code, .step = step, .slave = number, .index = index};
    }
};

// Converts the reply to a datagram for one station into an error. Code none: the slave took part.
[[nodiscard]] inline Error error_of_reply(const Station& station, Reply reply, Step step,
                                          std::uint16_t register_address) {
    if (reply.ok() && reply.wkc == 1) return {};
    if (!reply.ok()) {
        Error error = station.error(reply.errc, step, register_address);
        error.detail = reply.detail();
        return error;
    }
    Error error = station.error(Errc::working_counter, step, register_address);
    error.expected = 1;
    error.actual = reply.wkc;
    return error;
}

// Whether the error shows that the slave does not answer at its address: the frame came back with a working counter of
// zero. A lost frame or a full arena says nothing about the slave.
[[nodiscard]] inline bool does_not_answer(const Error& error) {
    return error.code == Errc::working_counter && error.actual == 0;
}

// Whether one datagram can access these octets of the register space.
[[nodiscard]] constexpr bool is_register_range(std::uint16_t address, std::size_t bytes) {
    return bytes > 0 && bytes <= wire::kMaxDatagramData && address + bytes <= 0x10000;
}

template <class T>
class ReadRegister : public DatagramWait {
  public:
    ReadRegister(const Station& station, std::uint16_t address, Step step)
        : station_(station),
          address_(address),
          step_(step),
          datagram_(station.engine.link(), wire::Command::FPRD, {station.address, address}, MutableBytes(bytes_)) {}
    bool await_suspend(std::coroutine_handle<> h) noexcept { return submit(h, datagram_); }
    Result<T> await_resume() const noexcept {
        const Error error = error_of_reply(station_, datagram_.reply(), step_, address_);
        return error.code == Errc::none ? Result<T>(load_le<T>(bytes_)) : Result<T>(error);
    }

  private:
    Station station_;
    std::uint16_t address_;
    Step step_;
    std::array<std::byte, sizeof(T)> bytes_{};
    Datagram datagram_;
};

template <class T>
[[nodiscard]] ReadRegister<T> read(const Station& station, wire::Register r, Step step) {
    return {station, r.address, step};
}

// Writes octets that the awaitable itself contains.
template <std::size_t N>
class WriteRegister : public DatagramWait {
  public:
    WriteRegister(const Station& station, std::uint16_t address, const std::array<std::byte, N>& bytes, Step step)
        : station_(station),
          address_(address),
          step_(step),
          bytes_(bytes),
          datagram_(station.engine.link(), wire::Command::FPWR, {station.address, address}, Bytes(bytes_)) {}
    bool await_suspend(std::coroutine_handle<> h) noexcept { return submit(h, datagram_); }
    Result<> await_resume() const noexcept {
        const Error error = error_of_reply(station_, datagram_.reply(), step_, address_);
        return error.code == Errc::none ? Result<>() : Result<>(error);
    }

  private:
    Station station_;
    std::uint16_t address_;
    Step step_;
    std::array<std::byte, N> bytes_;
    Datagram datagram_;
};

template <class T>
[[nodiscard]] WriteRegister<sizeof(T)> write(const Station& station, wire::Register r, T value, Step step) {
    std::array<std::byte, sizeof(T)> bytes{};
    store_le<T>(bytes, 0, value);
    return {station, r.address, bytes, step};
}
template <std::size_t N>
[[nodiscard]] WriteRegister<N> write_bytes(const Station& station, std::uint16_t address,
                                           const std::array<std::byte, N>& bytes, Step step) {
    return {station, address, bytes, step};
}

}  // namespace margay
