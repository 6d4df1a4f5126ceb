// What the state machine checks before it goes up: registers that the master wrote against the device's
// description. Each check returns the AL status code of the first thing that is wrong, AlStatusCode::none
// when all is well.
#pragma once

#include "subdevice/description.hpp"
#include "subdevice/esc_access.hpp"
#include "subdevice/esm.hpp"
#include "wire/sync_manager.hpp"

namespace margay::subdevice {

[[nodiscard]] wire::SyncManager read_sync_manager(EscAccess& esc, unsigned n);

// SM0 and SM1 against the mailboxes of PREOP (or of BOOT): start, size, mode, direction, enabled. `otherwise`
// is the code.
[[nodiscard]] AlStatusCode check_mailboxes(EscAccess& esc, const MailboxPair& expected, AlStatusCode otherwise);

// The sync managers of process data against the description and the sizes of the mapping.
[[nodiscard]] AlStatusCode check_process_data(EscAccess& esc, const DeviceDescription& device,
                                              const ProcessDataSizes& sizes);

// Process data watchdog and DC SYNC settings.
[[nodiscard]] AlStatusCode check_watchdog(EscAccess& esc, const DeviceDescription& device,
                                          const ProcessDataSizes& sizes);
[[nodiscard]] AlStatusCode check_dc(EscAccess& esc, const DcDescription& dc);

}  // namespace margay::subdevice
