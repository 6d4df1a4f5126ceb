// The checks of the state machine before a transition to a higher state. They compare the registers that the master
// wrote with the description of the device. Each check returns the AL status code of the first error, or
// AlStatusCode::none.
#pragma once

#include "subdevice/description.hpp"
#include "subdevice/esc_access.hpp"
#include "subdevice/esm.hpp"
#include "wire/sync_manager.hpp"

namespace margay::subdevice {

// Reads all octets that the master writes, and so clears the AL event of a change: the caller must compare the
// SyncManager with what the device needs.
[[nodiscard]] wire::SyncManager read_sync_manager(EscAccess& esc, unsigned n);
// The control octet alone. The AL event of a change stays for the state machine.
[[nodiscard]] std::uint8_t read_sync_manager_control(EscAccess& esc, unsigned n);

// Reads the activate octets of all SyncManagers, which clears the AL event of their changes.
void read_activations(EscAccess& esc);

// Compares SM0 and SM1 with the mailboxes of PREOP (or of BOOT): start, size, mode, direction, activation. Returns
// `otherwise` on a difference, and for mailboxes that share memory or are outside of the RAM of the ESC.
[[nodiscard]] AlStatusCode check_mailboxes(EscAccess& esc, const MailboxPair& expected, AlStatusCode otherwise);

// Compares the process data sync managers with the description and with the sizes of the mapping. Each must have memory
// of its own in the RAM of the ESC: three buffers take three times the length.
[[nodiscard]] AlStatusCode check_process_data(EscAccess& esc, const DeviceDescription& device,
                                              const ProcessDataSizes& sizes);

// Check the process data watchdog and the DC SYNC settings.
[[nodiscard]] AlStatusCode check_watchdog(EscAccess& esc, const DeviceDescription& device,
                                          const ProcessDataSizes& sizes);
[[nodiscard]] AlStatusCode check_dc(EscAccess& esc, const DcDescription& dc);

}  // namespace margay::subdevice
