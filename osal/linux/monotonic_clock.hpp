// CLOCK_MONOTONIC as a Time. All parts for Linux use this clock.
#pragma once

#include <margay/time.hpp>

#include <time.h>

namespace margay {

[[nodiscard]] inline Time monotonic_now() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return Time(std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec));
}

}  // namespace margay
