// A whole segment as the master knows it: the engine with its link, and the table of slaves.
#pragma once

#include "link/engine.hpp"
#include "mailbox/mailboxes.hpp"
#include "network/clocks.hpp"
#include "network/emergencies.hpp"
#include "network/process_data.hpp"
#include "network/slave_marks.hpp"
#include "network/topology.hpp"
#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/detail/writable_ring.hpp>
#include <margay/error_log.hpp>
#include <margay/event.hpp>
#include <margay/expected.hpp>
#include <margay/slave.hpp>
#include <margay/supervision.hpp>

#include <algorithm>
#include <atomic>
#include <span>

namespace margay {

struct ScanSettings {
    Duration link_timeout = std::chrono::seconds(5);
    Duration init_timeout = std::chrono::seconds(2);  // for all slaves to reach INIT
    std::uint16_t first_station_address = 0x1001;
};

// The memory for the slaves of a context; both spans have the same length.
struct SlaveTable {
    std::span<Slave> slaves;
    std::span<SlaveMarks> marks;
};

// Work on a slave that no request waits for: what follows a transition (settle_request()), or the supervision brings
// the slave to its target. When the slave is lost meanwhile, the supervision ends the work.
struct SlaveWork : ListNode {
    SlaveWork(std::uint16_t number, Time begin) : slave(number), since(begin) {}
    // After this time a request that needs the slave ends the work.
    static constexpr Duration kLongest = std::chrono::seconds(10);
    std::uint16_t slave;
    // When the work began to execute commands and hooks of the application; kNever: it does not.
    Time since;
    // The state to which the work brings the slave, or has brought it; NONE: to a lower state than it had. When the
    // target of the slave becomes lower than this state, the hook that keeps the slave from it ends.
    AlState upwards_to = AlState::none;
    TaskReference sequence{};
};

// The writer's side of the events.
class WritableEvents : public EventQueue {
  public:
    using EventQueue::add;
    using EventQueue::use;
};

struct Expectation;
struct CoeFeature;
struct OverlapFeature;
struct BootFeature;
struct Network;

// What init_redundant() adds to the network.
class RedundancyPart {
  public:
    // Reports what has changed since the last call, and notes which end of the ring reaches each slave.
    virtual void watch(Network& network) = 0;
    // The same for the clocks, in each poll: clocks that frames may have misled meanwhile are not in sync.
    virtual void note_change(Network& network) = 0;
    // An error when the NICs are connected wrongly.
    [[nodiscard]] virtual Error check() const = 0;
    // The division of the ring between the two NICs, for find_topology().
    [[nodiscard]] virtual RingParts parts() const = 0;
    // For a scan, before it assigns addresses: finds out which NIC is at the beginning of the ring, if only the ports
    // of the slaves show this.
    [[nodiscard]] virtual Task<Result<>> find_beginning(Network& network) = 0;
    // Call it when the places of the ring were read. False: they are counted from the wrong NIC, and must be read
    // again.
    [[nodiscard]] virtual bool begins_right(Network& network) = 0;
    // Whether slaves may be started and delays may be measured: see set_automatic_restoring().
    [[nodiscard]] virtual bool may_restore() const = 0;
    // A NIC has not accepted its last frame, and the ring is still regarded as whole: its cable has probably broken
    // between both copies of a frame.
    [[nodiscard]] virtual bool is_breaking() const = 0;
    // How often the ring was broken or closed.
    [[nodiscard]] virtual std::uint32_t changes() const = 0;
    // For a scan: reads the ports of all slaves again if a cable has broken or was connected since there were
    // `changes`. Otherwise the ports that the scan has read would not belong to the same ring.
    [[nodiscard]] virtual Task<Result<>> read_ports_again(Network& network, std::uint32_t changes) = 0;

    // The ring was broken when its ports were read, and is whole now: read_ports() finds the way through all slaves.
    [[nodiscard]] virtual bool are_ports_old() const = 0;
    [[nodiscard]] virtual Task<Result<>> read_ports(Network& network) = 0;

