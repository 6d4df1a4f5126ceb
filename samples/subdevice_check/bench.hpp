// The bench of the conformance check: one slave, its registers and its states, without the help of the master. The
// master finds the slave and reads its SII; then every octet that the slave receives comes from the checks.
#pragma once

#include "osal/osal.hpp"
#include "subdevice_check/cycle.hpp"
#include "subdevice_check/report.hpp"
#include "wire/esc.hpp"

#include <fmt/format.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace margay::samples::conformance {

namespace reg = wire::reg;

// Ends a check without a result, because the slave does not do what the check requires. Another check reports the
// fault.
struct NotJudged {
    std::string reason{};
};
// A frame was lost. The check is repeated once.
struct LineFault {
    std::string reason{};
};

class Bench {
  public:
    // config_init() has run for `ctx`. `nics` is what the osal waits for.
    Bench(Context& ctx, Osal& osal, WaitHandles nics, std::uint16_t number);

    [[nodiscard]] const Slave& slave() const;
    [[nodiscard]] Context& context() { return ctx_; }
    [[nodiscard]] std::uint16_t number() const { return number_; }
    [[nodiscard]] bool has(std::uint16_t protocol) const;  // a bit of mailbox_protocol
    [[nodiscard]] bool has_mailbox() const { return slave().mailbox.present(); }
    // The AL status mirrors AL control (0x0141 bit 0): the slave has no state machine of its own.
    [[nodiscard]] bool emulation() const { return slave().device_emulation; }

    // --- What the running check says ---
    void begin(CheckResult& result, std::string_view clause);
    // The clause of the check, or another one for this finding.
    void fail(std::string text, std::string_view clause = {}) { add(Severity::error, std::move(text), clause); }
    void remark(std::string text, std::string_view clause = {}) { add(Severity::remark, std::move(text), clause); }
    [[noreturn]] void skip(std::string reason) { throw NotJudged{std::move(reason)}; }

    // --- Registers ---
    // False: working counter 0, the slave has not executed the access.
    [[nodiscard]] bool try_read(std::uint16_t address, MutableBytes into);
    [[nodiscard]] bool try_write(std::uint16_t address, Bytes data);
    void read_octets(std::uint16_t address, MutableBytes into);
    void write_octets(std::uint16_t address, Bytes data);
    template <class T>
    [[nodiscard]] T read(std::uint16_t address) {
        std::array<std::byte, sizeof(T)> octets{};
        read_octets(address, octets);
        return load_le<T>(octets);
    }
    template <class T>
    void write(std::uint16_t address, T value) {
        std::array<std::byte, sizeof(T)> octets{};
        store_le<T>(octets, 0, value);
        write_octets(address, octets);
    }
    void write_sync_manager(unsigned n, const wire::SyncManager& setting);
    [[nodiscard]] wire::SyncManager read_sync_manager(unsigned n);
    [[nodiscard]] std::uint8_t sync_manager_status(unsigned n);

    // --- Time ---
    [[nodiscard]] Time now() { return osal_.now(); }
    void wait(Duration time);

    // --- States ---
    [[nodiscard]] AlStatus al_status();
    void request(unsigned al_control);
    // The slave does not do what all checks require. Reports an error (the first time), and ends the check.
    [[noreturn]] void stuck(const std::string& why);
    // Requests a state and waits until the slave is there, or reports an error. Exchanges process data meanwhile when
    // `with_process_data` is set. Returns the last AL status.
    AlStatus go(AlState state, bool with_process_data = true);
    // Waits for the error indication, as long as a slave may take for a transition. The wait ends earlier when the
    // slave has changed to another state without an error.
    AlStatus refused();
    // Waits a short time for a change that must not occur.
    AlStatus unchanged();
    // From any state to `state`, with the configuration of the SII and of the PDO objects. Throws NotJudged when the
    // slave does not get there.
    void enter(AlState state);
    // To INIT with an acknowledge, and everything that a master configures cleared.
    void reset();
    // The same with the configuration for one step only; errors of the slave are returned, not thrown.
    void configure_mailboxes(bool boot = false);
    void configure_process_data();
    // The EEPROM belongs to the PDI, or again to the master.
    void give_eeprom(bool to_pdi);
    // Longest time that a slave may take for a transition (ETG.2000, default of the ESI element Info/StateMachine).
    [[nodiscard]] static Duration patience(AlState to);

