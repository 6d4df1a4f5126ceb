// The EtherCAT state machine from the slave's side (ETG.1000.6 "EtherCAT state machine"): reads AL control,
// checks what the master configured against the device's description, asks the application, and answers in AL
// status.
#pragma once

#include "subdevice/description.hpp"
#include "subdevice/esc_access.hpp"
#include "wire/al_status_code.hpp"

#include <margay/al_state.hpp>

namespace margay::subdevice {

using wire::AlStatusCode;

struct Transition {
    AlState from = AlState::none;
    AlState to = AlState::none;
    [[nodiscard]] constexpr bool up() const { return to > from && to != AlState::boot; }
    friend constexpr bool operator==(const Transition&, const Transition&) = default;
};

// Answer to "may this transition happen?": yes; not yet, ask again at a time; or no, for this reason.
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

// Sizes that the sync managers of process data must have for the mapping in force, or the reason why there
// are none.
struct ProcessDataSizes {
    std::uint16_t outputs_bytes = 0;
    std::uint16_t inputs_bytes = 0;
    AlStatusCode fault = AlStatusCode::none;
};

// The rest of the device, as the state machine sees it. Called from within Esm::step() and Esm::fall_back().
class EsmClient {
  public:
    // Asked when PREOP→SAFEOP is checked.
    [[nodiscard]] virtual ProcessDataSizes process_data_sizes() = 0;

    // May the transition happen? Asked after the checks, again and again while the answer is wait(). The AL
    // status stays as it is meanwhile. Not asked when a fault forces the device down.
    [[nodiscard]] virtual Verdict before(Transition transition, Time now) = 0;

    // A transition that waited will not happen: the master asked for something else.
    virtual void dropped(Transition transition) = 0;

    // Do it: start or stop what belongs to the states. Sync managers are already switched on; they are
    // switched off afterwards. AL status is written when this returns.
    virtual void perform(Transition transition, Time now) = 0;

    // AL status tells the new state.
    virtual void after(Transition transition, Time now) = 0;

  protected:
    ~EsmClient() = default;
};

class Esm {
  public:
    // All three outlive the state machine.
    Esm(EscAccess& esc, const DeviceDescription& device, EsmClient& client)
        : esc_(esc), device_(device), client_(client) {}

    // Start-up: all sync managers locked, AL status INIT without error.
    void init();

    // Serves AL control and changes of the sync managers. `events` is the AL event request (0x0220) as just
    // read. Returns when it wants to be called at the latest though no event comes.
    Time step(Time now, std::uint32_t events);

    // What a transition waited for has come: the client is asked again at once.
    void ask_again(Time now) {
        if (pending_) advance(now);
    }

    // The device's own decision to go down: to `to` (or to where it is, when that is lower), with error
    // indication.
    void fall_back(AlState to, AlStatusCode why, Time now);

    [[nodiscard]] AlState state() const { return status_.state; }
    [[nodiscard]] const AlStatus& status() const { return status_; }
    [[nodiscard]] bool changing() const { return pending_; }

  private:
    void control(std::uint16_t al_control, Time now);
    void request(AlState to, Time now);
    void advance(Time now);
    void carry_out(Time now);
    void refuse(AlStatusCode why);
    void drop_pending();
    void watch_sync_managers(Time now);
    void enable_sync_managers(Transition transition);
    void disable_sync_managers(Transition transition);
    void set_enabled(std::uint8_t sync_manager, bool enabled);
    void write_status();

    EscAccess& esc_;
    const DeviceDescription& device_;
    EsmClient& client_;
    AlStatus status_{};
    Transition transition_{};  // the pending one
    Time again_ = kNever;      // when the client wants to be asked again
    bool pending_ = false;
    bool identification_ = false;  // AL control asks for the explicit device id
};

}  // namespace margay::subdevice
