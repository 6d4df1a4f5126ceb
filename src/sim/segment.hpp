// A segment: slaves with their ports, the cables between them, and the way a frame takes through all of it.
//
//     Segment segment;
//     const auto coupler = segment.add(std::make_unique<Esc>(et1100(), image));
//     const auto terminal = segment.add(std::make_unique<Esc>(et1200(), other_image));
//     segment.connect_master({coupler, 0});
//     segment.connect({coupler, 1}, {terminal, 0});
//     segment.power_up(now);
//     const auto passage = segment.process(frame, now);
//
// Building it up allocates; process() and advance() do not. A cable is named by the end farther from the
// master or by any of its two ends. Slave numbers are those that add() gave, from 0, and need not be ring
// positions.
#pragma once

#include "sim/esc.hpp"
#include "util/bytes.hpp"
#include "wire/datagram.hpp"

#include <margay/time.hpp>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

namespace margay::sim {

struct PortRef {
    std::uint32_t slave = 0;
    std::uint8_t port = 0;
    friend constexpr bool operator==(PortRef, PortRef) = default;
};

class Segment {
  public:
    static constexpr unsigned kMasterPorts = 2;

    struct Passage {
        bool returned = false;     // else the frame was lost on the way, or destroyed
        unsigned master_port = 0;  // where it came back
        Time at{};                 // when its first bit did
        bool changed = false;      // it may have been altered: it passed at least one ESC
    };

    // How often what happens to a frame somewhere on its way; by a fixed sequence from the seed.
    struct Noise {
        double lost = 0;       // 0 … 1
        double corrupted = 0;  // the FCS no longer fits: counted at the next port, and dropped by the master's NIC
        std::uint64_t seed = 1;
    };

    // --- Building ---
    std::uint32_t add(std::unique_ptr<Esc> esc);
    // Plugs a cable in. Both ports must be free; false otherwise, or when one does not exist.
    bool connect(PortRef a, PortRef b, Duration cable = std::chrono::nanoseconds(5));
    bool connect_master(PortRef to, unsigned master_port = 0, Duration cable = std::chrono::nanoseconds(50));
    // Pulls the cable out of both its ports.
    void disconnect(PortRef end);
    // Switches everything on.
    void power_up(Time now);

    // --- Running ---
    // Sends a frame from a master port through the segment, altering it in place. `duration` is its time on
    // the wire; what it causes happens when its last octet is through. Calls must come in order of time.
    Passage process(MutableBytes frame, Time now, unsigned master_port = 0, Duration duration = Duration::zero());
    // Lets the slaves' firmware, EEPROMs, watchdogs and clocks run up to `now`.
    void advance(Time now);
    // When advance() has something to do.
    [[nodiscard]] Time next_event() const { return next_event_; }

    // --- What happens to segments ---
    void set_cable(PortRef end, bool intact);  // wire break and heal
    void set_power(std::uint32_t slave, bool on, Time now);
    void set_noise(const Noise& noise);
    [[nodiscard]] const Noise& noise() const { return noise_; }
    // The next frame that passes the cable at `end` towards it is lost, or damaged.
    void lose_next(PortRef end) { next_fault_ = {end, FaultKind::loss}; }
    void corrupt_next(PortRef end) { next_fault_ = {end, FaultKind::corruption}; }

    // Somebody else than a frame has changed registers of slaves: looks at all of them anew.
    void reconsider();

    // --- Looking in ---
    [[nodiscard]] std::size_t size() const { return nodes_.size(); }
    [[nodiscard]] Esc& slave(std::uint32_t number) { return *nodes_[number].esc; }
    [[nodiscard]] const Esc& slave(std::uint32_t number) const { return *nodes_[number].esc; }
    [[nodiscard]] bool powered(std::uint32_t number) const { return nodes_[number].powered; }
    [[nodiscard]] bool master_link(unsigned master_port = 0) const;
    // Slaves in the order in which a frame from this master port is processed.
    [[nodiscard]] std::vector<std::uint32_t> order(unsigned master_port = 0);

  private:
    enum class FaultKind : std::uint8_t { none, loss, corruption };
    enum class Peer : std::uint8_t { nobody, slave, master };

    struct Cable {
        Peer peer = Peer::nobody;
        PortRef to;  // slave, or master port in `slave`
        Duration delay{};
        bool intact = true;
    };
    struct Node {
        std::unique_ptr<Esc> esc;
        std::uint32_t loops_written = 0;
        std::uint32_t configuration = 0;
        bool powered = false;
        std::array<bool, kMaxPorts> link{};
        std::array<bool, kMaxPorts> open{};
        std::array<Cable, kMaxPorts> cables{};
    };
    struct Visit {  // a processing unit on the way
        std::uint32_t slave = 0;
        Duration offset{};
        bool marks_circulating = false;  // came through a port 0 that is closed for want of a link
    };
    struct Hop {  // a port that the frame comes in at
        PortRef at;
        Duration offset{};
        std::uint32_t visits_before = 0;
    };
    // What the commands look for, side by side for the whole way: a datagram is matched without touching the
    // slaves.
    struct Route {
        std::vector<Visit> visits;
        std::vector<Hop> hops;
        std::vector<std::array<Duration, kMaxPorts>> ports;  // by visit; negative: nothing came in there
        std::vector<std::uint32_t> visit_of;                 // by slave
        std::vector<Esc*> esc;
        std::vector<std::uint32_t> configuration;
        std::vector<std::uint16_t> station;
        std::vector<std::uint32_t> alias;  // above 0xFFFF: not enabled
        std::vector<std::uint32_t> logical_first;
        std::vector<std::uint32_t> logical_last;
        std::vector<std::uint16_t> irq;
        std::uint16_t any_irq = 0;
        bool aliases = false;
        std::uint32_t circulating_at = kNobody;  // first visit that marks
        bool returns = false;
        unsigned exit_port = 0;
        Duration exit_offset{};
        std::uint64_t built = 0;
    };
    struct Fault {
        PortRef end;
        FaultKind kind = FaultKind::none;
    };
    struct Frame;  // one in passage

    static constexpr std::uint32_t kNobody = UINT32_MAX;

    // Ways (segment_route.cpp)
    [[nodiscard]] bool linked(const Node& node, unsigned port) const;
    void update_ports(std::uint32_t slave, bool control_written);
    void update_all_ports();
    Route& route(unsigned master_port);
    void build(Route& route, unsigned master_port);
    void walk(Route& route, PortRef entry, Duration t);
    void note(Route& route, std::uint32_t visit);
    void topology_changed();
    void note_change(std::uint32_t slave);

    // Frames (segment_frame.cpp)
    void run_datagrams(Frame& frame);
    void run(Frame& frame, std::size_t offset);
    void physical(Frame& frame, std::uint32_t visit, std::size_t offset, bool read, bool write, bool merge);
    void logical(Frame& frame, std::size_t offset, bool read, bool write);
    void multiple_write(Frame& frame, std::size_t offset, bool by_position);
    void touch(Frame& frame, std::uint32_t visit);
    void end_frame(Frame& frame);
    void pick_fault(Frame& frame);
    void count_errors(const Frame& frame);
    void schedule(std::uint32_t slave);

    std::vector<Node> nodes_;
    std::array<Cable, kMasterPorts> masters_{};
    std::array<Route, kMasterPorts> routes_;
    std::vector<std::uint32_t> touched_;
    std::uint64_t topology_ = 1;
    Time next_event_ = kNever;
    Noise noise_;
    std::uint64_t random_ = 1;
    Fault next_fault_;
    bool noisy_ = false;
};

}  // namespace margay::sim
