// A whole device: state machine, mailbox, process data and EEPROM emulation on one ESC.
//
// The three run modes differ in the function that serves process data when its event comes:
// - polling: step() does. No interrupt is used (the AL event mask is 0). Call step() in a loop.
// - mixed: interrupt() does, called from the handler of the PDI interrupt, which process data events raise. Call step()
//   in a loop for everything else.
// - interrupts: as in mixed, and all other events raise the interrupt too. When interrupt() or sync0() returns a value
//   that is not zero, wake the task that calls step(). That task sleeps until then, or until the time that step()
//   returned.
// In every mode step() serves what depends on time: the free run cycle, watchdogs, delayed replies, and SyncManagers
// that raise no events.
//
// A SYNC0 or SYNC1 signal reaches the device in one of two ways: as an AL event (register 0x0151 maps it into 0x0220;
// see BoardDescription), or at a pin of the processor whose handler calls sync0() or sync1(). The pin works in every
// run mode.
//
// interrupt(), sync0(), sync1() and process() may interrupt step() at any point where step() does not hold the lock of
// EscAccess, and must not execute while it does: implement EscAccess::lock() and unlock() for a device that uses them.
// Applications see the difference. With the lock held, and also from the handlers, these functions of an author
// execute: Application::cycle(), sync1(), safe_outputs(), unpack_outputs(), pack_inputs(), clock() and timestamp_ns().
// Application::description() and the functions that return a part of the device (emergencies(), diagnosis(),
// stored_values()), and ObjectHooks::memory, execute both with the lock and without it. All other functions execute
// without it and only from start() and step(): before(), dropped(), after(), process_data_sizes(), the other hooks of
// objects, mailbox servers, a FoeStore.
#pragma once

#include "subdevice/eeprom_emulation.hpp"
#include "subdevice/mailbox.hpp"
#include "subdevice/process_data.hpp"

namespace margay::subdevice {

enum class RunMode : std::uint8_t { polling, mixed, interrupts };

class Device final : private EsmClient {
  public:
    // All arguments must outlive the device. `mailbox` and `eeprom` are nullptr when the device has none.
    Device(EscAccess& esc, Application& application, ProcessData& process_data, Mailbox* mailbox = nullptr,
           EepromEmulation* eeprom = nullptr, RunMode mode = RunMode::polling)
        : esc_(esc),
          application_(application),
          process_data_(process_data),
          mailbox_(mailbox),
          eeprom_(eeprom),
          run_mode_(mode),
          esm_(esc, application.description(), *this) {}

    // Starts the device: state INIT, sync managers deactivated, AL event mask set for the run mode. Also call it when
    // the firmware restarts. From the context of step().
    void start(Time now);

    // Does all work that interrupt() does not do. Returns the latest time for the next call; call it earlier when an AL
    // event occurs.
    Time step(Time now);

    // Call it from the handler of the PDI interrupt. Serves the process data, masks the events that step() must handle,
    // and returns these events. The interrupt must be sensitive to the level of the line, or the handler must be called
    // again while the line is active.
    std::uint32_t interrupt(Time now);

    // Call them from the handlers of the SYNC0 and SYNC1 pins. From the first call on, the AL event of the signal is
    // ignored. When sync0() returns a value that is not zero, wake the task that calls step(), as after interrupt().
    std::uint32_t sync0(Time now);
    void sync1(Time now);

    // Executes single parts of one process data update, for devices that choose the order of the parts (see part::).
    // Outputs are taken only when they have arrived: a call in each period of a timer does not hide that the master is
    // silent.
    void process(unsigned parts, Time now) {
        const Guard guard(esc_);
        process_data_.process(parts, now);
    }

    // The application reports an error of its own: the device goes down to `to` and sets the error indication with code
    // `why`. From the context of step() only: not from Application::cycle() in an interrupt handler. In a function of
    // the author that a transition calls (Application::before(), cycle(), safe_outputs()), and in each cycle() that
    // step() calls, the effect comes when that function has returned: before() has refused, and the state after a
    // transition is reported with the error indication at once. So the master does not see a success first.
    void fall_back(AlState to, AlStatusCode why, Time now) { esm_.fall_back(to, why, now); }

    [[nodiscard]] const AlStatus& al_status() const { return esm_.status(); }
    [[nodiscard]] AlState state() const { return esm_.state(); }

  private:
    std::uint16_t device_id() override { return application_.device_id(); }
    ProcessDataSizes process_data_sizes() override;
    Verdict before(Transition transition, Time now) override;
    void dropped(Transition transition) override;
    void perform(Transition transition, Time now) override;
    void after(Transition transition, Time now) override;
    void update_mask();
    void set_mask(std::uint32_t mask);
    void wait_for_outputs(Time until);
    [[nodiscard]] std::uint32_t wake(Time now);
    [[nodiscard]] Time deadline() const;
    [[nodiscard]] bool outputs_came(Time now);
    [[nodiscard]] AlStatusCode serve_process_data(Time now, std::uint32_t events);
    [[nodiscard]] std::uint32_t background_events() const;

    EscAccess& esc_;
    Application& application_;
    ProcessData& process_data_;
    Mailbox* mailbox_;
    EepromEmulation* eeprom_;
    RunMode run_mode_;
    Esm esm_;
    Time next_ = kNever;            // returned by the last step()
    Time outputs_until_ = kNever;   // SAFEOP→OP: end of the wait for outputs and SYNC0
    std::uint32_t mask_ = 0;        // content of the AL event mask
    std::uint32_t background_ = 0;  // run mode `interrupts`: events that step() handles
};

}  // namespace margay::subdevice
