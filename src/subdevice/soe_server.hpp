// Servo drive profile over EtherCAT: the server for mailbox type SoE (ETG.1000.6 "Servo drive profile over EtherCAT").
#pragma once

#include "subdevice/esc_access.hpp"
#include "subdevice/mailbox_server.hpp"
#include "subdevice/soe_parameters.hpp"

#include <array>
#include <span>

namespace margay::subdevice {

using SoeError = wire::soe::ErrorCode;

class SoeApplication;

// One drive of a device. All its members must outlive the server.
struct SoeDrive {
    std::span<const SoeParameter> parameters;
    MutableBytes image;
    SoeApplication* application = nullptr;

    [[nodiscard]] const SoeParameter* find(Idn idn) const;
    // The current value of a number; 0 for a list or an unknown IDN.
    [[nodiscard]] std::uint64_t number(Idn idn) const;
    [[nodiscard]] std::span<const std::byte> list(Idn idn) const;  // the elements of a list in the image
    // Sets all values in the image to the initial values of the table.
    void restore_defaults() const;
};

// The arguments of a hook.
struct SoeAccess {
    const SoeParameter& parameter;
    std::uint8_t drive = 0;
    AlState state = AlState::none;
    Time now{};
};

// The interface that the author of a drive implements. Every function has a default. All calls come from
// Device::step().
class SoeApplication {
  public:
    // May update the value before it is read.
    [[nodiscard]] virtual SoeError before_read(const SoeAccess& access) {
        (void)access;
        return SoeError::none;
    }
    // `value` has a valid length and is within the limits.
    [[nodiscard]] virtual SoeError before_write(const SoeAccess& access, Bytes value) {
        (void)access, (void)value;
        return SoeError::none;
    }
    virtual void after_write(const SoeAccess& access) { (void)access; }
    // Starts a procedure command. It is active until SoeServer::finish_command() is called; that may happen within this
    // call.
    [[nodiscard]] virtual SoeError start_command(const SoeAccess& access) {
        (void)access;
        return SoeError::command_not_now;
    }
    // The procedure command is interrupted or cancelled before its end.
    virtual void stop_command(const SoeAccess& access) { (void)access; }

  protected:
    ~SoeApplication() = default;
};

class SoeServer final : public MailboxServer {
  public:
    // `staging` stores values that are transferred in fragments, in both directions. Larger values cannot be read or
    // written. `lock` is held while a value is copied, because an interrupt handler may change the value; nullptr: no
    // interrupt handler uses the values.
    SoeServer(std::span<const SoeDrive> drives, MutableBytes staging, EscAccess* lock = nullptr)
        : drives_(drives), staging_(staging), lock_(lock) {}

    void start(AlState state, const MailboxRoom& room) override;
    // A procedure command continues, because the drive executes it, not the mailbox.
    void stop() override;
    void state_changed(AlState state) override { state_ = state; }
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;
    [[nodiscard]] bool busy() const override { return sending_; }
    Time step(Outbox& out, Time now) override;

    // Ends a procedure command: sets its data state and notifies the master. Does nothing when the command is not
    // active.
    void finish_command(std::uint8_t drive, Idn idn, bool success);
    // Sends an emergency of at most eight octets. Returns false when too many emergencies are already waiting.
    bool report(std::uint8_t drive, Bytes data);

  private:
    struct Note {
        wire::soe::Header header;
        std::array<std::byte, 8> data{};
        std::uint8_t bytes = 0;
    };

    [[nodiscard]] SoeError find(const wire::soe::Header& header);
    [[nodiscard]] SoeAccess access(Time now) const { return {*parameter_, header_.drive, state_, now}; }
    void read(Outbox& out, Time now);
    [[nodiscard]] SoeError compose(Time now);
    [[nodiscard]] SoeError add_element(std::uint8_t element);
    [[nodiscard]] SoeError add_value();
    [[nodiscard]] bool add(Bytes octets);
    [[nodiscard]] bool add_text(std::string_view text);
    [[nodiscard]] bool add_number(std::uint64_t value);
    void write(const wire::soe::Header& header, Bytes data, Outbox& out, Time now);
    [[nodiscard]] SoeError store_fragments(Time now);
    [[nodiscard]] SoeError store(Bytes data, Time now);
    [[nodiscard]] SoeError check(Bytes data) const;
    [[nodiscard]] SoeError command(std::uint16_t control, Time now);
    void answer(wire::soe::Opcode opcode, SoeError error, Outbox& out);
    bool send_next(Outbox& out);
    bool note(const Note& note);

    std::span<const SoeDrive> drives_;
    MutableBytes staging_;
    EscAccess* lock_;
    AlState state_ = AlState::init;

    // The current request.
    wire::soe::Header header_;
    const SoeDrive* drive_ = nullptr;
    const SoeParameter* parameter_ = nullptr;
    std::uint16_t address_ = 0;
    std::size_t used_ = 0;       // octets in staging_
    std::size_t sent_ = 0;       // octets of staging_ already sent
    bool sending_ = false;       // fragments remain to be sent
    std::uint16_t to_come_ = 0;  // fragments of a write that are still expected
    bool too_long_ = false;      // the fragments do not fit into staging_
    std::size_t begins_ = 0;     // where in staging_ another write may have begun; 0: nowhere
    Time heard_{};               // time of the last fragment

    std::array<Note, 4> notes_{};
    std::uint8_t first_note_ = 0;
    std::uint8_t note_count_ = 0;
};

}  // namespace margay::subdevice
