// The protocols of a mailbox message (ETG.1000.4 table "Mailbox header", field "type").
#pragma once

#include <cstdint>

namespace margay {

enum class MailboxType : std::uint8_t {
    error = 0,
    aoe = 1,
    eoe = 2,
    coe = 3,
    foe = 4,
    soe = 5,
    voe = 15,
};

}  // namespace margay
