// The sizes of a context. The caller sets them before init(); nothing grows afterwards.
#pragma once

#include <cstdint>

namespace margay {

// `slaves` counts expected but missing slaves too; `slaves` and `frames` are at least 1.
struct Limits {
    std::uint16_t slaves = 64;
    // How many slaves one operation (scan, state change …) works on at the same time; the other slaves wait. 0: all
    // slaves.
    std::uint16_t tasks = 0;
    // Frames on the wire at the same time, 1 to 128.
    std::uint16_t frames = 64;
    // Groups of process data, 1 to 256, and the number of frames of one cycle of all groups together.
    std::uint16_t groups = 4;
    std::uint16_t process_frames = 8;
    // Emergencies that the context keeps for each slave until the application reads them.
    std::uint16_t emergencies = 8;
};

}  // namespace margay