    // For the measurement of delays, whose frames must return by the way they came: closes the port of the last slave
    // to the second NIC, for about a second, and sends by one NIC only. close_ring() opens the port again. Errors of
    // open_ring(): wrong_state (the ring is broken), unsupported (only frames of the second NIC reach the reference
    // clock that was chosen, and other frames reach other clocks).
    [[nodiscard]] virtual Task<Result<>> open_ring(Network& network) = 0;
    [[nodiscard]] virtual Task<Result<>> close_ring(Network& network) = 0;
    // The delays were measured, and Clocks::nodes has the ways of the frames: notes how the ways change with a break.
    virtual void note_ways(Network& network) = 0;
    // configdc() while the ring is broken between slaves with clocks: the delay from one part to the other is a guess
    // until the ring is whole again and the delays are measured anew.
    [[nodiscard]] virtual bool delays_are_guessed() const = 0;
    // The clocks behind a break begin to follow the first clock there. For configdc(), before it sends times.
    [[nodiscard]] virtual Task<Result<>> begin_second_part(Network& network) = 0;
    // The sequence between open_ring() and close_ring() was destroyed: the chip opens its port by itself.
    virtual void forget_opening() = 0;
    // Keeps the clocks behind a break in step with the reference clock.
    [[nodiscard]] virtual Task<Result<>> watch_clocks(Network& network) = 0;
    // Clocks::reference is another slave: the part that it does not reach gets the second reference that belongs to it,
    // from the next frame on.
    [[nodiscard]] virtual Task<Result<>> follow_reference(Network& network) = 0;
    // The number of the slave whose clock the slave follows: the reference, or the second reference behind the break.
    [[nodiscard]] virtual std::uint16_t reference_of(Network& network, const Slave& slave) const = 0;
    [[nodiscard]] virtual FollowedClock followed_clock(Network& network, const Slave& slave) const = 0;
    // Some clocks are beside the ring: the ways of both copies are not measured then.
    [[nodiscard]] virtual bool has_clocks_beside() const = 0;
    // Whether a break of the ring is between both slaves.
    [[nodiscard]] virtual bool are_parted(Network& network, const Slave& one, const Slave& other) const = 0;

  protected:
    ~RedundancyPart() = default;
};

struct Network {
    Network(Nic& nic, SlaveTable slave_table, std::span<FrameSlot> slots, std::span<std::byte> arena_memory,
            std::size_t most_tasks, std::span<MailboxChannel> channels = {}, std::span<Emergency> emergencies = {},
            std::span<RingPlace> ring_places = {})
        : engine(nic, slots, arena_memory),
          table(slave_table.slaves),
          mark_table(slave_table.marks),
          ring(ring_places),
          tasks(most_tasks),
          mailboxes(engine, channels, emergencies) {}

    Engine engine;
    std::span<Slave> table;
    std::span<SlaveMarks> mark_table;
    std::uint16_t count = 0;  // slaves in the table: found, or expected
    std::span<RingPlace> ring;
    std::uint16_t ring_count = 0;        // slaves in the ring when it was last read
    RingParts parts_read;                // where the ring was broken then
    std::uint16_t stranger_address = 0;  // station address of slaves that are unknown and reported
    std::size_t tasks;                   // number of slaves that are processed at the same time
    ScanSettings settings;
    ProcessTables process;
    WritableRing<Error> errors;  // these three: without memory until use() gives it to them
    WritableRing<Error> warnings;
    WritableEvents events;
    Mailboxes mailboxes;
    EmergencyListener emergency_listener{*this};
    const CoeFeature* coe = nullptr;               // see <margay/features.hpp>
    const OverlapFeature* overlap = nullptr;       // the same
    const BootFeature* boot = nullptr;             // the same
    RedundancyPart* redundancy = nullptr;          // given by init_redundant()
    const Expectation* expectation = nullptr;      // given by expect()
    std::span<const ExpectedSlave> expected_next;  // by expect(): used from the next scan on
    std::span<const ExpectedSlave> expected;
    bool expected_is_new = false;  // expect() was called since the last scan began
    Slave guest;                   // a newcomer while it is being identified
    std::uint8_t newcomers = 0;    // counts the newcomers, so that each one gets an address of its own
    bool searching = false;        // a search (find_lost()) is executing
    Errc unreadable = Errc::none;  // why the last search could not read a newcomer; none: no such failure was reported
    std::uint32_t scans = 0;       // number of scans started: older requests detect that the table has changed
    Clocks clocks;
    Tolerance tolerance;
    AlState target = AlState::op;          // of all slaves without their own target
    bool silent = false;                   // for the supervision: no frame comes back
    std::atomic<bool> overlapping{false};  // a group has cycles that another thread may send
    bool supervised = false;
    const SuperviseRequest* supervision = nullptr;  // while `supervised`
    AlState target_read = AlState::none;            // the target of the request when the supervision has read it last
    // How long a reading or an exchange proves that the slaves are the same.
    static constexpr Duration kBelieved = std::chrono::seconds(1);
    Time states_read = Time::min();  // when the states of all slaves were read last
    // Up to this time, no pause in looking at the slaves was longer than kBelieved since all identities were compared.
    Time compared = Time::min();
    // The application has paused: until then requests wait while the supervision compares their slave.
    Time comparing_until = Time::min();
    bool supervision_ended = false;  // not reported yet: the next poll() reports it
    Error supervision_error;         // why it has ended
    bool segment_in_use = false;     // a request that needs the whole segment is executing
    bool segment_wanted = false;     // such a request waits
    bool group_is_back = false;      // the first slave of a hot connect group is back: its members should come with it
    bool supervision_turn =
        false;  // such a request has ended: the supervision has its turn before the next such request begins
    std::uint16_t slave_of_cut_hook = 0;  // a sequence was destroyed while it waited for the hook of this slave
    bool slept_long = false;  // before its last roll the supervision slept longer than kBelieved, as its request says
    bool silence_noted = false;  // doubt_after_silence() is due: in the next poll(), outside all sequences
    List<SlaveWork> works;       // at most one for each slave
    Engine::Sleep::Timer* supervision_sleep = nullptr;  // while the supervision sleeps between two rounds
    bool in_run_cycle = false;  // groups that were mapped before a scan are missing until they are mapped again
    bool reaching = false;      // reach() has started the supervision itself
    bool topology_read = true;  // when the ring was read last, all its ports have led to a slave or to a NIC
    // The commands and hooks after transitions that were requested without waiting. `settling` and `requests` are the
    // last members, so that they are destroyed first.
    Crew settling;
    Crew requests;

