#include "clock/frame_ways.hpp"

namespace margay {
namespace {

enum class Part : bool { before_unit, behind_unit };

// The ports, apart from the entry port, by which the frame leaves before or after it passes the processing unit.
// Returns their number; if `wanted` is less than this number, returns port number `wanted` of them.
std::uint8_t ports_of(const DelayNode& node, Part part, std::uint8_t wanted = UINT8_MAX) {
    std::uint8_t count = 0;
    bool passed = node.entry_port == 0;
    for (std::uint8_t port = next_port(node.entry_port); port != node.entry_port; port = next_port(port)) {
        const bool counts = (node.open >> port & 1) != 0 && passed == (part == Part::behind_unit);
        if (counts && count == wanted) return port;
        if (counts) ++count;
        passed |= port == 0;
    }
    return count;
}

// For find_ways(), arrival_ps is this time: see DelayNode.
std::int64_t away_ps(const DelayNode& node) { return node.arrival_ps; }

// The branches that the frame has passed so far, the last one on top. A branch waits until all slaves behind the
// processing unit of its first slave were found.
class Branches {
  public:
    explicit Branches(std::span<DelayNode> nodes) : nodes_(nodes) {}

    // The frame passes the processing unit of `place`. The branches at the ports before the processing unit are on top
    // of the stack.
    bool pass(std::uint16_t place) {
        DelayNode& node = of(place);
        const std::uint8_t before = ports_of(node, Part::before_unit);
        if (before != 0 && !complete_shorter(&node)) return false;
        for (std::uint8_t n = before; n-- > 0;) {
            if (top_ == 0 || waits_for(top_) != 0) return false;
            const std::uint16_t child = top_;
            top_ = below(child);
            connect(child, place, ports_of(node, Part::before_unit, n));
        }
        below(place) = top_;
        top_ = place;
        waits_for(place) = ports_of(node, Part::behind_unit);
        return true;
    }
    // The frame is back at the master.
    bool end() {
        if (!complete_shorter(nullptr) || top_ == 0 || below(top_) != 0) return false;
        connect(top_, 0, 0);
        return true;
    }

  private:
    DelayNode& of(std::uint16_t place) { return nodes_[place - 1U]; }
    // Both members are used as memory here; compute_delays() fills them again.
    std::uint16_t& below(std::uint16_t place) { return of(place).above; }
    std::uint8_t& waits_for(std::uint16_t place) { return of(place).above_port; }

    void connect(std::uint16_t child, std::uint16_t parent, std::uint8_t port) {
        of(child).parent = parent;
        of(child).parent_port = port;
    }
    // Completes the branches that cannot contain `node`, because the frame is away from their first slave for a shorter
    // time than from `node`. nullptr: there are no more slaves.
    bool complete_shorter(const DelayNode* node) {
        for (;;) {
            std::uint16_t behind = 0;
            std::uint16_t place = top_;
            for (; place != 0 && waits_for(place) == 0; place = below(place)) ++behind;
            if (place == 0) return true;
            // One of the times is not known.
            if (node != nullptr && (away_ps(*node) < 0 || away_ps(of(place)) < 0)) return false;
            if (node != nullptr && away_ps(of(place)) >= away_ps(*node)) return true;
            if (behind < waits_for(place)) return false;
            complete(place, behind);
        }
    }
    // Connects the first of the `behind` branches on top of `place` to `place`.
    void complete(std::uint16_t place, std::uint16_t behind) {
        std::uint16_t last_other = 0;
        std::uint16_t at = top_;
        for (; behind > waits_for(place); --behind) {
            last_other = at;
            at = below(at);
        }
        for (std::uint8_t n = waits_for(place); n-- > 0; at = below(at))
            connect(at, place, ports_of(of(place), Part::behind_unit, n));
        (last_other == 0 ? top_ : below(last_other)) = place;
        waits_for(place) = 0;
    }

    std::span<DelayNode> nodes_;
    std::uint16_t top_ = 0;
};

}  // namespace

bool find_ways(std::span<DelayNode> nodes) {
    Branches branches(nodes);
    for (std::size_t n = 0; n < nodes.size(); ++n)
        if (!branches.pass(static_cast<std::uint16_t>(n + 1))) return false;
    return branches.end();
}

}  // namespace margay
