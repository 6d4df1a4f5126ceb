// The servodrive profile over EtherCAT (SoE, ETG.1000.6) as the application sees it: the parameters of drives, by
// requests that run beside the cycle and by calls that wait.
//
//     margay::SoeRead request;                         // lives in the caller's memory, may be used again and again
//     request.slave = 2;
//     request.idn = margay::Idn::standard(51);         // S-0-0051, position feedback
//     request.data = buffer;
//     margay::submit(ctx, request);                    // from any thread
//     … the owner of the context goes on with poll() or its cycle …
//     if (request.state() == margay::RequestState::success) use(request.data.first(request.bytes));
//
//     auto position = margay::SoEread<std::int32_t>(ctx, 2, 0, margay::Idn::standard(51));   // waits
//
// What drives report on their own goes to slave(n).hooks.soe_notification.
#pragma once

#include <margay/coe.hpp>
#include <margay/idn.hpp>

namespace margay {

// ------------------------------------------------------------------ requests

// Reads elements of a parameter: one or several, which come one behind the other in the order of their bits. A name, a
// unit and the value of a list begin with two octets of present and two of largest length. Any size; Errc::capacity
// (expected: the octets there are) when `data` is too small.
struct SoeRead : MailRequest {
    SoeRead();
    std::uint8_t drive = 0;  // of the slave, 0 to 7
    Idn idn;
    std::uint8_t elements = soe_element::kValue;
    std::span<std::byte> data;  // the elements go here; the memory is the caller's
    std::size_t bytes = 0;      // result
};

// Writes an element, in nearly every case the value.
struct SoeWrite : MailRequest {
    SoeWrite();
    std::uint8_t drive = 0;
    Idn idn;
    std::uint8_t elements = soe_element::kValue;
    std::span<const std::byte> data;
};

// Executes a procedure command: sets and enables it, looks at its data state until it is done, and takes it back.
// Cancelled, or with `timeout` over, the command is taken back too. Without a timeout it waits for as long as the drive
// works on it.
struct SoeCommand : MailRequest {
    SoeCommand();
    std::uint8_t drive = 0;
    Idn idn;
};

// ------------------------------------------------------------------ calls that wait
//
// Each submits the request of its kind and waits for it: see wait() for what that means in which thread.

// Reads elements, returns their octets. Errors: soe_error (detail: its code, which describe() puts in words), capacity
// (expected: octets there are), timeout, mailbox_error, protocol, unsupported, unknown_slave …
Result<std::size_t> SoEread(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, std::uint8_t elements,
                            std::span<std::byte> into, Duration timeout = Duration{0});
Result<> SoEwrite(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, std::uint8_t elements,
                  std::span<const std::byte> value, Duration timeout = Duration{0});

// Executes a procedure command. Errors: those of SoEread(), command_failed (detail: the data state).
Result<> SoEcommand(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, Duration timeout = Duration{0});

// What kind of value a parameter has.
Result<SoeAttribute> SoEattribute(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn,
                                  Duration timeout = Duration{0});

// Reads a name, a unit or a value that is a text into `into`, which has room for four octets more than the text, and
// returns the text without zeros behind it.
Result<std::string_view> SoEread_text(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn,
                                      std::uint8_t element, std::span<char> into, Duration timeout = Duration{0});

// Reads a value of exactly that size: Errc::wrong_size, or capacity, when the drive's has another one.
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

template <SdoValue T>
Result<> SoEwrite(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, T value,
                  Duration timeout = Duration{0}) {
    const auto octets = octets_of(value);
    return SoEwrite(ctx, slave, drive, idn, soe_element::kValue, std::span<const std::byte>(octets), timeout);
}

// An error code in words, as of the standard's table. A static string, callable from anywhere.
[[nodiscard]] std::string_view soe_error_text(std::uint16_t code);

}  // namespace margay