    [[nodiscard]] Arena& arena() { return engine.arena(); }
    // Another slave may be present, and its identity can be read. In BOOT it cannot, because the firmware may use the
    // EEPROM.
    [[nodiscard]] bool is_doubted(const Slave& slave) const {
        return marks(slave).unproved && slave.al.state != AlState::boot;
    }
    // The slaves were not looked at for so long that one may have been exchanged for another one in the same state.
    [[nodiscard]] bool is_unobserved() const { return later(compared, kBelieved) < engine.now(); }
    // The supervision compares this slave because of its own long interval: until an attempt fails the slave counts as
    // it was, so that what_is_wrong() does not change with each roll.
    [[nodiscard]] bool is_believed(const Slave& slave) const {
        return supervised && slept_long && !marks(slave).was_away && marks(slave).attempts == 0;
    }
    // The slaves were compared with the list that expect() has set last.
    [[nodiscard]] bool is_expected_list() const { return !expected_is_new; }
    [[nodiscard]] std::span<Slave> slaves() const { return table.first(count); }
    [[nodiscard]] std::span<RingPlace> seen_ring() {
        return ring.first(std::min<std::size_t>(ring_count, ring.size()));
    }
    [[nodiscard]] StationAddress station_address(std::size_t number) const {
        return {static_cast<std::uint16_t>(settings.first_station_address + number - 1)};
    }
    [[nodiscard]] RingParts ring_parts() { return redundancy == nullptr ? RingParts{} : redundancy->parts(); }
    // By number; 1 is the first slave.
    [[nodiscard]] Slave& slave(std::size_t number) { return table[number - 1]; }
    // The marks of a slave of the table; `guest` has none.
    [[nodiscard]] SlaveMarks& marks(std::size_t number) { return mark_table[number - 1]; }
    [[nodiscard]] SlaveMarks& marks(const Slave& slave) { return marks(slave.number); }
    [[nodiscard]] const SlaveMarks& marks(const Slave& slave) const { return mark_table[slave.number - 1U]; }
    [[nodiscard]] Station station(const Slave& slave) { return {engine, slave.station_address, slave.number}; }

    // One request, or the supervision, changes a slave now.
    [[nodiscard]] bool any_slave_in_use() const {
        return std::ranges::any_of(mark_table.first(count), [](const SlaveMarks& marks) { return marks.in_use; });
    }
    // The supervision must not begin to change slaves: a request needs the whole segment.
    [[nodiscard]] bool is_reserved() const { return segment_in_use || (segment_wanted && !supervision_turn); }
    [[nodiscard]] bool is_turn_of_supervision() const { return supervised && supervision_turn; }

    [[nodiscard]] bool has_mailbox(const Slave& slave) const {
        return slave.number >= 1 && slave.number <= mailboxes.count();
    }
    [[nodiscard]] MailboxChannel& mailbox(const Slave& slave) { return mailboxes.channel(slave.number); }

    // Adds an event with the current time.
    void report(const Event& event);

    // Keeps an error that belongs to one slave. The slave keeps only the first error: it is the cause of the later
    // ones.
    void note(Slave& slave, const Error& error) {
        if (slave.error.code == Errc::none && !is_warning(error.code)) slave.error = error;
        note(error);
    }
    // Keeps an error or a warning in its log, unless it belongs to a slave whose failure was reported before.
    void note(const Error& error);
};

// Begins the task of one slave; `what` belongs to the caller of for_each_slave().
using SlaveTask = Task<Result<>> (*)(Slave& slave, const void* what);

// Executes make(slave, what) for every slave, as many at the same time as the network allows. The tasks store their own
// results; the first error of a task is copied to `first` if that is not nullptr.
[[nodiscard]] Task<Result<>> for_each_slave(Network& network, SlaveTask make, const void* what, Error* first = nullptr);

// The same with a lambda, which must outlive the task: give it a name. There is one sequence for all lambdas.
template <class Make>
[[nodiscard]] Task<Result<>> for_each_slave(Network& network, const Make& make, Error* first = nullptr) {
    constexpr SlaveTask kCall = [](Slave& slave, const void* what) { return (*static_cast<const Make*>(what))(slave); };
    return for_each_slave(network, kCall, &make, first);
}
template <class Make>
Task<Result<>> for_each_slave(Network& network, const Make&& make, Error* first = nullptr) = delete;

}  // namespace margay
