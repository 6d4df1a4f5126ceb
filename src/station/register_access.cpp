#include "station/register_access.hpp"

namespace margay {

Error Station::error(Errc code, Step step, std::uint16_t index) const {
    return {.code = code, .step = step, .slave = number, .index = index};
}

Error error_of_reply(const Station& station, Reply reply, Step step, std::uint16_t register_address) {
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

Error error_of_reply(const Station& station, const Datagram& datagram, Step step, std::uint16_t register_address) {
    return error_of_reply(station, datagram.reply(), step, register_address);
}

bool does_not_answer(const Error& error) { return error.code == Errc::working_counter && error.actual == 0; }

RegisterWait::RegisterWait(const Station& station, std::uint16_t address, std::size_t bytes, Step step)
    : station_(station),
      address_(address),
      step_(step),
      datagram_(station.engine.link(), wire::Command::FPRD, {station.address, address},
                MutableBytes(bytes_).first(bytes)) {}

RegisterWait::RegisterWait(const Station& station, std::uint16_t address, std::uint32_t value, std::size_t bytes,
                           Step step)
    : RegisterWait(station, address, Bytes(bytes_).first(bytes), step) {
    store_le<std::uint32_t>(bytes_, 0, value);
}

RegisterWait::RegisterWait(const Station& station, std::uint16_t address, Bytes bytes, Step step)
    : station_(station),
      address_(address),
      step_(step),
      datagram_(station.engine.link(), wire::Command::FPWR, {station.address, address}, bytes) {}

RegisterWait::~RegisterWait() = default;

bool RegisterWait::await_suspend(std::coroutine_handle<> h) noexcept { return submit(h, datagram_); }

std::coroutine_handle<> RegisterWait::require(detail::PromiseBase& waiting) noexcept {
    waiting_ = &waiting;
    settle_by(settle);
    return submit(waiting.self(), datagram_) ? std::noop_coroutine() : settle(*this);
}

std::coroutine_handle<> RegisterWait::settle(Waiter& waiter) noexcept {
    const auto& wait = static_cast<RegisterWait&>(waiter);
    detail::PromiseBase& waiting = *wait.waiting_;
    waiting.error = wait.error();
    return waiting.error.code == Errc::none ? waiter.handle : detail::end_of_task(waiting);
}

Error RegisterWait::error() const noexcept { return error_of_reply(station_, datagram_, step_, address_); }

}  // namespace margay
