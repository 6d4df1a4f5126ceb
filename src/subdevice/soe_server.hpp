// Servodrive profile over EtherCAT: the server of mailbox type SoE (ETG.1000.6 "Servo drive profile over EtherCAT").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "subdevice/soe_parameters.hpp"

#include <array>
#include <span>

namespace margay::subdevice {

using SoeError = wire::soe::ErrorCode;

class SoeApplication;

// One drive of a device. All of it outlives the server.
struct SoeDrive {
    std::span<const SoeParameter> parameters;
    MutableBytes image;
    SoeApplication* application = nullptr;

    [[nodiscard]] const SoeParameter* find(Idn idn) const;
    // A number, or an element of a list of IDNs, as it is now.
    [[nodiscard]] std::uint64_t number(Idn idn) const;
    [[nodiscard]] std::span<const std::byte> list(Idn idn) const;  // its elements
    // Everything as the table has it at first.
    void restore_defaults() const;
};

// What a hook is told.
struct SoeAccess {
    const SoeParameter& parameter;
    std::uint8_t drive = 0;
    AlState state = AlState::none;
    Time now{};
};

// What the author of a drive implements; every function has an answer already. Called from within Device::step().
class SoeApplication {
  public:
    // The value may be brought up to date.
    [[nodiscard]] virtual SoeError before_read(const SoeAccess& access) {
        (void)access;
        return SoeError::none;
    }
    // `value` has the right length and keeps the bounds.
    [[nodiscard]] virtual SoeError before_write(const SoeAccess& access, Bytes value) {
        (void)access, (void)value;
        return SoeError::none;
    }
    virtual void after_write(const SoeAccess& access) { (void)access; }
    // A procedure command begins, and goes on until SoeServer::finish_command(), which may be called at once.
    [[nodiscard]] virtual SoeError start_command(const SoeAccess& access) {
        (void)access;
        return SoeError::command_not_now;
    }
    // It is interrupted or taken back before its end.
    virtual void stop_command(const SoeAccess& access) { (void)access; }

  protected:
    ~SoeApplication() = default;
};

class SoeServer final : public MailboxServer {
  public:
    // `staging` holds what travels in fragments, in either direction: nothing larger can be read or written.
    SoeServer(std::span<const SoeDrive> drives, MutableBytes staging) : drives_(drives), staging_(staging) {}

    void start(AlState state, const MailboxRoom& room) override;
    void state_changed(AlState state) override { state_ = state; }
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;
    [[nodiscard]] bool busy() const override { return sending_; }
    Time step(Outbox& out, Time now) override;

    // A procedure command is over: its data state says so, and the master is notified. Nothing, when it was not
    // running.
    void finish_command(std::uint8_t drive, Idn idn, bool success);
    // An emergency: at most eight octets. False: too many wait already.
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
    [[nodiscard]] SoeError store(Bytes data, Time now);
    [[nodiscard]] SoeError check(Bytes data) const;
    [[nodiscard]] SoeError command(std::uint16_t control, Time now);
    void answer(wire::soe::Opcode opcode, SoeError error, Outbox& out);
    bool send_next(Outbox& out);
    bool note(const Note& note);

    std::span<const SoeDrive> drives_;
    MutableBytes staging_;
    AlState state_ = AlState::init;

    // The request in hand.
    wire::soe::Header header_;
    const SoeDrive* drive_ = nullptr;
    const SoeParameter* parameter_ = nullptr;
    std::uint16_t address_ = 0;
    std::size_t used_ = 0;       // octets in staging_
    std::size_t sent_ = 0;       // of them
    bool sending_ = false;       // fragments are left to be sent
    std::uint16_t to_come_ = 0;  // fragments of a write
    bool too_long_ = false;      // they do not fit

    std::array<Note, 4> notes_{};
    std::uint8_t first_note_ = 0;
    std::uint8_t note_count_ = 0;
};

}  // namespace margay::subdevice
