// Executes a plan: the segment, the master, the time, and the rules that are checked at every moment.
#pragma once

#include "osal/osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "storm/chaos_nic.hpp"
#include "storm/operations.hpp"
#include "storm/plan.hpp"
#include "storm/roomy_context.hpp"
#include "storm/spy.hpp"

#include <margay/margay.hpp>
#include <margay/shared_image.hpp>

#include <deque>
#include <functional>
#include <map>

namespace margay::storm {

// A broken rule. `rule` is the same text for all failures of a kind; `detail` describes this failure.
struct Failure {
    std::string rule;
    std::string detail;
};
// Called once, when a rule is broken. Does not return.
using Reporter = std::function<void(const Failure&)>;

class World;

// Virtual time. While the owner waits, the steps of the world continue.
class StormOsal final : public Osal {
  public:
    explicit StormOsal(World& world) : world_(world) {}
    [[nodiscard]] Time now() noexcept override { return now_; }
    void wait(Time until, WaitHandles) noexcept override;
    void wake() noexcept override { woken = true; }
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override { return thread; }

    void set(Time now) {
        if (now > now_) now_ = now;
    }
    bool woken = false;
    std::uintptr_t thread = 1;  // the thread that calls at present; 1 is the owner

  private:
    World& world_;
    Time now_{};
};

class World {
  public:
    World(const Plan& plan, Reporter reporter);
    ~World();
    World(const World&) = delete;
    World& operator=(const World&) = delete;

    // Executes the whole plan. Returns only when no rule is broken.
    void run();
    [[nodiscard]] double simulated_seconds() {
        return std::chrono::duration<double>(osal_.now().time_since_epoch()).count();
    }

    // Used by StormOsal: time passes until `until`, or until another thread wakes the owner.
    void pass(Time until);
    void wait_in_call(Time until);

  private:
    friend struct Hooks;
    struct Slot {
        std::unique_ptr<Operation> operation;
        Time since{};
        bool checked = true;  // its end was checked
        bool cancelled = false;
        void cancel() {
            if (!operation) return;
            cancelled = true;
            operation->cancel();
        }
    };
    struct Due {
        Time at{};
        Step step;
    };
    // Whether SyncManager 1 of a slave that takes part had a message before and after a cycle was sent.
    enum class Mailbox : std::uint8_t { unknown, empty, full };
    // A cycle, and the slaves that were reachable when its frames passed. Frames pass the simulated segment at the
    // time of sending.
    struct Cycle {
        Time sent{};
        std::vector<bool> reachable;
        std::vector<std::uint16_t> station;
        Errc send_error = Errc::none;
        std::vector<Mailbox> mailboxes;  // by slave, from 1
        bool mapping = false;            // a group was being mapped during the cycle
    };
    [[nodiscard]] bool mapping() const;
    static constexpr std::size_t kSlots = 24;
    static constexpr std::size_t kImageBytes = 4096;

    [[noreturn]] void fail(std::string rule, const std::string& detail);

    // world.cpp: construction, time
    void build();
    void start_steps();
    void poll_once();
    bool run_until(Time end, const std::function<bool()>& holds);
    void run_for(Duration time) {
        (void)run_until(osal_.now() + time, [] { return false; });
    }
    void do_cycle();
    void cycle_group(std::uint8_t group);
    void receive_group(std::uint8_t group);
    void drain_told();
    void keep(std::string_view told);
    [[nodiscard]] std::string story() const;
    void meddle(std::uint32_t number);

    // world_steps.cpp
    void do_step(const Step& step);
    void world_step(const Step& step);
    void note_disturbance(const Step& step);
    void submit_slot(const Step& step, bool by_owner);
    void set_group(const Slave& slave, std::uint8_t group);
    void configure(std::uint32_t slave, std::uint32_t what, std::uint32_t value);
    Result<> map_now(std::uint8_t group);
    void heal();
    [[nodiscard]] std::optional<std::uint32_t> number_of(std::uint32_t id) const;

