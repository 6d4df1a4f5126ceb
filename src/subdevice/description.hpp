// The description of a device as one constexpr value. The state machine uses it for its checks, the CoE server for the
// identity objects, and the SII writer for the content of the image. All texts must exist as long as the device
// (normally in flash).
#pragma once

#include <margay/time.hpp>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string_view>

namespace margay::subdevice {

// One mailbox area in the memory of the ESC. When `min_bytes` and `max_bytes` are 0, the master must configure exactly
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

// The two mailboxes of a state: SM0 (master to slave) and SM1 (slave to master). All values zero: the state has no
// mailbox.
struct MailboxPair {
    MailboxArea receive{};
    MailboxArea send{};
    [[nodiscard]] constexpr bool present() const { return receive.size_bytes != 0 && send.size_bytes != 0; }
};

// The process data of one SyncManager. With three buffers it occupies three times its octets.
struct ProcessDataArea {
    std::uint8_t sync_manager = 0;  // normally 2 (outputs) and 3 (inputs) on devices with a mailbox
    std::uint16_t start = 0;
    std::uint16_t max_bytes = 0;  // 0: the device has no such process data
    // Length in the SII when the application chooses the size at run time; 0: max_bytes.
    std::uint16_t sii_bytes = 0;
    bool three_buffers = true;  // false: mailbox mode, that is one buffer with handshake
    bool watchdog = false;      // outputs: the SII and the default control octet enable the watchdog trigger
    // Outputs: SAFEOP is refused when the master has not enabled the watchdog; the SII enables it as `watchdog` does.
    bool watchdog_required = false;
    [[nodiscard]] constexpr bool present() const { return max_bytes != 0; }
    // The object with the PDO assignment of the SyncManager (ETG.1000.6 "Sync Manager PDO Assignment").
    [[nodiscard]] constexpr std::uint16_t assignment() const {
        return static_cast<std::uint16_t>(0x1C10u + sync_manager);
    }
    // The object with the synchronization parameters of the SyncManager (ETG.1020 "Synchronization").
    [[nodiscard]] constexpr std::uint16_t sync_parameters() const {
        return static_cast<std::uint16_t>(0x1C30u + sync_manager);
    }
};

// A direction has at most this many areas in DeviceDescription::more_outputs or more_inputs.
inline constexpr std::size_t kMostMoreAreas = 3;

// Times of the hardware behind the stack, for one direction, which only the author knows. The master reads them from
// objects 0x1C32 and 0x1C33 (ETG.1020 "Synchronization").
struct SyncTimes {
    // From SYNC0 until the outputs are used or the inputs are latched (subindex 3). Zero: the device does it as soon as
    // it can, without a fixed time.
    Duration shift{};
    // From there until the outputs are at the terminals, and from the terminals to there for inputs: the shortest time
    // and the longest (subindices 7 and 9).
    Duration min_delay{};
    Duration max_delay{};
};

struct DcDescription {
    bool supported = false;
    bool required = false;  // SAFEOP is refused while the SYNC signals are off
    bool sync1 = false;     // the application also needs SYNC1; SAFEOP is refused when only SYNC0 is on
    // For the operation mode in the SII: SYNC1 occurs `sync1_shift` (at least 0) after each nth SYNC0; n is the factor.
    std::int16_t sync1_cycle_factor = 1;
    Duration sync1_shift{};
    // The same: SYNC0 occurs in each nth cycle of the master (n from 1 on), or -n times in a cycle (oversampling, n
    // from -2 on down).
    std::int16_t sync0_cycle_factor = 1;
    Duration min_cycle{};  // limits of the SYNC0 cycle time; zero: no limit
    Duration max_cycle{};
    // The device follows SYNC0 with a control loop of its own, as drives do. In SAFEOP→OP it refuses OP with AL status
    // code 0x0032 (PLL error) when SYNC0 occurs, but the frames do not come once a period and away from SYNC0. In OP it
    // reports missing frames with 0x0034 (DC sync timeout) instead of 0x001A (ETG.1020 "AL status codes").
    bool pll = false;
};

// Mailbox protocols in the order of the bit field in the SII.
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
    std::uint16_t device_id = 0;    // explicit device identification (AL control bit 5); 0: not supported
    bool device_id_switch = false;  // the device has a switch for its device id: see Application::device_id()
    std::string_view name{};        // full name, for display
    std::string_view order_code{};
    std::string_view group{};
    MailboxProtocols protocols{};
    MailboxPair mailbox{};
    MailboxPair boot_mailbox{};  // if present, the device supports the state BOOT
    ProcessDataArea outputs{};
    ProcessDataArea inputs{};
    // Devices with more than one SyncManager a direction: the areas besides `outputs` and `inputs`, at most
    // kMostMoreAreas. In process images, the octets of the areas follow each other in this order. The last area of the
    // outputs that has a length drives the device: its data start an update, its frames are counted. So a master that
    // writes all areas in ascending order has written all of them when the update starts. OP needs data in each area.
    std::span<const ProcessDataArea> more_outputs{};
    std::span<const ProcessDataArea> more_inputs{};
    DcDescription dc{};
    Duration outputs_wait = std::chrono::milliseconds(200);  // SAFEOP→OP: longest wait for the first outputs and SYNC0
    // Watchdog of the stack on the outputs, in addition to the ESC's watchdog; zero: none. It has no effect on an area
    // of one octet, because the arrival of one octet cannot be detected (see process_data.hpp). Then the ESC's watchdog
    // is needed.
    Duration output_timeout{};
    // Without DC, Application::cycle() is called at least this often; zero: only when process data arrive. (Before the
    // first outputs, and without outputs, it is called when the master has read the inputs, or each millisecond when
    // the SyncManager of the inputs raises no events.)
    Duration free_run_cycle{};
    // DC: the device leaves OP after this many consecutive frame periods without new outputs; 0: no limit. Object
    // 0x10F1 has priority. ProcessData::syncs_per_frame() returns how many SYNC0 signals are one frame period.
    unsigned sync_error_limit = 4;
    // Object 0x10F1:01, which the master reads: the reaction of the device, as its documentation defines it. The stack
    // goes to SAFEOP.
    std::uint32_t local_error_reaction = 1;
    SyncTimes output_times{};
    SyncTimes input_times{};
    // step() asks to be called again after this time at the latest, so that its access to the ESC restarts the PDI
    // watchdog (its time is in register 0x0410, its state in bit 1 of 0x0110) while nothing happens. Zero: the device
    // does not use the PDI watchdog.
    Duration pdi_watchdog{};
    std::int16_t ebus_current_ma = 0;
    std::uint8_t drive_axes = 0;  // number of CiA 402 axes, written to the SII
    bool complete_access = true;
};

