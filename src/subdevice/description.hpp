// What a device is, as data: one constexpr value from which the state machine takes its checks, the CoE
// server its identity objects and the SII image its content. Everything here lives as long as the device
// (normally in flash).
#pragma once

#include <margay/time.hpp>

#include <cstdint>
#include <string_view>

namespace margay::subdevice {

// One mailbox area in the ESC's memory. With `min_bytes` and `max_bytes` left 0 the master must choose
// `size_bytes`.
struct MailboxArea {
    std::uint16_t start = 0;
    std::uint16_t size_bytes = 0;
    std::uint16_t min_bytes = 0;
    std::uint16_t max_bytes = 0;

    [[nodiscard]] constexpr bool allows(std::uint16_t bytes) const {
        return bytes >= (min_bytes != 0 ? min_bytes : size_bytes) && bytes <= (max_bytes != 0 ? max_bytes : size_bytes);
    }
};

// The two mailboxes of a state: SM0 (master to slave) and SM1 (slave to master). All zero: there is none.
struct MailboxPair {
    MailboxArea receive{};
    MailboxArea send{};
    [[nodiscard]] constexpr bool present() const { return receive.size_bytes != 0 && send.size_bytes != 0; }
};

// One direction of process data.
struct ProcessDataArea {
    std::uint8_t sync_manager = 0;  // 2 and 3 on devices with a mailbox
    std::uint16_t start = 0;
    std::uint16_t max_bytes = 0;     // 0: the device has no such direction
    std::uint16_t sii_bytes = 0;     // length in the SII of what the application sizes itself; 0: max_bytes
    bool three_buffers = true;       // false: mailbox mode, one buffer with handshake
    bool watchdog = false;           // outputs: SII and default control octet trigger the watchdog
    bool watchdog_required = false;  // outputs: SAFEOP is refused unless the master lets the watchdog run
    [[nodiscard]] constexpr bool present() const { return max_bytes != 0; }
};

struct DcDescription {
    bool supported = false;
    bool required = false;  // SAFEOP is refused while SYNC signals are off
    bool sync1 = false;     // the application needs SYNC1 too
    Duration min_cycle{};   // bounds of the SYNC0 cycle; zero: no bound
    Duration max_cycle{};
};

// Mailbox protocols as the SII's bit field has them.
struct MailboxProtocols {
    bool aoe = false;
    bool eoe = false;
    bool coe = false;
    bool foe = false;
    bool soe = false;
    bool voe = false;
};

struct DeviceDescription {
    std::uint32_t vendor_id = 0;
    std::uint32_t product_code = 0;
    std::uint32_t revision = 0;
    std::uint32_t serial = 0;
    std::uint16_t device_id = 0;  // explicit device identification (AL control bit 5); 0: not offered
    std::string_view name{};      // long name for people
    std::string_view order_code{};
    std::string_view group{};
    MailboxProtocols protocols{};
    MailboxPair mailbox{};
    MailboxPair boot_mailbox{};  // present: the device has the state BOOT
    ProcessDataArea outputs{};
    ProcessDataArea inputs{};
    DcDescription dc{};
    Duration outputs_wait =
        std::chrono::milliseconds(200);  // SAFEOP→OP: how long first outputs and SYNC0 are waited for
    Duration output_timeout{};           // own watchdog on outputs beside that of the ESC; zero: none
    Duration free_run_cycle{};           // the application hook is called at least this often without DC; zero: only
                                         // with process data
    unsigned sync_error_limit = 4;  // DC: so many SYNC0 in a row without new outputs end OP; 0: any number is borne
    std::int16_t ebus_current_ma = 0;
    std::uint8_t drive_axes = 0;  // of CiA 402, for the SII
    bool complete_access = true;
};

}  // namespace margay::subdevice
