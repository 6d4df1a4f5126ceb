// Servo drive profile over EtherCAT (SoE, ETG.1000.6) for the application: access to the parameters of drives, by
// requests that run beside the cycle and by functions that wait.
//
//     margay::SoeRead request;                         // lives in the caller's memory, may be used again and again
//     request.slave = 2;
//     request.idn = margay::Idn::standard(51);         // S-0-0051, feedback value
//     request.data = buffer;
//     margay::submit(ctx, request);                    // from any thread
//     … the owner of the context goes on with poll() or its cycle …
//     if (request.state() == margay::RequestState::success) use(request.data.first(request.bytes));
//
//     auto feedback = margay::SoEread<std::int32_t>(ctx, 2, 0, margay::Idn::standard(51));   // waits
//
// After a timeout or cancel() the drive may still answer. The next request to this drive waits for the late answer for
// 100 ms (after cancel() for the rest of the `timeout`, 3 s if it is zero). Then the library asks the drive for a
// parameter that no drive has. A drive answers in order, so no late answer can follow the answer to this question, and
// the request is sent after it. With a slow drive, one or two requests may end with timeout and are not sent. If a
// drive never answers the question, the library sends the request once more for each late answer (14 at most), and uses
// the last answer.
//
// Messages that drives send on their own go to a SoeListener.
#pragma once

#include <margay/borrowed.hpp>
#include <margay/coe.hpp>
#include <margay/idn.hpp>
#include <margay/mail_listener.hpp>

namespace margay {

// ------------------------------------------------------------------ requests

// Reads one or several elements of a parameter; several follow each other in the order of their bits. A name, a unit
// and the value of a list begin with a list head: two octets with the present length and two with the maximum length.
// Any size; Errc::capacity (expected: the size in octets) if `data` is too small.
struct SoeRead : MailRequest {
    SoeRead();
    std::uint8_t drive = 0;  // drive in the slave, 0 to 7
    Idn idn;
    std::uint8_t elements = soe_element::kValue;
    std::span<std::byte> data;  // destination of the elements; the caller's memory
    std::size_t bytes = 0;      // result: size in octets
};

// Writes an element, usually the value. `data` is the caller's memory. After a timeout the drive may have written the
// element or not.
struct SoeWrite : MailRequest {
    SoeWrite();
    std::uint8_t drive = 0;
    Idn idn;
    std::uint8_t elements = soe_element::kValue;
    Borrowed<std::byte> data;
};

// Executes a procedure command: sets and enables it, reads its data state until it is finished, and clears it. If the
// request is cancelled or `timeout` is over, the command is cleared too. Without a timeout the request waits as long as
// the drive executes the command.
struct SoeCommand : MailRequest {
    SoeCommand();
    std::uint8_t drive = 0;
    Idn idn;
};

// ------------------------------------------------------------------ messages that drives send on their own

// A message of a drive: a procedure command has been executed, or an emergency has occurred.
struct SoeNotification {
    bool emergency = false;
    std::uint8_t drive = 0;
    std::uint8_t elements = 0;  // soe_element bits
    Idn idn;                    // of the command
    Borrowed<std::byte> data;   // valid until notified() returns
};

// Receives notifications and emergencies of drives; see mail_listener.hpp.
class SoeListener : public MailListener {
  public:
    SoeListener() : MailListener(MailboxType::soe) {}

  protected:
    ~SoeListener() = default;
    // The rules of MailListener::take() apply.
    virtual void notified(std::uint16_t slave, const SoeNotification& notification) = 0;

  private:
    // Inline, because a program with RTTI derives from this class, and the library has no RTTI.
    bool take(const UnaskedMail& mail) final { return tell(mail); }
    bool tell(const UnaskedMail& mail);
};

// ------------------------------------------------------------------ functions that wait
//
// Each function submits the request of the same name and waits for it; wait() describes how it waits in each thread.

// Reads elements and returns their size in octets. `timeout` zero: 3 s for each answer of the slave. Errors: soe_error
// (detail: the error code; describe() puts it in words), capacity (expected: the size in octets), timeout,
// mailbox_error, protocol, unsupported, unknown_slave …
Result<std::size_t> SoEread(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, std::uint8_t elements,
                            std::span<std::byte> into, Duration timeout = Duration{0});
// Writes an element. Errors as of SoEread().
Result<> SoEwrite(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, std::uint8_t elements,
                  std::span<const std::byte> value, Duration timeout = Duration{0});

// Executes a procedure command. Errors: as SoEread(), command_failed (detail: the data state).
Result<> SoEcommand(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, Duration timeout = Duration{0});

// Reads the attribute of a parameter: the type and the format of its value.
Result<SoeAttribute> SoEattribute(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn,
                                  Duration timeout = Duration{0});

// Reads a name, a unit or a value that is a text. `into` needs four octets more than the text, for the list head.
// Returns the text without trailing zeros.
Result<std::string_view> SoEread_text(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn,
                                      std::uint8_t element, std::span<char> into, Duration timeout = Duration{0});

// Reads a value of exactly this size. Errors: wrong_size or capacity if the value of the drive has another size.
template <SdoValue T>
Result<T> SoEread(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, Duration timeout = Duration{0}) {
    std::array<std::byte, sizeof(T)> octets{};
    const auto read = SoEread(ctx, slave, drive, idn, soe_element::kValue, octets, timeout);
    if (!read) return read.error();
    if (*read != sizeof(T)) {
        Error error{
            .code = Errc::wrong_size, .step = Step::soe_read, .slave = slave, .index = idn.value, .subindex = drive};
        error.expected = static_cast<std::uint32_t>(sizeof(T));
        error.actual = static_cast<std::uint32_t>(*read);
        return error;
    }
    return value_from_octets<T>(octets);
}

// Writes a value of the size of its type.
template <SdoValue T>
Result<> SoEwrite(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, T value,
                  Duration timeout = Duration{0}) {
    const auto octets = octets_of(value);
    return SoEwrite(ctx, slave, drive, idn, soe_element::kValue, std::span<const std::byte>(octets), timeout);
}

// The text of an error code (ETG.1000.6 table "SoE error codes"). A static string, callable from anywhere.
[[nodiscard]] std::string_view soe_error_text(std::uint16_t code);

}  // namespace margay
