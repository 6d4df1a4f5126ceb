#include "mailbox/protocols.hpp"

#include "mailbox/coe_mail.hpp"
#include "mailbox/soe.hpp"

namespace margay {
namespace {

constexpr MailProtocol kProtocols[] = {
    {wire::MailboxType::coe, coe_unasked},
    {wire::MailboxType::soe, soe_unasked},
};

}  // namespace

const MailProtocol* find_protocol(wire::MailboxType type) {
    for (const MailProtocol& protocol : kProtocols)
        if (protocol.type == type) return &protocol;
    return nullptr;
}

}  // namespace margay
