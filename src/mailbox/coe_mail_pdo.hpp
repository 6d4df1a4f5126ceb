// PDOs by mailbox (ETG.1000.6 "RxPDO", "TxPDO", "Remote requests").
#pragma once

#include "mailbox/coe_sdo.hpp"

namespace margay {

// Sends an RxPDO. `data` outlives the task. Slaves send no reply: success means that the slave's mailbox has accepted
// the message.
[[nodiscard]] Task<Result<>> send_rx_pdo(MailboxChannel& channel, std::uint16_t number, Bytes data,
                                         const MailPatience& patience);

// Requests a TxPDO and returns its number of octets. Errors: capacity, and the errors of any exchange.
[[nodiscard]] Task<Result<std::size_t>> fetch_tx_pdo(MailboxChannel& channel, std::uint16_t number, MutableBytes into,
                                                     const MailPatience& patience);

}  // namespace margay
