// A segment: slaves with their ports, the cables between them, and the path of frames.
//
//     Segment segment;
//     const auto coupler = segment.add(std::make_unique<Esc>(et1100(), image));
//     const auto terminal = segment.add(std::make_unique<Esc>(et1200(), other_image));
//     segment.connect_master({coupler, 0});
//     segment.connect({coupler, 1}, {terminal, 0});
//     segment.power_up(now);
//     const auto passage = segment.process(frame, now);
//
// Building a segment allocates memory; process() and advance() do not. Either end identifies a cable. Slave numbers are
// the results of add(), from 0; they are not necessarily ring positions.
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
        bool returned = false;     // false: the frame was lost or destroyed
        unsigned master_port = 0;  // master port at which the frame returned
        Time at{};                 // time at which the first bit returned
        bool changed = false;      // the frame passed at least one ESC, so it may have changed
    };

    // Probability of faults on the path of a frame. The sequence of random numbers depends only on the seed.
    struct Noise {
        double lost = 0;  // 0 … 1
        // The FCS becomes wrong: the next port counts an error, and the NIC of the master drops the frame.
        double corrupted = 0;
        std::uint64_t seed = 1;
    };

    // --- Building ---
    std::uint32_t add(std::unique_ptr<Esc> esc);
    // Connects a cable. Returns false when a port is not free or does not exist.
    bool connect(PortRef a, PortRef b, Duration cable = std::chrono::nanoseconds(5));
    bool connect_master(PortRef to, unsigned master_port = 0, Duration cable = std::chrono::nanoseconds(50));
    // Removes the cable from both of its ports.
    void disconnect(PortRef end);
    // Switches all slaves on.
    void power_up(Time now);

    // --- Running ---
    // Sends a frame from a master port through the segment and changes it in place. `duration` is the time of the frame
    // on the wire; its effects occur when its last octet has passed. Calls must be in order of time.
    Passage process(MutableBytes frame, Time now, unsigned master_port = 0, Duration duration = Duration::zero());
    // Advances firmware, EEPROMs, watchdogs and clocks of the slaves to `now`.
    void advance(Time now);
    // The next time at which advance() has work to do.
    [[nodiscard]] Time next_event() const { return next_event_; }

    // --- Faults ---
    void set_cable(PortRef end, bool intact);  // breaks or repairs the wire
    void set_master_cable(unsigned master_port, bool intact);
    void set_power(std::uint32_t slave, bool on, Time now);
    void set_noise(const Noise& noise);
    [[nodiscard]] const Noise& noise() const { return noise_; }
    // The next frame that passes the cable at `end`, in the direction of `end`, is lost or corrupted.
    void lose_next(PortRef end) { next_fault_ = {end, FaultKind::loss}; }
    void corrupt_next(PortRef end) { next_fault_ = {end, FaultKind::corruption}; }

    // Reads the state of all slaves again. Call it when registers of slaves were changed other than by a frame.
    void reconsider();
    // An interrupt of the firmware of a slave from outside, for example from its Ethernet port.
    void interrupt(std::uint32_t slave, Time now);

    // --- Inspection ---
    [[nodiscard]] std::size_t size() const { return nodes_.size(); }
    [[nodiscard]] Esc& slave(std::uint32_t number) { return *nodes_[number].esc; }
    [[nodiscard]] const Esc& slave(std::uint32_t number) const { return *nodes_[number].esc; }
    [[nodiscard]] bool powered(std::uint32_t number) const { return nodes_[number].powered; }
    [[nodiscard]] bool master_link(unsigned master_port = 0) const;
    // Slaves in the order in which they process a frame from this master port.
    [[nodiscard]] std::vector<std::uint32_t> order(unsigned master_port = 0);

  private:
    enum class FaultKind : std::uint8_t { none, loss, corruption };
    enum class Peer : std::uint8_t { nobody, slave, master };

    struct Cable {
        Peer peer = Peer::nobody;
        PortRef to;  // slave and port; for a master, its port is in `slave`
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
        bool recovery = false;  // all ports are closed, so frames pass port 0 although DL status shows it closed
        [[nodiscard]] bool passes(unsigned port) const { return open[port] || (recovery && port == 0); }
        std::array<Cable, kMaxPorts> cables{};
    };
    struct Visit {  // a processing unit on the path
        std::uint32_t slave = 0;
        Duration offset{};
        bool marks_circulating = false;  // the frame arrived through port 0, which is closed because it has no link
    };
    struct Hop {  // a port at which the frame arrives
        PortRef at;
        Duration offset{};
        std::uint32_t visits_before = 0;
    };
    // The values that the commands compare with, in one array per value for the whole path, so that a datagram can be
    // matched without access to the slaves.
    struct Route {
        std::vector<Visit> visits;
        std::vector<Hop> hops;
        // By visit; negative: the frame did not arrive at this port.
        std::vector<std::array<Duration, kMaxPorts>> ports;
        std::vector<std::uint32_t> visit_of;  // by slave
        std::vector<Esc*> esc;
        std::vector<std::uint32_t> configuration;
        std::vector<std::uint16_t> station;
        std::vector<std::uint32_t> alias;  // above 0xFFFF: alias not enabled
        std::vector<std::uint32_t> logical_first;
        std::vector<std::uint32_t> logical_last;
        std::vector<std::uint16_t> irq;
        std::uint16_t any_irq = 0;
        bool aliases = false;
        std::uint32_t circulating_at = kNobody;  // first visit that marks the frame as circulating
        bool returns = false;
        bool knocks = false;  // the frame ends at a closed port that it opens (automatic closing)
        PortRef knocks_at;
        unsigned exit_port = 0;
        Duration exit_offset{};
        std::uint64_t built = 0;
    };
    struct Fault {
        PortRef end;
        FaultKind kind = FaultKind::none;
    };
    struct Frame;  // a frame on its way

    static constexpr std::uint32_t kNobody = UINT32_MAX;

    // Paths (segment_route.cpp)
    [[nodiscard]] bool linked(const Node& node, unsigned port) const;
    // `opened`: a port in mode "auto close" that opens; kMaxPorts: none.
    void update_ports(std::uint32_t slave, bool control_written, unsigned opened = kMaxPorts);
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
    void keep_events();

    std::vector<Node> nodes_;
    // Esc::next_event() of all slaves, kNever of a slave without power. In an array of its own: it is searched each
    // time that a slave has work to do.
    std::vector<Time> due_;
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