    // world_expect.cpp
    void choose_group();
    void choose_away();
    void keep_places();
    void expect_slaves();
    [[nodiscard]] std::vector<std::uint32_t> group_behind(std::uint32_t first) const;
    void switch_away();
    void come_back();

    // world_phases.cpp
    void bring_up();
    void lose_frames();
    [[nodiscard]] Result<> scan_now();
    void map_all();
    void blame(const char* rule, const Error& error);
    void configure_all();
    void copy_between_slaves();
    void expect_back();
    void finish_requests();
    void check_arena();
    void fresh_start();
    void close_busy();
    [[nodiscard]] bool in_op(std::uint32_t device);
    [[nodiscard]] bool clean(std::uint32_t device) const;

    // world_harm.cpp
    void insert_due(const Due& due);
    [[nodiscard]] std::uint16_t slave_at(std::uint32_t device);
    void hostile_write(const Step& step);
    void update_eeprom(const Step& step);
    void make_dirty(std::uint32_t device);
    void eeprom_deaf(std::uint32_t device, std::uint32_t milliseconds);
    void check_eeproms();
    void check_acknowledged(const Request& request, std::uint32_t device, Time since);

    // world_rules.cpp
    [[nodiscard]] static Duration patience_of(const Slot& slot);
    void check_ends();
    void note_presence(bool ring_changed);
    void check_renamed(std::uint32_t device, std::uint16_t now);
    void check_lost(std::uint16_t number, Time at, const char* how);
    void check_states();
    void check_bits(std::uint8_t group, Time since);

    // world_traffic.cpp
    void read_what_is_not_there();
    void note_interval(std::uint8_t group);
    void check_poll(std::uint64_t frames_before);
    void check_budget(std::uint8_t group, const ChaosNic::Sent& before);
    [[nodiscard]] std::vector<Mailbox> look_at_mailboxes(std::uint8_t group);
    void check_mailboxes(std::uint8_t group, const Cycle& cycle);
    void check_ownership();
    void drain_emergencies();
    void hoard(std::uint32_t milliseconds, std::size_t blocks_left);

    // checks.cpp
    void show_inputs();
    void set_outputs(std::uint8_t group);
    void note_outputs(std::uint8_t group);
    void check_inputs(std::uint8_t group, bool right, const Cycle& cycle);
    void check_outputs();
    [[nodiscard]] std::vector<std::uint32_t> devices_at(std::uint16_t number);
    void look_around();
    [[nodiscard]] std::string place(std::uint16_t number);
    [[nodiscard]] std::string counted(std::uint8_t number);
    [[nodiscard]] std::string there(const Cycle& cycle) const;
    void check_shared(std::uint8_t group);
    void check_copies(std::uint8_t group);

    Plan plan_;
    Reporter reporter_;
    StormOsal osal_{*this};
    sim::Segment segment_;
    std::unique_ptr<SimulatedNic> wire_;
    std::unique_ptr<ChaosNic> nic_;
    std::unique_ptr<RoomyContext> ctx_;
    Chance chance_;

    std::vector<Spy*> spies_;  // by number in the segment; nullptr: the device has no program
    std::vector<bool> dirty_;  // by device: a step changed its EEPROM or its quirks
    std::vector<bool> halted_;
    std::vector<bool> reachable_;  // at the last look_around()
    std::vector<std::uint16_t> station_;
    // By device: outputs that the application wrote for it.
    std::vector<std::map<std::uint32_t, std::set<Value>>> sent_;
    std::map<std::uint16_t, Value> inputs_;    // by slave: in the image at the last check
    std::map<std::uint16_t, Time> regrouped_;  // by slave: when the application gave it another group
    std::vector<std::uint32_t> ids_;
    bool hostile_ = false;  // frames were damaged without detection by the FCS: process data cannot be checked

