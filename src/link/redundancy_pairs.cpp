// The pairs of frames: which one the next frame takes.
#include "link/redundancy.hpp"

namespace margay {

// The pair in turn is in use: the next one that is not in use. Where there is none, the frame of the next open pair was
// lost. The receiving thread holds a pair for a moment while it looks at a copy, and the pair may be unused after that.
// So an open pair is taken only if all pairs were open.
FramePair* Redundancy::find_pair(std::span<FramePair> pairs, std::size_t& next) noexcept {
    constexpr unsigned kMostLooks = 100;  // the system may have interrupted the receiving thread
    const auto turn = [&]() -> FramePair& {
        FramePair& pair = pairs[next];
        next = next + 1 == pairs.size() ? 0 : next + 1;
        return pair;
    };
    bool held = true;
    for (unsigned looks = 0; held && looks < kMostLooks; ++looks) {
        held = false;
        for (std::size_t tries = 0; tries < pairs.size(); ++tries) {
            FramePair& pair = turn();
            if (hold(pair, FramePair::unused)) return &pair;
            held |= pair.state.load(std::memory_order_relaxed) != FramePair::open;
        }
    }
    for (std::size_t tries = 0; tries < pairs.size(); ++tries)
        if (FramePair& pair = turn(); hold(pair)) return &pair;
    return nullptr;
}

}  // namespace margay
