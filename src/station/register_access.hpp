// Register access to one slave by its station address. Each function returns an awaitable that needs no coroutine
// frame:
//
//     auto status = co_await read<std::uint16_t>(station, wire::reg::kAlStatus, Step::read_state);
//     const auto status = co_await required(read<std::uint16_t>(station, wire::reg::kAlStatus, Step::read_state));
//
// required() ends the sequence with the error, if there is one.
// A reply whose working counter is not 1 is an error: the slave at this address did not take part.
#pragma once

#include "link/engine.hpp"
#include "wire/esc.hpp"

#include <margay/task.hpp>

#include <array>

namespace margay {

// One slave, as the protocol sequences address it.
struct Station {
    Engine& engine;
    StationAddress address;
    std::uint16_t number = 0;  // of the slave, for errors
    [[nodiscard]] Arena& arena() const { return engine.arena(); }
    [[nodiscard]] Error error(Errc code, Step step, std::uint16_t index = 0) const;
};

// Converts the reply to a datagram for one station into an error. Code none: the slave took part.
[[nodiscard]] Error error_of_reply(const Station& station, Reply reply, Step step, std::uint16_t register_address);
[[nodiscard]] Error error_of_reply(const Station& station, const Datagram& datagram, Step step,
                                   std::uint16_t register_address);

// Whether the error shows that the slave does not answer at its address: the frame came back with a working counter of
// zero. A lost frame or a full arena says nothing about the slave.
[[nodiscard]] bool does_not_answer(const Error& error);

// Whether one datagram can access these octets of the register space.
[[nodiscard]] constexpr bool is_register_range(std::uint16_t address, std::size_t bytes) {
    return bytes > 0 && bytes <= wire::kMaxDatagramData && address + bytes <= 0x10000;
}

// The base of the awaitables of registers: the values of the registers, of 1 to 8 octets, are in `bytes_`.
class RegisterWait : public DatagramWait {
  public:
    ~RegisterWait();
    RegisterWait(const RegisterWait&) = delete;
    RegisterWait& operator=(const RegisterWait&) = delete;
    [[nodiscard]] bool await_suspend(std::coroutine_handle<> h) noexcept;
    // For required(): an error ends the waiting sequence. Returns the coroutine that continues.
    [[nodiscard]] std::coroutine_handle<> require(detail::PromiseBase& waiting) noexcept;

  protected:
    static constexpr std::size_t kMostBytes = 8;

    RegisterWait(const Station& station, std::uint16_t address, std::size_t bytes, Step step);  // reads
    RegisterWait(const Station& station, std::uint16_t address, std::uint32_t value, std::size_t bytes,
                 Step step);                                                              // writes
    RegisterWait(const Station& station, std::uint16_t address, Bytes bytes, Step step);  // writes
    [[nodiscard]] Error error() const noexcept;
    [[nodiscard]] Bytes bytes() const { return bytes_; }

  private:
    static std::coroutine_handle<> settle(Waiter& waiter) noexcept;

    Station station_;
    detail::PromiseBase* waiting_ = nullptr;  // with required()
    std::uint16_t address_;
    Step step_;
    std::array<std::byte, kMostBytes> bytes_{};
    Datagram datagram_;
};

// Awaitable: the register access, whose error ends the awaiting sequence. Returns the value that was read, or nothing.
template <class Wait>
class RequiredRegister {
  public:
    explicit RequiredRegister(Wait& wait) : wait_(wait) {}
    [[nodiscard]] bool await_ready() const noexcept { return false; }
    template <std::derived_from<detail::PromiseBase> P>
    [[nodiscard]] std::coroutine_handle<> await_suspend(std::coroutine_handle<P> waiting) const noexcept {
        return wait_.require(waiting.promise());
    }
    auto await_resume() const noexcept { return wait_.value(); }

  private:
    Wait& wait_;
};
template <std::derived_from<RegisterWait> Wait>
[[nodiscard]] RequiredRegister<Wait> required(Wait&& wait) {
    return RequiredRegister<Wait>(wait);
}

template <class T>
class ReadRegister : public RegisterWait {
  public:
    static_assert(sizeof(T) <= kMostBytes);
    ReadRegister(const Station& station, std::uint16_t address, Step step)
        : RegisterWait(station, address, sizeof(T), step) {}
    [[nodiscard]] T value() const noexcept { return load_le<T>(bytes()); }
    [[gnu::noinline]] Result<T> await_resume() const noexcept {
        const Error failed = error();
        return failed.code == Errc::none ? Result<T>(value()) : Result<T>(failed);
    }
};

template <class T>
[[nodiscard]] ReadRegister<T> read(const Station& station, const wire::Register& r, Step step) {
    return {station, r.address, step};
}

class WriteRegister : public RegisterWait {
  public:
    WriteRegister(const Station& station, std::uint16_t address, std::uint32_t value, std::size_t bytes, Step step)
        : RegisterWait(station, address, value, bytes, step) {}
    WriteRegister(const Station& station, std::uint16_t address, Bytes bytes, Step step)
        : RegisterWait(station, address, bytes, step) {}
    [[nodiscard]] Nothing value() const noexcept { return {}; }
    Result<> await_resume() const noexcept { return error(); }
};

template <class T>
[[nodiscard]] WriteRegister write(const Station& station, const wire::Register& r, T value, Step step) {
    static_assert(sizeof(T) <= sizeof(std::uint32_t));
    return {station, r.address, value, sizeof(T), step};
}
// Writes octets that outlive the awaitable.
[[nodiscard]] inline WriteRegister write_bytes(const Station& station, std::uint16_t address, Bytes bytes, Step step) {
    return {station, address, bytes, step};
}

}  // namespace margay
