// Automation device specification over EtherCAT (AoE, ETG.1020 "AoE"): commands to devices that are addressed by a
// NetID and a port: a slave itself, or a device behind a slave that is a gateway to another fieldbus. The command goes
// into the mailbox of `slave`, and the slave passes it on to the device of `target`.
//
//     margay::AoeRead request;                         // lives in the caller's memory
//     request.slave = 5;                               // the gateway
//     request.target = {{{192, 168, 1, 5, 2, 1}}, 1001};
//     request.index_group = 0xF302;
//     request.index_offset = 0x10180001;
//     request.data = buffer;
//     margay::submit(ctx, request);                    // from any thread, beside the cycle
//
// Any number of commands to a slave may be busy at the same time: each has a number (the invoke ID) by which its answer
// is found, in whatever order the answers come. A command and its answer must fit into the mailbox of the slave;
// longer messages (AoE fragments) are not supported.
//
// An error has two codes: error_code comes from the AoE header (no device executed the command: no route, wrong port
// …), result_code is the answer of the device. describe() writes both in words.
#pragma once

#include <margay/aoe_address.hpp>
#include <margay/borrowed.hpp>
#include <margay/mail_listener.hpp>
#include <margay/request.hpp>

#include <array>
#include <string_view>

namespace margay {

// ------------------------------------------------------------------ requests

// The base of all AoE commands. Errors: aoe_error (detail: error_code), aoe_result (detail: result_code),
// invalid_argument (the command or the announced answer is longer than the mailbox), capacity (the answer is longer
// than `data`), unsupported (no AoE), timeout, mailbox_error, protocol … When the answer of a slave is lost on the wire
// and the slave cannot repeat it, the library sends AoeRead, AoeReadState and AoeReadDeviceInfo again. Every other
// command ends with reply_lost: the slave may have executed the command, and must not execute it twice.
struct AoeRequest : MailRequest {
    AoeAddress target;
    // The address of the master; the device sends its answer and its notifications there. The library accepts them
    // whatever this address is.
    AoeAddress source;
    std::uint32_t error_code = 0;   // result: the error code of the AoE header
    std::uint32_t result_code = 0;  // result: the result of the command

  protected:
    using MailRequest::MailRequest;
};

struct AoeRead : AoeRequest {
    AoeRead();
    std::uint32_t index_group = 0;
    std::uint32_t index_offset = 0;
    std::span<std::byte> data;  // its size is the number of octets that are requested
    std::size_t bytes = 0;      // result: how many the device has returned
};

struct AoeWrite : AoeRequest {
    AoeWrite();
    std::uint32_t index_group = 0;
    std::uint32_t index_offset = 0;
    Borrowed<std::byte> data;
};

// Writes `written` and reads into `data`, in one command.
struct AoeReadWrite : AoeRequest {
    AoeReadWrite();
    std::uint32_t index_group = 0;
    std::uint32_t index_offset = 0;
    Borrowed<std::byte> written;
    std::span<std::byte> data;
    std::size_t bytes = 0;  // result
};

// Changes the state of a device.
struct AoeWriteControl : AoeRequest {
    AoeWriteControl();
    AdsState ads_state = AdsState::invalid;
    std::uint16_t device_state = 0;
    Borrowed<std::byte> data;
};

struct AoeReadState : AoeRequest {
    AoeReadState();
    AdsState ads_state = AdsState::invalid;  // results
    std::uint16_t device_state = 0;
};

struct AoeDeviceInfo {
    std::uint8_t major = 0;
    std::uint8_t minor = 0;
    std::uint16_t build = 0;
    std::array<char, 16> name_text{};
    [[nodiscard]] std::string_view name() const {
        const std::string_view text(name_text.data(), name_text.size());
        return text.substr(0, text.find('\0'));
    }
};

struct AoeReadDeviceInfo : AoeRequest {
    AoeReadDeviceInfo();
    AoeDeviceInfo info;  // result
};

// Asks a device to send the value at an index on its own; the notifications go to an AoeListener.
struct AoeAddNotification : AoeRequest {
    AoeAddNotification();
    std::uint32_t index_group = 0;
    std::uint32_t index_offset = 0;
    std::uint32_t length = 0;  // size of the value in octets
    AoeTransmission transmission = AoeTransmission::on_change;
    Duration longest_delay{0};  // how long the device may wait to send several values at once
    Duration cycle_time{0};     // how often the device checks the value
    std::uint32_t handle = 0;   // result: identifies the notification
};

struct AoeDeleteNotification : AoeRequest {
    AoeDeleteNotification();
    std::uint32_t handle = 0;
};

// Gives a slave its own NetID: an AoE write of the six octets, with the NetID as target. A start-up command does the
// same at each start-up of the slave (aoe_net_id_command(), startup_mail.hpp), and so does a hook with
// HookedSlave::aoe_set_net_id().
struct AoeSetNetId : AoeRequest {
    AoeSetNetId();
    AoeNetId net_id;
    // Index group and index offset of the NetID.
    std::uint32_t index_group = 1;
    std::uint32_t index_offset = 3;
};

// ------------------------------------------------------------------ notifications

struct AoeNotification {
    AoeAddress source;         // the device
    std::uint32_t handle = 0;  // the handle of AoeAddNotification
    // Time of the device in units of 100 ns since the year 1601, if the device has a clock.
    std::uint64_t time_stamp = 0;
    Borrowed<std::byte> data;  // valid until notified() returns
};

// Receives the notifications of devices; see mail_listener.hpp.
class AoeListener : public MailListener {
  public:
    AoeListener() : MailListener(MailboxType::aoe) {}

