// A whole segment as the master knows it: the engine that talks to it and the table of its slaves.
#pragma once

#include "link/engine.hpp"
#include "mailbox/mailboxes.hpp"
#include "network/process_data.hpp"
#include "network/slave_marks.hpp"
#include "network/topology.hpp"
#include "station/register_access.hpp"
#include "util/task.hpp"

#include <margay/error_log.hpp>
#include <margay/event.hpp>
#include <margay/expected.hpp>
#include <margay/slave.hpp>

#include <algorithm>
#include <span>

namespace margay {

struct ScanSettings {
    Duration link_timeout = std::chrono::seconds(5);
    Duration init_timeout = std::chrono::seconds(2);  // for all slaves to reach INIT
    std::uint16_t first_station_address = 0x1001;
};

// The memory of all slaves that a context has room for; both spans have the same length.
struct SlaveTable {
    std::span<Slave> slaves;
    std::span<SlaveMarks> marks;
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
          mailboxes(engine, channels, emergencies) {
        mailboxes.listener = {tell_emergency, this};
        events.use(event_memory);
    }

    Engine engine;
    std::span<Slave> table;
    std::span<SlaveMarks> mark_table;
    std::uint16_t count = 0;  // of slaves in the table: found, or expected
    std::span<RingPlace> ring;
    std::uint16_t ring_count = 0;     // of slaves that were in the ring when it was looked at last
    std::uint16_t stranger_mark = 0;  // the station address of those whom nobody knows and who were told of
    std::size_t tasks;                // slaves worked on at once
    ScanSettings settings;
    ProcessTables process;
    SpscRingOf<Error, 64> errors;
    SpscRingOf<Error, 64> warnings;
    Mailboxes mailboxes;
    std::array<Event, EventQueue::kCapacity> event_memory{};
    EventQueue events;
    std::span<const ExpectedSlave> expected_next;  // by expect(): from the next scan on
    std::span<const ExpectedSlave> expected;
    Slave guest;              // a newcomer while it is found out who it is
    bool searching = false;   // somebody is at that
    std::uint32_t scans = 0;  // how many scans have begun: whoever was at work before finds another table
    Tolerance tolerance;
    AlState target = AlState::op;  // of all slaves that have no target of their own
    bool supervised = false;
    bool segment_in_use = false;  // a request that needs the whole segment is running
    bool reaching = false;        // reach() supervises for itself
    Crew requests;                // those that are busy; last, so that they end first

    [[nodiscard]] Arena& arena() { return engine.arena(); }
    [[nodiscard]] std::span<Slave> slaves() { return table.first(count); }
    [[nodiscard]] std::span<RingPlace> seen_ring() {
        return ring.first(std::min<std::size_t>(ring_count, ring.size()));
    }
    [[nodiscard]] StationAddress station_address(std::size_t position) const {
        return {static_cast<std::uint16_t>(settings.first_station_address + position - 1)};
    }
    // By position, 1 the first.
    [[nodiscard]] Slave& slave(std::size_t position) { return table[position - 1]; }
    // The marks of a slave of the table; `guest` has none.
    [[nodiscard]] SlaveMarks& marks(std::size_t position) { return mark_table[position - 1]; }
    [[nodiscard]] SlaveMarks& marks(const Slave& slave) { return marks(slave.position); }
    [[nodiscard]] const SlaveMarks& marks(const Slave& slave) const { return mark_table[slave.position - 1U]; }
    [[nodiscard]] Station station(const Slave& slave) { return {engine, slave.station_address, slave.position}; }

    [[nodiscard]] bool has_mailbox(const Slave& slave) const {
        return slave.position >= 1 && slave.position <= mailboxes.count();
    }
    [[nodiscard]] MailboxChannel& mailbox(const Slave& slave) { return mailboxes.channel(slave.position); }

    static void tell_emergency(void* network, std::uint16_t slave, const Emergency& emergency) {
        Event event{.kind = EventKind::emergency, .slave = slave};
        event.actual = emergency.error_register;
        event.detail = emergency.code;
        static_cast<Network*>(network)->tell(event);
    }

    // Adds an event, with the time.
    void tell(Event event) {
        event.at = engine.now();
        events.add(event);
    }

    // Keeps an error that belongs to one slave. Of several the first stays with the slave: it is the cause of the
    // others.
    void note(Slave& slave, const Error& error) {
        if (slave.error.code == Errc::none && !is_warning(error.code)) slave.error = error;
        note(error);
    }
    // Keeps an error or a warning that is no fault of one slave.
    void note(const Error& error) { (void)(is_warning(error.code) ? warnings : errors).add(error); }
};

// Runs make(slave) for every slave, as many at once as the network allows. What they end with is theirs to keep; the
// first error of them goes to `first` where it is wanted.
template <class Make>
Task<Result<>> for_each_slave(Network& network, Make make, Error* first = nullptr) {
    Crew crew(network.tasks);
    for (Slave& slave : network.slaves()) {
        while (crew.full()) co_await crew.one();
        while (!crew.start(make(slave))) {
            if (crew.running() == 0) co_return Error{.code = Errc::capacity};
            co_await crew.one();
        }
    }
    co_await crew.all();
    if (first != nullptr) *first = crew.first_error();
    co_return Result<>();
}

}  // namespace margay