    // --- Distributed clocks ---
    // Some slaves refuse SAFEOP or OP without SYNC signals. `activate` writes the SYNC unit in PREOP, by the operation
    // mode of the SII; with `attempt` from 1 on it chooses another cycle. `attempts` is the number of cycles.
    // It returns the period of the frames that suits the cycle.
    void on_clock(std::function<Duration(unsigned attempt)> activate, unsigned attempts) {
        activate_clock_ = std::move(activate);
        most_attempts_ = attempts;
    }
    // Whether the transition was refused because the clock is off, or because of its cycle. Then
    // configure_process_data() activates the clock from now on, or chooses another cycle: try again.
    [[nodiscard]] bool wants_clock(const AlStatus& status);
    // Whether the slave has refused every cycle that the master may choose: another one may be right.
    [[nodiscard]] bool no_cycle_suits(const AlStatus& status) const;
    [[noreturn]] void skip_without_cycle(const AlStatus& status);
    [[nodiscard]] bool uses_clock() const { return clock_attempts_ != 0; }
    [[nodiscard]] Duration period() const { return period_; }

    // --- Process data ---
    [[nodiscard]] const std::vector<ProcessArea>& areas() const { return areas_; }
    [[nodiscard]] const ProcessArea* area(bool outputs) const;
    // Writes zeros to all outputs and reads all inputs at the multiples of period() for `time`, or until `done` returns
    // true. Returns whether it did. The frames continue while `done` executes and waits.
    bool run(Duration time, const std::function<bool()>& done = {}) { return run(time, done, period_); }
    bool run(Duration time, const std::function<bool()>& done, Duration period);
    // In OP, process data go on while the returned object exists: also between two run().
    [[nodiscard]] std::optional<CycleRun> frames_in(AlState state);
    // Of the last run().
    [[nodiscard]] const Cycle& cycle() const { return cycle_; }
    // Cycle::latest() counts from now on.
    void forget_late() { cycle_.forget_late(); }
    // Replaces the length of an area when the objects of PDO assignment give another one than the SII.
    void set_area_length(std::uint8_t sync_manager, std::uint16_t bytes);
    // Called in PREOP before process data are configured: finds the lengths of the areas.
    void on_preop(std::function<void()> find_lengths) { find_lengths_ = std::move(find_lengths); }
    // Called after the slave has left INIT or BOOT: the mailboxes are new.
    void on_mailbox_start(std::function<void()> restart) { mailbox_started_ = std::move(restart); }

  private:
    void add(Severity severity, std::string text, std::string_view clause);
    void find_areas();
    [[nodiscard]] bool try_to_enter(AlState state);
    void check_line(const Error& error) const;
    bool finish(Request& request, const Result<>& submitted);
    // Executes what is due, and waits until `until` at the latest, or not at all when the awaited request is over.
    void progress(Time until, const Request* awaited = nullptr);

    Context& ctx_;
    Osal& osal_;
    WaitHandles nics_;
    std::uint16_t number_;
    std::vector<ProcessArea> areas_;
    Cycle cycle_;
    std::function<void()> find_lengths_;
    std::function<void()> mailbox_started_;
    std::function<Duration(unsigned)> activate_clock_;
    Duration period_ = std::chrono::milliseconds(1);
    unsigned clock_attempts_ = 0;
    unsigned most_attempts_ = 0;
    bool told_stuck_ = false;
    CheckResult* result_ = nullptr;
    std::string_view clause_;
};

[[nodiscard]] std::string status_text(const AlStatus& status);
[[nodiscard]] std::string state_text(AlState state);
// Whether the slave refuses the cycle of its clock: AL status code 0x0035 or 0x0036.
[[nodiscard]] bool refuses_cycle(const AlStatus& status);

}  // namespace margay::samples::conformance
