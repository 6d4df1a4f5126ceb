// The EtherCAT state machine of the slave (ETG.1000.6 "EtherCAT state machine"). It reads AL control, compares the
// master's configuration with the description of the device, asks the application, and writes AL status.
#pragma once

#include "subdevice/description.hpp"
#include "subdevice/esc_access.hpp"
#include "wire/al_status_code.hpp"

#include <margay/al_state.hpp>

#include <array>

namespace margay::subdevice {

using wire::AlStatusCode;

struct Transition {
    AlState from = AlState::none;
    AlState to = AlState::none;
    [[nodiscard]] constexpr bool up() const { return to > from && to != AlState::boot; }
    friend constexpr bool operator==(const Transition&, const Transition&) = default;
};

// Answer to the question whether a transition may happen: go; wait, and ask again at the given time; or refuse with an
// AL status code.
class Verdict {
  public:
    [[nodiscard]] static constexpr Verdict go() { return {Kind::go, AlStatusCode::none, kNever}; }
    [[nodiscard]] static constexpr Verdict wait(Time again) { return {Kind::wait, AlStatusCode::none, again}; }
    [[nodiscard]] static constexpr Verdict refuse(AlStatusCode why) { return {Kind::refuse, why, kNever}; }

    [[nodiscard]] constexpr bool goes() const { return kind_ == Kind::go; }
    [[nodiscard]] constexpr bool waits() const { return kind_ == Kind::wait; }
    [[nodiscard]] constexpr AlStatusCode why() const { return why_; }
    [[nodiscard]] constexpr Time again() const { return again_; }

  private:
    enum class Kind : std::uint8_t { go, wait, refuse };
    constexpr Verdict(Kind kind, AlStatusCode why, Time again) : kind_(kind), why_(why), again_(again) {}
    Kind kind_;
    AlStatusCode why_;
    Time again_;
};

// Sizes that the process data sync managers must have for the current mapping, or in `fault` the reason why the mapping
// is invalid.
struct ProcessDataSizes {
    std::uint16_t outputs_bytes = 0;  // of DeviceDescription::outputs
    std::uint16_t inputs_bytes = 0;   // of DeviceDescription::inputs
    AlStatusCode fault = AlStatusCode::none;
    std::array<std::uint16_t, kMostMoreAreas> more_outputs_bytes{};  // of DeviceDescription::more_outputs
    std::array<std::uint16_t, kMostMoreAreas> more_inputs_bytes{};

    // The size of area `n`, which is counted as for_each_area() does.
    [[nodiscard]] constexpr std::uint16_t& of(bool outputs, std::size_t n) {
        if (n == 0) return outputs ? outputs_bytes : inputs_bytes;
        return (outputs ? more_outputs_bytes : more_inputs_bytes)[n - 1];
    }
    [[nodiscard]] constexpr std::uint16_t of(bool outputs, std::size_t n) const {
        return const_cast<ProcessDataSizes&>(*this).of(outputs, n);
    }
    [[nodiscard]] constexpr std::size_t all(bool outputs) const {
        std::size_t bytes = 0;
        for (std::size_t n = 0; n <= kMostMoreAreas; ++n) bytes += of(outputs, n);
        return bytes;
    }
};

// The parts of the device that the state machine calls. All calls come from Esm::step() and Esm::fall_back().
class EsmClient {
  public:
    // The explicit device identification; 0: not supported, or the position 0 of a switch
    // (DeviceDescription::device_id_switch). Called when the master asks for it.
    [[nodiscard]] virtual std::uint16_t device_id() = 0;

    // Called during the checks of PREOP→SAFEOP.
    [[nodiscard]] virtual ProcessDataSizes process_data_sizes() = 0;

    // Decides whether the transition may happen. Called after the checks; as long as the answer is wait(), the checks
    // and the question are repeated. The AL status does not change in the meantime. Not called when an error forces the
    // device down.
    [[nodiscard]] virtual Verdict before(Transition transition, Time now) = 0;

    // A waiting transition is cancelled because the master has requested something else, has changed its configuration
    // so that the checks fail, or because an error forces the device down. A request for a state that is lower than the
    // one after the error goes on: before() is called again with the transition from there.
    virtual void dropped(Transition transition) = 0;

    // Executes the transition: starts or stops the functions that belong to the states. Sync managers that the new
    // state needs are already activated; sync managers that it does not need are deactivated afterwards. AL status is
    // written after this function returns.
    virtual void perform(Transition transition, Time now) = 0;

    // AL status now reports the new state.
    virtual void after(Transition transition, Time now) = 0;

  protected:
    ~EsmClient() = default;
};

class Esm {
  public:
    // All three arguments must outlive the state machine.
    Esm(EscAccess& esc, const DeviceDescription& device, EsmClient& client)
        : esc_(esc), device_(device), client_(client) {}

    // Start-up: deactivates all sync managers and sets AL status to INIT without error.
    void init();

    // Handles AL control and changes of the sync managers. `events` is the value just read from the AL event request
    // (0x0220). Returns the latest time for the next call; call it earlier when an AL event occurs.
    Time step(Time now, std::uint32_t events);

    // The condition for a waiting transition may be met now: repeats the checks, and asks the client at once.
    void ask_again(Time now);

    // The device itself decides to go down to `to`, with error indication. When the current state is not above `to`,
    // only the error indication is set. During a call of the client the effect is delayed: a call from
    // EsmClient::before() takes the place of its answer, and the transition does not happen; one from perform() has its
    // effect behind the transition, whose state AL status reports with the error indication; one from after() has its
    // effect when after() has returned.
    void fall_back(AlState to, AlStatusCode why, Time now);

    // From hold() to release(), a call of fall_back() is only noted. release() executes it.
    void hold() { holding_ = true; }
    void release(Time now);

    [[nodiscard]] AlState state() const { return status_.state; }
    [[nodiscard]] const AlStatus& status() const { return status_; }
    [[nodiscard]] bool changing() const { return pending_; }

  private:
    void control(std::uint16_t al_control, Time now);
    void request(AlState to, Time now);
    [[nodiscard]] AlStatusCode check(Transition transition);
    [[nodiscard]] AlStatusCode check_mailbox(AlState state);
    [[nodiscard]] AlStatusCode check_areas();
    void advance(Time now);
    void carry_out(Transition transition, Time now);
    void refuse(AlStatusCode why);
    void drop_pending();
    void watch_sync_managers(Time now);
    void disable_sync_managers(Transition transition);
    void enable_mailboxes(bool enabled);
    void enable_process_data(bool enabled);
    void set_enabled(std::uint8_t sync_manager, bool enabled);
    void write_status();

    EscAccess& esc_;
    const DeviceDescription& device_;
    EsmClient& client_;
    AlStatus status_{};
    Transition transition_{};  // the pending transition
    Time again_ = kNever;      // time of the next question to the client
    bool pending_ = false;
    bool holding_ = false;         // fall_back() notes its arguments in held_
    AlStatus held_{};              // `state` none: fall_back() was not called; `error`: the next status has the error
    bool identifying_ = false;     // the master asks for the explicit device ID, and the device has one
    std::uint16_t device_id_ = 0;  // the answer
};

}  // namespace margay::subdevice
