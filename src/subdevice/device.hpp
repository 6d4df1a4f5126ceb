// A whole device: state machine, mailbox, process data and EEPROM emulation on one ESC.
//
// Three ways to run a device:
// - polling: step() does everything. Call step() in a loop, or sleep until the returned time or the next AL event.
// - mixed: SM2 and SYNC0 raise interrupts, and the interrupt handler calls interrupt(). step() polls the rest.
// - interrupts: all events raise interrupts. interrupt() processes the process data at once, masks the other events and
//   returns them. When the returned value is not zero, wake a task that calls step().
//
// interrupt() and step() must not execute at the same time on one ESC: disable the interrupt (or lower its priority)
// while step() executes, or lock in EscAccess.
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
    // the firmware restarts.
    void start(Time now);

    // Does all work that interrupt() does not do. Returns the latest time for the next call; call it earlier when an AL
    // event occurs.
    Time step(Time now);

    // Call it from the handler of the PDI interrupt (or of a separate SYNC0 interrupt). Returns the events that step()
    // must handle.
    std::uint32_t interrupt(Time now);

    // Executes single parts of one process data update, for authors who choose the order of the parts (see part::).
    void process(unsigned parts, Time now) { process_data_.process(parts, now); }

    // The application reports an error of its own: the device goes down to `to` and sets the error indication with code
    // `why`.
    void fall_back(AlState to, AlStatusCode why, Time now) { esm_.fall_back(to, why, now); }

    [[nodiscard]] const AlStatus& al_status() const { return esm_.status(); }
    [[nodiscard]] AlState state() const { return esm_.state(); }

  private:
    ProcessDataSizes process_data_sizes() override { return process_data_.sizes(); }
    Verdict before(Transition transition, Time now) override;
    void dropped(Transition transition) override;
    void perform(Transition transition, Time now) override;
    void after(Transition transition, Time now) override;
    void write_mask();
    [[nodiscard]] bool outputs_came() const;
    [[nodiscard]] std::uint32_t background_events() const;

    EscAccess& esc_;
    Application& application_;
    ProcessData& process_data_;
    Mailbox* mailbox_;
    EepromEmulation* eeprom_;
    RunMode run_mode_;
    Esm esm_;
    Time outputs_until_ = kNever;  // SAFEOP→OP: end of the wait for outputs and SYNC0
};

}  // namespace margay::subdevice
