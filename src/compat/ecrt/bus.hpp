// A master of the facade: its segment, its context, the thread that polls it, and what the program has configured.
//
// Phases. Until activation a thread of the facade polls (idle.cpp): it scans, looks for slaves that come and go, and
// lets other threads access slaves. ecrt_master_activate() ends that thread. From then on the thread that calls
// receive and send polls: it becomes the owner of the context by its first call, and the start-up of the segment
// (operation.hpp) runs as requests inside these calls. Nothing in them waits.
//
// Locks. `configuring` keeps activation away from calls that change a configuration. `turn` is held by the thread that
// uses the context before activation. `config` guards the objects of the program; it is not held while a thread waits
// for a slave. `facts` guards the copies of the slaves; the cyclic thread only tries it. The cyclic thread waits for
// none.
#pragma once

#include "compat/ecrt/domain.hpp"
#include "compat/ecrt/operation.hpp"
#include "compat/ecrt/pdos.hpp"
#include "compat/ecrt/slave_config.hpp"
#include "source/source.hpp"

#include <margay/application_time.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/request.hpp>

#include <ecrt.h>

#include <pthread.h>
#include <array>
#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <thread>
#include <vector>

namespace margay::compat::ecrt {

// The request that looks for slaves before activation.
struct Search {
    ScanRequest scan;
    SuperviseRequest watch;
    bool scanning = false;
    bool again = false;  // the supervision has found new or missing slaves
    Time retry{};
    Time spare_until{};  // the next scan waits for the end of transfers until this time; Time{}: no scan is due
};

// The application time as set by the program.
struct AppTime {
    std::atomic<std::uint64_t> now_ns{0};
    std::uint64_t first_ns = 0;
    // The application time at the time `at` of the OSAL; not used while the segment is running.
    std::uint64_t at_ns = 0;
    Time at{};
    std::atomic<bool> known{false};
};

// Data about the ports of a slave, read by the last scan before activation.
struct PortFacts {
    Identity identity;
    std::array<std::uint32_t, EC_MAX_PORTS> received{};  // ns, local time of the slave
    std::array<std::uint32_t, EC_MAX_PORTS> delay{};     // ns, to the next slave with a clock
};

// A value that identifies the calling thread, read by one instruction.
[[nodiscard]] inline std::uintptr_t this_thread() {
#if defined(__x86_64__) || defined(__aarch64__)
    return reinterpret_cast<std::uintptr_t>(__builtin_thread_pointer());
#else
    return static_cast<std::uintptr_t>(pthread_self());
#endif
}

// The data that a cycle needs when the start-up is complete and all process data is in one domain. This is the usual
// case.
struct Steady {
    std::uintptr_t thread = 0;  // the owner of the context; 0: the cycle executes the general code
    Context* ctx = nullptr;
    Osal* osal = nullptr;
    Exchange* exchange = nullptr;
    ec_domain* domain = nullptr;
};

// A request of the program that has ended in ERROR.
struct Failure {
    Error error;
    std::array<char, 128> what{};  // in words
};

class Bus {
  public:
    Bus(unsigned number, std::string name) : index(number), source_name(std::move(name)) {}
    ~Bus();
    Bus(const Bus&) = delete;
    Bus& operator=(const Bus&) = delete;

    // Opens the segment and returns after the first scan. False: the reason was printed.
    [[nodiscard]] bool open();

    // --- Before activation (idle.cpp) ---
    void start_idle();
    void stop_idle();  // the calling thread owns the context afterwards
    // Executes `work` in the calling thread as owner of the context. Only before activation. Afterwards the thread that
    // polls owns the context again: a caller that remained the owner would poll beside it.
    template <class Work>
    void as_owner(Work work) {
        wanted.fetch_add(1);
        std::unique_lock lock(turn);
        wanted.fetch_sub(1);
        (void)take_ownership(*ctx);
        work();
        hand_back(lock);
    }

    // The segment is scanned again; transfers that have not begun wait for that. For the owner, before activation.
    void scan_again() { search.again = scan_busy = true; }
    // The same for any thread. Does nothing while no thread polls before activation: activation and deactivation scan
    // themselves.
    void ask_for_scan();
    // Before activation: waits while the segment is scanned, at most 3 s. Returns whether the scan is over.
    bool await_scan() const;
    // The segment is scanned, or the master is being activated or deactivated: no transfer begins. Any thread.
    [[nodiscard]] bool is_changing() const { return turns % 2 != 0 || scan_busy; }

    // Reads the receive times of all ports (ports.cpp). For the owner, before activation.
    void measure_ports();

    // Gives listeners of mail the numbers of their slaves. For the owner (voe.cpp).
    void attach_mail();

