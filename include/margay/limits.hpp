// The sizes of a context. The caller sets them before init(); nothing grows afterwards. init() refuses a limit that is
// out of its range (Errc::invalid_argument; detail: the Argument) and describe() names the limit.
#pragma once

#include <cstdint>

namespace margay {

struct Limits {
    // At least 1. Expected but missing slaves count too.
    std::uint16_t slaves = 64;
    // How many slaves one operation (scan, state change …) works on at the same time; the other slaves wait. 0: all
    // slaves.
    std::uint16_t tasks = 0;
    // Frames on the wire at the same time, 1 to 128.
    std::uint16_t frames = 64;
    // Groups of process data, 1 to 256.
    std::uint16_t groups = 4;
    // The number of frames of one cycle of all groups together, at least 1.
    std::uint16_t process_frames = 8;
    // Emergencies that the context keeps for each slave until the application reads them. 0: none are kept, but
    // their events are still reported.
    std::uint16_t emergencies = 8;
};

}  // namespace margay
