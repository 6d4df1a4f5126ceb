// Start-up commands: values that the library writes to a slave at its state transitions. Each command in the list names
// its transitions. Commands are executed in the order of the list, at the first start-up and at every later one, also
// of a slave that comes back.
//
//     static constexpr std::array kGains{std::byte{1}, std::byte{2}, std::byte{3}};
//     static constexpr margay::StartupCommand kStartup[] = {
//         margay::write_object(margay::Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8}),
//         margay::write_object(margay::Transition::preop_to_safeop, 0x2010, 0, kGains),
//         margay::write_register(margay::Transition::init_to_preop, 0x0F80, std::uint16_t{1}),
//         margay::check_register<std::uint16_t>(margay::Transition::safeop_to_op, 0x0F82, 1, 0xFFFF, 50ms),
//     };
//     static constexpr margay::SlaveSetup kSetup{.startup = kStartup};
//     ctx.slave(1).config.setup = &kSetup;
//
// startup_mail.hpp: commands of AoE and EoE.
//
// Commands of IP that are set or changed after config_init() are executed by config_map(): it brings the slave to INIT
// and starts it again. With the configuration set by expect() they are executed by config_init() already.
#pragma once

#include <margay/al_state.hpp>
#include <margay/borrowed.hpp>
#include <margay/idn.hpp>
#include <margay/time.hpp>

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

// State transitions, with their abbreviations in the standard. The operator | combines several of them.
enum class Transition : std::uint16_t {
    none = 0,
    init_to_preop = 0x001,    // IP
    preop_to_safeop = 0x002,  // PS
    safeop_to_op = 0x004,     // SO
    op_to_safeop = 0x008,     // OS
    op_to_preop = 0x010,      // OP
    op_to_init = 0x020,       // OI
    safeop_to_preop = 0x040,  // SP
    safeop_to_init = 0x080,   // SI
    preop_to_init = 0x100,    // PI
    init_to_boot = 0x200,     // IB
    boot_to_init = 0x400,     // BI
};
[[nodiscard]] constexpr Transition operator|(Transition a, Transition b) {
    return static_cast<Transition>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}
[[nodiscard]] constexpr bool contains(Transition all, Transition one) {
    return (static_cast<unsigned>(all) & static_cast<unsigned>(one)) != 0;
}

// The transition from one state to another; none if the standard has no such transition.
[[nodiscard]] Transition transition(AlState from, AlState to);
// The abbreviation, for example "IP"; of several transitions that of the first. A static string.
[[nodiscard]] std::string_view initials(Transition one);

// When a command or hook is executed: before the library requests the state, or after the slave has reached it.
enum class Moment : std::uint8_t { before, after };

namespace detail {
struct StartupMail;
extern const StartupMail kSoeStartup;
}  // namespace detail

struct StartupCommand {
    enum class Kind : std::uint8_t {
        write_register,  // ESC registers or memory, addressed by station address
        check_register,  // read until the value is the expected one, for `timeout` at most
        // By mailbox, which works from PREOP on: commands for IP or IB are executed after the slave has reached the
        // state.
        write_object,       // SDO download
        write_parameter,    // SoE write of a value: `index` is the IDN, `subindex` the number of the drive
        execute_parameter,  // SoE procedure command, until it has been executed; `timeout` is for the whole of it
        send_aoe,           // AoE command that writes: `data` is the message, see startup_mail.hpp
        send_eoe,           // EoE request that sets parameters: `data` as for send_aoe
    };

    Kind kind = Kind::write_register;
    Moment moment = Moment::before;
    bool may_fail = false;         // an error is reported in errors() and does not stop the slave
    bool complete_access = false;  // of an object: read or write all subindices
    // Of a register: success does not depend on the working counter, so that a slave that does not have the register or
    // does not answer is no error.
    bool any_counter = false;
    Transition transitions = Transition::none;
    std::uint16_t index = 0;  // index of the object, IDN, or address of the register
    std::uint8_t subindex = 0;
    std::uint8_t length = 0;  // number of octets of `value`
    // Of a register: how often the access is repeated, 1 ms later, when the slave did not take part (working counter).
    std::uint16_t retries = 0;
    std::array<std::byte, 8> value{};  // in the order of the wire, little-endian
    std::array<std::byte, 8> mask{};   // of check_register: the bits of the value that are compared
    Borrowed<std::byte> data{};        // for longer values, instead of `value`. The caller's memory
    Duration timeout{0};               // zero: SlaveTimes::mailbox for mail; a register is read once
    // Of write_parameter, execute_parameter, send_aoe and send_eoe, set by the functions of the same names: a program
    // links only the protocols that it uses.
    const detail::StartupMail* mail = nullptr;