    // --- Facts (facts.cpp) ---
    // Copies the slaves for other threads, and the states for the cyclic thread. For the owner.
    void refresh_facts(Time now);
    // The number of the slave at this place of the ring, the first is 0; 0: there is none. Any thread.
    [[nodiscard]] std::uint16_t number_at(std::uint16_t position);
    // The name of the slave of an error in messages for the program: "position 5". Empty: the slave has no position, or
    // the error belongs to no slave. Any thread.
    [[nodiscard]] std::string place_of(const Error& error);
    [[nodiscard]] bool slave_at(std::uint16_t position, Slave& copy);
    // The place in the ring, from 1 on, of the first slave with the alias; 0: there is none.
    [[nodiscard]] std::uint16_t first_with(std::uint16_t alias);
    // The slave of a configuration, if it is present. Before activation it is found by address and identity. Any
    // thread.
    [[nodiscard]] bool slave_of(const ec_slave_config& config, Slave& copy);

    Steady steady;  // set and used by the owner
    const unsigned index;
    const std::string source_name;
    std::vector<int> lock_sockets;
    std::vector<std::string> locked;  // names of interfaces
    std::unique_ptr<hosted::Source> source;
    std::unique_ptr<HostContext> ctx;
    bool reserved = false;

    std::mutex turn;
    std::atomic<int> wanted{0};
    bool polling = false;     // a thread polls before activation; guarded by `turn`
    bool handed_over = true;  // it owns the context; guarded by `turn`
    std::condition_variable taken_over;
    std::atomic<bool> stop{false};
    std::thread idle;
    std::thread reporter;  // prints the errors of the context
    std::mutex closing_mutex;
    std::condition_variable closes;
    bool closing = false;  // guarded by closing_mutex
    // The failures that the reporter thread will print. A thread that adds a failure does not wait for other threads.
    struct Failures {
        std::mutex mutex;
        std::array<Failure, 256> list;
        std::size_t count = 0;
        unsigned more = 0;  // failures that did not fit into the list
    };
    Failures failures;
    Search search;
    bool first_scan_over = false;  // guarded by facts_mutex
    std::condition_variable scanned;

    std::mutex facts_mutex;
    std::vector<Slave> facts;
    std::vector<PortFacts> ports;   // by the number of the slave
    std::atomic<bool> dirty{true};  // the copies are out of date; for all threads
    // For the owner: time of the next copy; in the past while the copies are out of date.
    Time facts_at{};
    Time refresh_at{};    // for the owner: the time at which a cycle does more than exchange process data
    bool silent = false;  // for the owner: no frame returns, so no slave responds
    // The states are read again after a silence of the segment. For the owner.
    struct Return {
        ReadStateRequest states;
        bool waited_for = false;  // the known states were read before the silence
        bool reading = false;     // `states` was submitted after the silence
    };
    Return returning;
    std::atomic<std::uint32_t> responding{0};
    std::atomic<std::uint32_t> al_states{0};
    // The links of the two ends of a ring; with one NIC only the first is used.
    struct Link {
        std::atomic<bool> up{false};
        std::atomic<std::uint32_t> slaves{0};
    };
    std::array<Link, 2> links;
    std::atomic<unsigned> ring_broken{0};  // 0 or 1
    [[nodiscard]] bool link_up() const {
        return links[0].up.load(std::memory_order_relaxed) || links[1].up.load(std::memory_order_relaxed);
    }
    std::atomic<bool> scan_busy{true};
    std::atomic<std::uint32_t> scan_slaves{0};  // slaves counted by the present scan
    std::atomic<std::uint32_t> scan_index{0};   // slaves read by the present scan

    std::shared_mutex configuring;  // shared by each Change; exclusive in activation and deactivation; locked first
    std::mutex config_mutex;
    std::vector<std::unique_ptr<ec_domain>> domains;
    std::vector<std::unique_ptr<ec_slave_config>> configs;
    std::atomic<bool> requests_wait{false};  // some requests of the configurations are deferred
    ec_slave_config* reference = nullptr;
    std::mutex known_mutex;
    std::map<std::uint16_t, std::shared_ptr<KnownPdos>> known_pdos;  // by place in the ring, from 1 on
    // The number of objects, by place in the ring.
    std::map<std::uint16_t, std::pair<Identity, std::uint16_t>> known_objects;
    std::atomic<bool> pdos_written{false};  // a request has written a PDO: until the next scan they are read each time

