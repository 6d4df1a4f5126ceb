// Waiting for a resource of the kernel that a closed program has had.
#pragma once

#include <cerrno>
#include <chrono>

namespace margay {

// The kernel frees the queue of a closed XDP socket, and the interface of a closed program, some time after the close:
// a program that starts when another one has just ended finds them busy for some milliseconds. `step` is tried again
// for this time, however long one attempt takes. `clock` has now() and wait(milliseconds).
template <class Clock, class Step>
int once_free(Clock clock, Step step) {
    constexpr std::chrono::milliseconds kRelease{1000};
    constexpr std::chrono::milliseconds kTryAgain{5};
    const auto give_up = clock.now() + kRelease;
    int error = step();
    while (error == -EBUSY && clock.now() < give_up) {
        clock.wait(kTryAgain);
        error = step();
    }
    return error;
}

}  // namespace margay
