// A kind of request, with the buffers that it uses.
#pragma once

#include "storm/operations.hpp"

#include <array>

namespace margay::storm {

using namespace std::chrono_literals;

template <class R>
struct Of final : Operation {
    R r;
    std::vector<std::byte> data = std::vector<std::byte>(2048);
    std::array<LineErrors, 32> lines{};
    ~Of() override { r.cancel(); }  // before its buffers are destroyed
    Result<> submit(Context& ctx) override { return margay::submit(ctx, r); }
    Request& request() override { return r; }
    void cancel() override { r.cancel(); }
};

template <class R>
std::unique_ptr<Operation> make() {
    return std::make_unique<Of<R>>();
}

template <class R>
Of<R>& as(Operation& operation) {
    return static_cast<Of<R>&>(operation);
}

inline std::uint16_t slave_number(std::uint32_t slave) { return static_cast<std::uint16_t>(slave); }

template <class R>
void address_mail(R& r, std::uint32_t slave, std::uint32_t b) {
    r.slave = slave_number(slave);
    r.priority = static_cast<std::uint8_t>(b % 4);
    constexpr std::array<Duration, 6> kTimeouts{0ms, 0ms, 2000ms, 100ms, 5ms, 1us};
    r.timeout = kTimeouts[(b >> 2) % kTimeouts.size()];
}

using Set = void (*)(Operation& operation, std::uint32_t slave, std::uint32_t a, std::uint32_t b);

}  // namespace margay::storm