  protected:
    ~AoeListener() = default;
    // Called for each value of a notification. The rules of MailListener::take() apply, but the listener must not
    // be destroyed here: more values may follow in the same message, even after unlisten().
    virtual void notified(std::uint16_t slave, const AoeNotification& notification) = 0;

  private:
    // Inline, because a program with RTTI derives from this class, and the library has no RTTI.
    bool take(const UnaskedMail& mail) final { return tell(mail); }
    bool tell(const UnaskedMail& mail);
};

// ------------------------------------------------------------------ functions that wait
//
// Each function submits the request of the same name and waits for it. `timeout` zero: 3 s for the answer.

Result<std::size_t> AOEread(Context& ctx, std::uint16_t slave, const AoeAddress& target, std::uint32_t index_group,
                            std::uint32_t index_offset, std::span<std::byte> into, Duration timeout = Duration{0});
Result<> AOEwrite(Context& ctx, std::uint16_t slave, const AoeAddress& target, std::uint32_t index_group,
                  std::uint32_t index_offset, std::span<const std::byte> data, Duration timeout = Duration{0});
Result<std::size_t> AOEread_write(Context& ctx, std::uint16_t slave, const AoeAddress& target,
                                  std::uint32_t index_group, std::uint32_t index_offset,
                                  std::span<const std::byte> written, std::span<std::byte> into,
                                  Duration timeout = Duration{0});
Result<> AOEwrite_control(Context& ctx, std::uint16_t slave, const AoeAddress& target, AdsState ads_state,
                          std::uint16_t device_state, std::span<const std::byte> data = {},
                          Duration timeout = Duration{0});
Result<AdsState> AOEread_state(Context& ctx, std::uint16_t slave, const AoeAddress& target,
                               Duration timeout = Duration{0});
Result<AoeDeviceInfo> AOEread_device_info(Context& ctx, std::uint16_t slave, const AoeAddress& target,
                                          Duration timeout = Duration{0});
Result<> AOEset_net_id(Context& ctx, std::uint16_t slave, const AoeNetId& net_id, Duration timeout = Duration{0});

// The text of an error code or result code. A static string, callable from anywhere.
[[nodiscard]] std::string_view aoe_error_text(std::uint32_t code);

}  // namespace margay
