// How much of everything a context has. The sizes are the caller's; nothing grows afterwards.
#pragma once

#include <cstdint>

namespace margay {

struct Limits {
    std::uint16_t slaves = 64;
    // Slaves that are worked on at the same time by one operation (scan, state change …); the others wait their turn.
    // 0: all.
    std::uint16_t tasks = 0;
    // Frames in flight at once, 1 to 128.
    std::uint16_t frames = 64;
    // Groups of process data, 1 to 256, and the frames that all of them together are exchanged with in a cycle.
    std::uint16_t groups = 4;
    std::uint16_t process_frames = 8;
    // Emergencies that are kept of each slave until they are read.
    std::uint16_t emergencies = 8;
};

}  // namespace margay
