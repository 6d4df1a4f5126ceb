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

// For requests of several messages.
template <class R>
[[nodiscard]] MailPatience patience_of_each(R& request) {
    MailPatience patience = patience_of(request);
    if (request.answer_timeout > Duration{0}) patience.each = request.answer_timeout;
    return patience;
}

[[nodiscard]] inline MailboxChannel& channel_of(Network& network, const MailRequest& request) {
    return network.mailboxes.channel(request.slave);
}

// Exists while a request of the application writes an object or a parameter. If the object or parameter determines the
// process data, the write makes a mapping necessary, also if the request fails or is cut: a part of the value may have
// been written.
class PdoWrite {
  public:
    PdoWrite(Network& network, std::uint16_t slave, bool decides) : marks_(network.marks(slave)), decides_(decides) {}
    PdoWrite(const PdoWrite&) = delete;
    PdoWrite& operator=(const PdoWrite&) = delete;
    ~PdoWrite() {
        // Values that a hook writes belong to the start-up of the slave, as with HookedSlave.
        if (decides_ && !marks_.in_hook) marks_.pdos_written = true;
    }
    // The slave has refused the whole request.
    void refused() { decides_ = false; }

  private:
    SlaveMarks& marks_;
    bool decides_;
};

// Whether an object is a PDO mapping or a PDO assignment.
constexpr bool decides_on_pdos(std::uint16_t index) {
    return (index >= 0x1600 && index < 0x1C00) || (index >= 0x1C10 && index < 0x1C30);
}
// Whether a parameter of a drive decides about its telegrams: S-0-0015, S-0-0016 and S-0-0024.
constexpr bool decides_on_telegram(Idn idn) { return idn.value == 15 || idn.value == 16 || idn.value == 24; }

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
