// BOOT: the state in which a slave accepts firmware. It is reached from INIT and left to INIT, and has mailboxes of its
// own (SII words 0x0014 to 0x0017). A context has this part by Features::boot.
#pragma once

#include "network/network.hpp"

namespace margay {

struct BootFeature {
    // Does what is necessary before the slave can go to `to`: see crosses_boot(). Errors: unsupported (no bootstrap
    // mailboxes), the errors of the way to INIT and of the registers.
    Task<Result<>> (*prepare)(Network& network, Slave& slave, AlState to, Time until);
    // The slave has gone from `from` to `to`: opens or closes its mailbox. May be called again.
    void (*reached)(Network& network, Slave& slave, AlState from, AlState to);
    // prove() for a slave in BOOT that was away. Errors besides the errors of prove(): identity_unread (its firmware
    // uses the EEPROM, or mail is under way). A context without this part compares the slave when it has left BOOT.
    Task<Result<>> (*prove)(Network& network, Slave& slave);
};

// Whether prepare() must be called before the slave goes to `to`: it enters BOOT, or leaves it for another state than
// INIT, or goes to PREOP and its mailbox is closed since it was in BOOT. A context without this part refuses BOOT then:
// see boot_refusal().
[[nodiscard]] bool crosses_boot(Network& network, const Slave& slave, AlState to);

// The slave is in BOOT, and the application has not set another target for this slave since. The library leaves it in
// BOOT, because its firmware may be incomplete.
[[nodiscard]] inline bool stays_in_boot(const Network& network, const Slave& slave) {
    return slave.al.state == AlState::boot && !network.marks(slave).leave_boot;
}

// Why the slave cannot go to BOOT; code none if it can.
[[nodiscard]] Error boot_refusal(const Network& network, const Slave& slave);

}  // namespace margay
