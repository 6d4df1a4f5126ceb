// A whole device: state machine, mailbox, process data and EEPROM emulation over one ESC.
//
// Three ways to run it:
//   polling     step() does everything. Call it again and again, or sleep until the time it returned or an AL
//   event. mixed       SM2 and SYNC0 raise interrupts, whose handler calls interrupt(); step() polls the
//   rest. interrupts  everything raises interrupts: interrupt() does process data at once, masks the rest and
//   returns it; when
//               it is not zero, wake a task that calls step().
// interrupt() and step() must not run at the same time on one ESC: either the handler's priority is lowered
// while step() runs, or the EscAccess locks.
#pragma once

#include "subdevice/eeprom_emulation.hpp"
#include "subdevice/mailbox.hpp"
#include "subdevice/process_data.hpp"

namespace margay::subdevice {

enum class RunMode : std::uint8_t { polling, mixed, interrupts };

class Device final : private EsmClient {
  public:
    // All outlive the device. `mailbox` and `eeprom` may be nullptr: a device without.
    Device(EscAccess& esc, Application& application, ProcessData& process_data, Mailbox* mailbox = nullptr,
           EepromEmulation* eeprom = nullptr, RunMode mode = RunMode::polling)
        : esc_(esc),
          application_(application),
          process_data_(process_data),
          mailbox_(mailbox),
          eeprom_(eeprom),
          run_mode_(mode),
          esm_(esc, application.description(), *this) {}

    // Start-up: INIT, sync managers locked, event mask of the mode. Also what a restart of the firmware
    // calls.
    void start(Time now);

    // Everything that is not left to interrupts. Returns when it wants to be called at the latest though no
    // event comes.
    Time step(Time now);

    // From the handler of the PDI interrupt (or of a SYNC0 interrupt of its own). Returns the events that are
    // left to step().
    std::uint32_t interrupt(Time now);

    // One update by hand, for authors who order the parts themselves (see part::).
    void process(unsigned parts, Time now) { process_data_.process(parts, now); }

    // The application's own fault: down to `to`, with error indication.
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
    Time outputs_until_ = kNever;  // SAFEOP→OP waits for outputs and SYNC0, no longer than this
};

}  // namespace margay::subdevice
