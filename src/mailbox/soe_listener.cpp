// Notifications and emergencies of drives.
#include "wire/soe.hpp"

#include <margay/soe.hpp>

namespace margay {

namespace soe = wire::soe;

bool SoeListener::tell(const UnaskedMail& mail) {
    if (mail.data.size() < soe::kHeaderBytes) return false;
    const auto header = soe::load_header(mail.data);
    const bool emergency = header.opcode == soe::Opcode::slave_info;
    if (!emergency && header.opcode != soe::Opcode::notification) return false;
    notified(mail.slave, {.emergency = emergency,
                          .drive = header.drive,
                          .elements = header.elements,
                          .idn = header.idn(),
                          .data = mail.data.subspan(soe::kHeaderBytes)});
    return true;
}

}  // namespace margay
