// PDOs by mailbox (ETG.1000.6 "RxPDO", "TxPDO", "Remote requests").
#pragma once

#include "mailbox/coe_sdo.hpp"

namespace margay {

// `data` outlives the task. Slaves do not answer: what is returned says that the slave's mailbox has taken it.
[[nodiscard]] Task<Result<>> send_rx_pdo(MailboxChannel& channel, std::uint16_t number, Bytes data,
                                         MailPatience patience);

// Returns how many octets the PDO has. Errors: capacity, and those of any exchange.
[[nodiscard]] Task<Result<std::size_t>> fetch_tx_pdo(MailboxChannel& channel, std::uint16_t number, MutableBytes into,
                                                     MailPatience patience);

}  // namespace margay