    // Whether a device is in the ring, its station address, and the time since which both are unchanged.
    struct Presence {
        bool there = false;
        std::uint16_t station = 0;
        Time since{};
    };
    std::vector<bool> in_ring_;
    std::vector<Presence> presence_;
    std::vector<AlState> states_;  // by slave, at the last check_states()
    Time looked_at_{};             // the time of the last check_states()
    bool disturbed_ = false;       // frames were lost, delayed or duplicated, or polls were late
    bool disturbed_much_ = false;  // so many that a reply may be lost again and again
    struct HostileWrite {
        std::array<std::byte, 8> data{};
        RegisterWriteRequest request;
    };
    std::deque<HostileWrite> hostile_writes_;
    bool hostile_registers_ = false;    // process data cannot be checked
    std::set<std::uint32_t> tampered_;  // devices with hostile writes whose power was not switched since
    struct Update {
        std::array<std::byte, 16> old{};
        std::array<std::byte, 16> wanted{};
        Time since{};
        bool checked = false;
        SiiWriteRequest request;
    };
    std::map<std::uint32_t, Update> updates_;  // by device
    std::set<std::uint32_t> renamed_;          // devices whose identity in the EEPROM was changed
    std::set<std::uint32_t> faulty_eeproms_;   // devices whose EEPROM did not acknowledge, on purpose

    std::vector<std::vector<std::byte>> images_;
    std::vector<std::deque<Cycle>> on_their_way_;
    std::vector<std::uint32_t> mappings_;  // of each group, when it was sent last
    std::vector<std::uint32_t> baseline_;  // devices that were in OP when the steps began
    // The information about the process data of a slave before the slave is present.
    struct KeptPlace {
        std::vector<PdoEntry> entries;
        std::vector<Pdo> pdos;
        std::vector<SmPdos> sms;
        SlaveSetup setup;
        SlaveConfiguration config;
    };
    std::map<std::uint32_t, KeptPlace> kept_;   // by device
    std::vector<std::uint32_t> away_;           // devices that are absent when the segment is brought up
    std::vector<std::uint32_t> segment_order_;  // order of the ring when all devices were present
    std::vector<std::uint32_t> group_;          // devices of the hot connect group, the first slave of the group first
    std::vector<SlaveToSlave> copies_;          // of all groups
    std::vector<std::vector<std::byte>> shared_memory_;
    std::vector<std::unique_ptr<SharedImage>> shared_;
    std::vector<ExpectedSlave> expected_;
    std::uint16_t wrong_ = 0;  // the slave that differs from the expected one
    SlaveConfiguration expected_configuration_;
    SuperviseRequest supervision_;
    std::array<Slot, kSlots> slots_;

    std::deque<Due> world_steps_;
    std::deque<Due> owner_steps_;
    bool cycling_ = false;
    bool in_step_ = false;
    bool supervising_ = false;  // the supervision is submitted again when it has ended
    bool meddling_ = true;      // callbacks and hooks cancel requests
    Time next_cycle_{};
    Duration late_{};
    std::uint32_t counter_ = 0;
    std::size_t most_slaves_ = 0;
    std::deque<std::string> story_;  // texts of the latest errors and events
    std::uint32_t hook_calls_ = 0;
    std::uint32_t events_called_ = 0;

    const char* call_ = nullptr;  // the blocking call in which the owner waits
    Time call_since_{};
    std::uint32_t calls_waits_ = 0;
    Time polls_since_{};
    std::uint32_t polls_ = 0;
    std::uint32_t polls_at_once_ = 0;
    Time last_poll_ = Time::min();
    Time deadline_{};
    std::size_t arena_level_ = 0;
    std::vector<void*> hoarded_;
    // For each group: the time of the last sending, and the number of equal intervals before it.
    struct Pace {
        Time last = Time::min();
        unsigned equal = 0;
    };
    std::vector<Pace> paces_;
};

}  // namespace margay::storm