// Calls `visit(area, n)` for the areas of a direction that the device has. `n` is 0 for `outputs` or `inputs`, and the
// place in `more_outputs` or `more_inputs` from 1 on.
template <class Visit>
constexpr void for_each_area(const DeviceDescription& device, bool outputs, Visit visit) {
    const auto& first = outputs ? device.outputs : device.inputs;
    if (first.present()) visit(first, std::size_t{0});
    std::size_t n = 0;
    for (const auto& area : outputs ? device.more_outputs : device.more_inputs)
        if (++n <= kMostMoreAreas && area.present()) visit(area, n);
}

// The shortest mailbox for an error reply (mailbox header and error), and for an SDO request (mailbox header, CoE
// header and SDO).
inline constexpr std::uint16_t kLeastMailbox = 10;
inline constexpr std::uint16_t kLeastCoeMailbox = 16;

// False: there is no SYNC0 cycle time that the device accepts.
[[nodiscard]] constexpr bool cycle_limits_agree(const DcDescription& dc) {
    return dc.max_cycle == Duration::zero() || dc.min_cycle <= dc.max_cycle;
}

// False: a mailbox has a size that the device itself refuses.
[[nodiscard]] constexpr bool mailbox_sizes_agree(const DeviceDescription& device) {
    bool agree = true;
    for (const MailboxPair& pair : {device.mailbox, device.boot_mailbox})
        for (const MailboxArea& area : {pair.receive, pair.send})
            agree = agree && (!pair.present() || area.allows(area.size_bytes));
    return agree;
}

// False: process data have the number of a mailbox, of each other, or one that no ESC has (0 to 15).
[[nodiscard]] constexpr bool sync_managers_agree(const DeviceDescription& device) {
    unsigned used = device.mailbox.present() || device.boot_mailbox.present() ? 3 : 0;
    bool agree = true;
    for (const bool outputs : {true, false})
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
            agree = agree && area.sync_manager < 16 && (used >> area.sync_manager & 1) == 0;
            used |= area.sync_manager < 16 ? 1U << area.sync_manager : 0;
        });
    return agree;
}

// The SyncManagers of a device: two for the mailboxes, the others for process data.
inline constexpr std::size_t kMostSyncManagers = 2 + 2 * (1 + kMostMoreAreas);

// The largest number of octets of all areas of a direction.
[[nodiscard]] constexpr std::size_t most_bytes(const DeviceDescription& device, bool outputs) {
    std::size_t bytes = 0;
    for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) { bytes += area.max_bytes; });
    return bytes;
}

}  // namespace margay::subdevice
