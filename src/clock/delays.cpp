#include "clock/delays.hpp"

#include <iterator>

namespace margay {
namespace {

// Whether the frame passes the processing unit on its way from port `from` to port `to`. A frame from a port to the
// same port passes the whole slave.
bool passes_processing_unit(std::uint8_t from, std::uint8_t to) {
    std::uint8_t port = from;
    do {
        if (port == 0) return true;
        port = next_port(port);
    } while (port != to);
    return false;
}

bool has_neighbour(const DelayNode& node, std::uint8_t port) { return (node.neighbours >> port & 1) != 0; }

// The last port at which the frame arrives before it leaves by `port`.
std::uint8_t port_before(const DelayNode& node, std::uint8_t port) {
    std::uint8_t last = node.entry_port;
    for (std::uint8_t p = next_port(node.entry_port); p != port && p != node.entry_port; p = next_port(p))
        if (has_neighbour(node, p)) last = p;
    return last;
}

// The last port at which the frame arrives; the entry port when nothing is connected behind the slave.
std::uint8_t last_port(const DelayNode& node) { return port_before(node, node.entry_port); }

std::int64_t inner_ps(const DelayNode& node, std::uint8_t from, std::uint8_t to) {
    return passes_processing_unit(from, to) ? std::int64_t{node.processing_ns} * 1000 : 0;
}

// The time from the arrival of the frame until it has left towards the master, without the forwarding delay that every
// slave has.
std::int64_t stay_ps(const DelayNode& node) {
    const std::uint8_t last = last_port(node);
    const std::int64_t behind = last == node.entry_port ? 0 : node.times->port_ps(last);
    return behind + inner_ps(node, last, node.entry_port);
}

void find_above(std::span<DelayNode> nodes, DelayNode& node) {
    std::uint16_t at = node.parent;
    node.above_port = node.parent_port;
    node.root = static_cast<std::uint16_t>(&node - nodes.data() + 1);
    // With entry ports other than 0, a parent may come after its children in the ring. So the number of steps is
    // limited.
    for (std::size_t steps = 0; at != 0 && at <= nodes.size() && steps <= nodes.size(); ++steps) {
        if (nodes[at - 1U].timed()) {
            node.above = at;
            return;
        }
        node.above_port = nodes[at - 1U].parent_port;
        node.root = at;
        at = nodes[at - 1U].parent;
    }
    node.above = 0;
}

bool same_branch(const DelayNode& a, const DelayNode& b) {
    return a.above == b.above && (a.above == 0 ? a.root == b.root : a.above_port == b.above_port);
}

// The way of the frame through a branch: all slaves behind one port of a slave with receive times, down to the next
// slaves with receive times. Each of them has one cable towards the master, which the frame passes there and back.
class Branch {
  public:
    Branch(std::span<const DelayNode> nodes, std::size_t first) : nodes_(nodes), first_(first) {
        for (std::size_t n = 0; n < nodes.size(); ++n) {
            if (!contains(n)) continue;
            ++slaves_;
            if (nodes[n].timed()) ++timed_;
            if (nodes[n].timed()) stays_ps_ += stay_ps(nodes[n]);
        }
    }
    // Whether place `n` + 1 belongs to the branch. Slaves that do not answer are left out.
    [[nodiscard]] bool contains(std::size_t n) const {
        const DelayNode& node = nodes_[n];
        if (!same_branch(nodes_[first_], node)) return false;
        return node.timed() || node.parent == 0 || node.parent > nodes_.size() ||
               has_neighbour(nodes_[node.parent - 1U], node.parent_port);
    }
    [[nodiscard]] std::int64_t stays() const { return stays_ps_; }
    [[nodiscard]] std::int64_t passes() const { return 2 * std::int64_t{slaves_}; }
    // How often the frame has passed a cable when it arrives at place `n` + 1: it has passed the cable of each earlier
    // slave twice, except the cables between the master and this slave, which it has passed once.
    [[nodiscard]] std::int64_t passes_until(std::size_t n) const {
        std::int64_t cables = 0;
        for (std::size_t k = 0; k <= n; ++k)
            if (contains(k)) ++cables;
        return 2 * cables - depth(n);
    }
    // Whether the branch is a line with one slave with receive times at its end.
    [[nodiscard]] bool is_line() const { return timed_ == 1 && depth(first_) == slaves_; }

