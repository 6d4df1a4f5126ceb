// Common parts of the requests that use a mailbox, for all mailbox protocols.
#pragma once

#include "api/master.hpp"
#include "api/operation.hpp"
#include "mailbox/exchange.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {

// Describes an operation whose sequence limits the time of its messages itself, by patience_of().
template <class R, Error (*Check)(Network&, const R&), Task<Result<>> (*Run)(Network&, R&)>
constexpr OperationDescription describe_mail(Operation operation, Step step) {
    return describe_operation<R, Check, Run>(operation, step, Needs::nothing, Ends::by_itself, Timing::by_sequence);
}

[[nodiscard]] inline MailPatience patience_of(Request& request) {
    MailPatience patience{.give_up = RequestAccess::deadline(request),
                          .priority = std::min<std::uint8_t>(request.priority, 3)};
    if (request.timeout > Duration{0}) patience.each = request.timeout;
    return patience;
}

[[nodiscard]] inline MailboxChannel& channel_of(Network& network, const MailRequest& request) {
    return network.mailboxes.channel(request.slave);
}

// Call it before an SDO of the application: one that may write a PDO mapping or a PDO assignment makes a mapping
// necessary. Also where the SDO fails: a part of it may have been written.
inline void note_pdo_write(Network& network, std::uint16_t slave, std::uint16_t index) {
    const bool decides = (index >= 0x1600 && index < 0x1C00) || (index >= 0x1C10 && index < 0x1C30);
    if (decides) network.marks(slave).pdos_written = true;
}

// Checks whether the slave in `where` supports this mailbox protocol; if not, returns `where` with the error code.
[[nodiscard]] Error check_mailbox(Network& network, std::uint16_t protocol, Error where);

// The same without a protocol: whether the mailbox of the slave works.
[[nodiscard]] Error check_mailbox(Network& network, Error where);
// The error of a message whose `bytes` octets behind the mailbox header do not fit the mailbox of the slave; code none:
// they fit. Call it after check_mailbox().
[[nodiscard]] Error check_message(Network& network, std::size_t bytes, const Error& where);

// The same for an access to the object dictionary.
[[nodiscard]] Error check_coe(Network& network, std::uint16_t slave, Step step, std::uint16_t index,
                              std::uint8_t subindex);
// The same for an access to a parameter of a drive. A slave has up to wire::soe::kDrives drives.
[[nodiscard]] Error check_soe(Network& network, std::uint16_t slave, Step step, std::uint8_t drive, Idn idn);

}  // namespace margay