    // Copies of the command: executed after the state is reached; allowed to fail; with another timeout.
    [[nodiscard]] constexpr StartupCommand afterwards() const {
        StartupCommand c = *this;
        c.moment = Moment::after;
        return c;
    }
    [[nodiscard]] constexpr StartupCommand that_may_fail() const {
        StartupCommand c = *this;
        c.may_fail = true;
        return c;
    }
    [[nodiscard]] constexpr StartupCommand within(Duration time) const {
        StartupCommand c = *this;
        c.timeout = time;
        return c;
    }
    [[nodiscard]] constexpr std::span<const std::byte> octets() const {
        if (!data.empty()) return data;
        return std::span(value).first(length <= value.size() ? length : value.size());
    }
};

namespace detail {
template <std::integral T>
constexpr std::array<std::byte, 8> little_endian(T value) {
    std::array<std::byte, 8> bytes{};
    for (std::size_t n = 0; n < sizeof(T); ++n)
        bytes[n] = static_cast<std::byte>(static_cast<std::uint64_t>(value) >> (8 * n));
    return bytes;
}
}  // namespace detail

// The type of the value determines the number of octets.
template <std::integral T>
[[nodiscard]] constexpr StartupCommand write_register(Transition when, std::uint16_t address, T value) {
    return {.kind = StartupCommand::Kind::write_register,
            .transitions = when,
            .index = address,
            .length = sizeof(T),
            .value = detail::little_endian(value)};
}
[[nodiscard]] constexpr StartupCommand write_register(Transition when, std::uint16_t address,
                                                      Borrowed<std::byte> data) {
    return {.kind = StartupCommand::Kind::write_register, .transitions = when, .index = address, .data = data};
}
template <std::integral T>
[[nodiscard]] constexpr StartupCommand check_register(Transition when, std::uint16_t address, T value, T mask,
                                                      Duration timeout = Duration{0}) {
    return {.kind = StartupCommand::Kind::check_register,
            .transitions = when,
            .index = address,
            .length = sizeof(T),
            .value = detail::little_endian(value),
            .mask = detail::little_endian(mask),
            .timeout = timeout};
}
template <std::integral T>
[[nodiscard]] constexpr StartupCommand write_object(Transition when, std::uint16_t index, std::uint8_t subindex,
                                                    T value) {
    return {.kind = StartupCommand::Kind::write_object,
            .transitions = when,
            .index = index,
            .subindex = subindex,
            .length = sizeof(T),
            .value = detail::little_endian(value)};
}
[[nodiscard]] constexpr StartupCommand write_object(Transition when, std::uint16_t index, std::uint8_t subindex,
                                                    Borrowed<std::byte> data) {
    return {.kind = StartupCommand::Kind::write_object,
            .transitions = when,
            .index = index,
            .subindex = subindex,
            .data = data};
}
// By complete access: subindex 0 takes two octets, the other subindices follow. If the slave refuses complete access,
// the library writes the subindices one by one.
[[nodiscard]] constexpr StartupCommand write_whole_object(Transition when, std::uint16_t index,
                                                          Borrowed<std::byte> data) {
    return {.kind = StartupCommand::Kind::write_object,
            .complete_access = true,
            .transitions = when,
            .index = index,
            .data = data};
}
// Writes a value; a list includes its list head. A command that affects the telegrams of a drive belongs to IP, so that
// config_map() sees the change.
template <std::integral T>
[[nodiscard]] constexpr StartupCommand write_parameter(Transition when, std::uint8_t drive, Idn idn, T value) {
    return {.kind = StartupCommand::Kind::write_parameter,
            .transitions = when,
            .index = idn.value,
            .subindex = drive,
            .length = sizeof(T),
            .value = detail::little_endian(value),
            .mail = &detail::kSoeStartup};
}
[[nodiscard]] constexpr StartupCommand write_parameter(Transition when, std::uint8_t drive, Idn idn,
                                                       Borrowed<std::byte> data) {
    return {.kind = StartupCommand::Kind::write_parameter,
            .transitions = when,
            .index = idn.value,
            .subindex = drive,
            .data = data,
            .mail = &detail::kSoeStartup};
}
[[nodiscard]] constexpr StartupCommand execute_parameter(Transition when, std::uint8_t drive, Idn idn) {
    return {.kind = StartupCommand::Kind::execute_parameter,
            .transitions = when,
            .index = idn.value,
            .subindex = drive,
            .mail = &detail::kSoeStartup};
}

}  // namespace margay