  private:
    [[nodiscard]] std::int64_t depth(std::size_t n) const {
        std::int64_t cables = 1;
        for (std::uint16_t at = nodes_[n].parent;
             at != nodes_[n].above && at != 0 && at <= nodes_.size() && cables <= std::ssize(nodes_); ++cables)
            at = nodes_[at - 1U].parent;
        return cables;
    }

    std::span<const DelayNode> nodes_;
    std::size_t first_;
    std::int64_t slaves_ = 0;
    std::int64_t timed_ = 0;
    std::int64_t stays_ps_ = 0;
};

// Places all slaves with receive times behind one port of `above`, beginning with `first`. Usually there is one such
// slave; behind a junction without receive times there are several, which the frame passes one after the other.
void place_branch(std::span<DelayNode> nodes, std::size_t first) {
    const DelayNode& head = nodes[first];
    const Branch branch(nodes, first);
    const bool is_line = branch.is_line();
    std::int64_t begin = 0;
    std::int64_t rest = 0;  // the time in the cables
    if (head.above != 0) {
        const DelayNode& above = nodes[head.above - 1U];
        const std::uint8_t before = port_before(above, head.above_port);
        const std::int64_t left = before == above.entry_port ? 0 : above.times->port_ps(before);
        const std::int64_t through = inner_ps(above, before, head.above_port);
        rest = above.times->port_ps(head.above_port) - left - through - branch.stays();
        begin = above.arrival_ps + left + through;
    }
    for (std::size_t n = first; n < nodes.size(); ++n) {
        DelayNode& node = nodes[n];
        if (!node.timed() || !same_branch(head, node)) continue;
        node.arrival_ps = begin + (rest > 0 ? rest * branch.passes_until(n) / branch.passes() : 0);
        begin += stay_ps(node);
        node.placed = true;
        node.assumed = !is_line          ? static_cast<std::uint16_t>(n + 1)
                       : node.above != 0 ? nodes[node.above - 1U].assumed
                                         : std::uint16_t{0};
        node.passed_ps = node.arrival_ps;
        if (node.times->has_processing())
            node.passed_ps += node.times->processing_ps();
        else
            node.passed_ps += node.times->port_ps(port_before_unit(node));
    }
}

}  // namespace

void compute_delays(std::span<DelayNode> nodes) {
    for (DelayNode& node : nodes) {
        node.placed = false;
        find_above(nodes, node);
    }
    // Usually one pass is enough. In a reversed way, parents come after their children, and further passes are needed.
    for (bool goes_on = true; goes_on;) {
        goes_on = false;
        for (std::size_t n = 0; n < nodes.size(); ++n) {
            const bool ready = nodes[n].above == 0 || nodes[nodes[n].above - 1U].placed;
            if (!nodes[n].timed() || nodes[n].placed || !ready) continue;
            place_branch(nodes, n);
            goes_on = true;
        }
    }
}

std::uint8_t port_before_unit(const DelayNode& node) {
    std::uint8_t last = node.entry_port;
    for (std::uint8_t port = node.entry_port; port != 0;) {
        port = next_port(port);
        if (has_neighbour(node, port)) last = port;
    }
    return last;
}

std::int64_t away_ps(const DelayNode& node, std::uint8_t port) {
    if (!node.timed() || !has_neighbour(node, port)) return 0;
    const std::uint8_t before = port_before(node, port);
    const std::int64_t left = before == node.entry_port ? 0 : node.times->port_ps(before);
    return node.times->port_ps(port) - left - inner_ps(node, before, port);
}

std::int64_t way_back_ps(const DelayNode& node) {
    return node.timed() ? stay_ps(node) - (node.passed_ps - node.arrival_ps) : 0;
}

std::int64_t delay_between_ns(const DelayNode& reference, const DelayNode& node) {
    const std::int64_t ps = node.passed_ps - reference.passed_ps;
    return (ps + (ps < 0 ? -500 : 500)) / 1000;
}

}  // namespace margay