    std::atomic<bool> active{false};
    std::atomic<unsigned> turns{0};  // of activation and deactivation, beginnings and ends: odd while one is at work
    std::atomic<unsigned> transfers{0};  // calls of other threads that wait for a slave, or begin a request
    std::atomic<pthread_t> owner{};      // of the context, after activation; other threads compare themselves with it
    std::atomic<bool> cycling{false};    // the cycle has begun
    [[nodiscard]] bool is_owner() const {
        return pthread_equal(owner.load(std::memory_order_relaxed), pthread_self()) != 0;
    }
    std::vector<std::unique_ptr<Exchange>> exchanges;
    std::unique_ptr<Operation> operation;
    // Objects of the previous operation. The slaves of the context point to them until a scan with another list has
    // ended.
    std::vector<std::unique_ptr<ec_slave_config>> old_configs;
    std::vector<std::unique_ptr<Operation>> old_operations;
    // Devices that came after the scan and are not in the list of expected slaves. For the owner.
    std::vector<Identity> strangers;
    std::uint32_t answering = 0;  // slaves, known or not; 0: not counted since the scan
    AppTime app_time;
    std::unique_ptr<ApplicationTime> clocks;
    // The tasks of the next send for the clocks.
    static constexpr std::uint8_t kDatagramsWait = 1;  // it sends the queued datagrams for the clocks
    static constexpr std::uint8_t kTimeWanted = 2;     // it distributes the time of the reference clock
    std::uint8_t clocks_due = 0;
    // The time of the last call of ecrt_master_send() that executed the general code, and the time since the previous
    // call.
    Time sent_at{};
    Duration interval{0};
    bool time_rides = true;  // the last send carried the time in the frames of the first domain

  private:
    [[nodiscard]] bool lock_interfaces();
    [[nodiscard]] bool lock_interface(const std::string& name);
    void unlock_interfaces();
    void refresh_links(std::uint32_t count);
    void idle_loop();
    void hand_back(std::unique_lock<std::mutex>& lock);
    void take_over();
    void step_search(Time now);
    [[nodiscard]] bool spares_transfers(Time now);
    void report_loop();
    void report();
};

// Whether the master is active and configures this slave: below SAFEOP its PDOs may change.
[[nodiscard]] bool is_configured(Bus& bus, const Slave& slave);

// Whether the slave itself has caused the error. Otherwise its frames were lost, and it is read again.
[[nodiscard]] inline bool is_own_error(Errc code) {
    switch (code) {
        case Errc::none:
        case Errc::missing_slave:
        case Errc::no_frame:
        case Errc::working_counter:
        case Errc::link_down:
        case Errc::nic: return false;
        default: return true;
    }
}

// The slave is in the ring and its state is known.
[[nodiscard]] inline bool is_there(const Slave& slave) {
    return slave.ring_position != 0 && slave.al.state != AlState::none;
}

// The slave is present, and its SII is still being read. The scan has read only its identity.
[[nodiscard]] inline bool is_unread(const Slave& slave) {
    return !is_own_error(slave.error.code) && (!slave.seen || (!slave.sii_read && slave.al.state == AlState::init));
}

// Before activation: the slave is in INIT, and will reach PREOP. It does not accept mailbox messages yet.
[[nodiscard]] inline bool is_on_its_way_to_preop(const Slave& slave) {
    return !is_own_error(slave.error.code) && (slave.al.state == AlState::init || is_unread(slave));
}

// The progress of a slave: its SII was read; it has left INIT, so that it accepts mailbox messages; its PDOs do not
// change any more, or it cannot be configured.
enum class Ready : std::uint8_t { read, for_mail, for_pdos };

// While the segment is scanned, while a slave is brought to PREOP, and while the segment starts up after activation,
// slaves have no numbers or no mailboxes yet. Waits until the slave at this position is ready, 10 s at most. Returns at
// once in the cyclic thread. False: the slave is not ready.
bool await_start(Bus& bus, std::uint16_t position, Ready wanted);

// Exists while activation or deactivation is in progress.
class Turn {
  public:
    explicit Turn(Bus& bus) : bus_(bus) { ++bus_.turns; }
    ~Turn() { ++bus_.turns; }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

  private:
    Bus& bus_;
};

// A transfer of a call that waits. It begins when await_start() returns that its slave is ready, and when no scan,
// activation or deactivation is in progress. Activation and the next scan wait for its end, 1 s. Deactivation does not
// end the transfer. The scan after deactivation ends it after 1 s.
class Passage {
  public:
    Passage(Bus& bus, std::uint16_t position, Ready wanted);
    ~Passage() { --bus_.transfers; }
    Passage(const Passage&) = delete;
    Passage& operator=(const Passage&) = delete;

  private:
    Bus& bus_;
};

}  // namespace margay::compat::ecrt

// The handle of a program.
struct ec_master {
    std::shared_ptr<margay::compat::ecrt::Bus> bus;
    bool reserved = false;
};
