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
    bool again = false;  // the watch has seen slaves come or go
    Time retry{};
    Time spare_until{};  // the next scan waits until then for the end of transfers; Time{}: none is to come
};

// What the program has told about time.
struct AppTime {
    std::atomic<std::uint64_t> now_ns{0};
    std::uint64_t first_ns = 0;
    std::uint64_t at_ns = 0;  // as told at `at`, in the time of the osal; not while the segment is running
    Time at{};
    std::atomic<bool> known{false};
};

// Of a slave, as of the last scan before activation.
struct PortFacts {
    Identity identity;
    std::array<std::uint32_t, EC_MAX_PORTS> received{};  // ns, in the time of its own clock
    std::array<std::uint32_t, EC_MAX_PORTS> delay{};     // ns, to the next slave with a clock
};

// What tells threads apart at the cost of one instruction.
[[nodiscard]] inline std::uintptr_t this_thread() {
#if defined(__x86_64__) || defined(__aarch64__)
    return reinterpret_cast<std::uintptr_t>(__builtin_thread_pointer());
#else
    return static_cast<std::uintptr_t>(pthread_self());
#endif
}

// What a cycle needs when the start-up is over and all process data is in one domain: most programs are so.
struct Steady {
    std::uintptr_t thread = 0;  // the owner of the context; 0: the cycle goes the long way
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
    // What a program calls the slave of an error: "position 5". Empty: it is missing at no place of its own, or the
    // error is that of no slave. Any thread.
    [[nodiscard]] std::string place_of(const Error& error);
    [[nodiscard]] bool slave_at(std::uint16_t position, Slave& copy);
    // The place in the ring, from 1 on, of the first slave with the alias; 0: there is none.
    [[nodiscard]] std::uint16_t first_with(std::uint16_t alias);
    // The slave of a configuration, as far as it is there. Any thread; before activation by address and identity.
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
    // The failures that wait until that thread prints them. A thread that adds one does not wait for the others.
    struct Failures {
        std::mutex mutex;
        std::array<Failure, 256> list;
        std::size_t count = 0;
        unsigned more = 0;  // there was no room for them
    };
    Failures failures;
    Search search;
    bool first_scan_over = false;  // guarded by facts_mutex
    std::condition_variable scanned;

    std::mutex facts_mutex;
    std::vector<Slave> facts;
    std::vector<PortFacts> ports;   // by the number of the slave
    std::atomic<bool> dirty{true};  // the copies are old; for all threads
    Time facts_at{};                // for the owner: when they are copied again; in the past while they are old
    Time refresh_at{};              // for the owner: when a cycle does more than to exchange data
    bool silent = false;            // for the owner: no frame comes back, so no slave responds
    // The states are read again after a silence of the segment. For the owner.
    struct Return {
        ReadStateRequest states;
        bool waited_for = false;  // the states that are known are from before the silence
        bool reading = false;     // `states` has begun after it
    };
    Return returning;
    std::atomic<std::uint32_t> responding{0};
    std::atomic<std::uint32_t> al_states{0};
    // Of the two ends of a ring; one NIC: the first.
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
    std::atomic<std::uint32_t> scan_slaves{0};  // that the present scan has counted
    std::atomic<std::uint32_t> scan_index{0};   // that it has read

    std::shared_mutex configuring;  // shared by each Change; exclusive in activation and deactivation; locked first
    std::mutex config_mutex;
    std::vector<std::unique_ptr<ec_domain>> domains;
    std::vector<std::unique_ptr<ec_slave_config>> configs;
    std::atomic<bool> requests_wait{false};  // some requests of the configurations begin later
    ec_slave_config* reference = nullptr;
    std::mutex known_mutex;
    std::map<std::uint16_t, std::shared_ptr<KnownPdos>> known_pdos;             // by place in the ring, from 1 on
    std::map<std::uint16_t, std::pair<Identity, std::uint16_t>> known_objects;  // the number of them, likewise
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
    // Of the operation before: the slaves of the context point to them until a scan with another list has ended.
    std::vector<std::unique_ptr<ec_slave_config>> old_configs;
    std::vector<std::unique_ptr<Operation>> old_operations;
    // Devices that came after the scan and are not in the list of expected slaves. For the owner.
    std::vector<Identity> strangers;
    std::uint32_t answering = 0;  // slaves, known or not; 0: not counted since the scan
    AppTime app_time;
    std::unique_ptr<ApplicationTime> clocks;
    // What the next send has to do for the clocks.
    static constexpr std::uint8_t kDatagramsWait = 1;  // datagrams for the clocks wait for it
    static constexpr std::uint8_t kTimeWanted = 2;     // it carries the time of the reference clock to the others
    std::uint8_t clocks_due = 0;
    // When ecrt_master_send() was called last on the long way, and the time since the call before.
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

// Whether an error is that of the slave itself. Otherwise its frames were lost, and it is read again.
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

// The slave is there, and its SII is being read: after the scan only its identity was.
[[nodiscard]] inline bool is_unread(const Slave& slave) {
    return !is_own_error(slave.error.code) && (!slave.seen || (!slave.sii_read && slave.al.state == AlState::init));
}

// Before activation: the slave is in INIT, and nothing keeps it there. It takes no messages yet.
[[nodiscard]] inline bool is_on_its_way_to_preop(const Slave& slave) {
    return !is_own_error(slave.error.code) && (slave.al.state == AlState::init || is_unread(slave));
}

// How far a slave is: its SII was read; it has passed INIT, so that it takes messages; its PDOs stay as they are,
// or it cannot be configured.
enum class Ready : std::uint8_t { read, for_mail, for_pdos };

// While the segment is scanned, while a slave is brought to PREOP, and while the segment starts up after activation,
// slaves have no numbers or no mailboxes yet. Waits until the one at this position is ready, 10 s at most. Returns at
// once in the cyclic thread. False: the slave is not ready.
bool await_start(Bus& bus, std::uint16_t position, Ready wanted);

// Activation or deactivation, while it is at work.
class Turn {
  public:
    explicit Turn(Bus& bus) : bus_(bus) { ++bus_.turns; }
    ~Turn() { ++bus_.turns; }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

  private:
    Bus& bus_;
};

// A transfer of a call that waits. It begins when its slave is ready, as await_start() says, and nothing is at work
// that would end it. Activation and the next scan wait for its end, 1 s. Deactivation does not end it: the scan that
// follows does, after this second.
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
