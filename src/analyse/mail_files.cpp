// Conversations of FoE and SoE.
#include "analyse/mail_watch.hpp"
#include "wire/foe.hpp"
#include "wire/soe.hpp"

namespace margay::analyse {

namespace foe = wire::foe;
namespace soe = wire::soe;

void MailWatch::take_foe(const Mail& mail) {
    if (mail.data.size() < foe::kHeaderBytes) return;
    const auto rest = mail.data.subspan(foe::kHeaderBytes);
    const auto opcode = foe::Layout::opcode::load(mail.data);
    if (mail.sent && (opcode == foe::Opcode::read || opcode == foe::Opcode::write)) {
        auto& conversation = begin(mail, opcode == foe::Opcode::read ? Action::foe_read : Action::foe_write);
        conversation.facts.name = printable(rest);
        return;
    }
    auto* conversation = open(mail);
    if (conversation == nullptr) return;
    const bool reads = conversation->facts.action == Action::foe_read;
    switch (opcode) {
        case foe::Opcode::data:
            if (reads == mail.sent) return;
            // After "busy" and after a loss, the same packet is sent again.
            if (const auto packet = foe::Layout::packet_number::load(mail.data); packet != conversation->packet) {
                conversation->packet = packet;
                append(*conversation, rest);
            }
            // A packet that does not fill the mailbox is the last one.
            conversation->last_sent = mail.data.size() < mail.room;
            if (reads && conversation->last_sent) end(mail, *conversation, Outcome::done);
            return;
        case foe::Opcode::acknowledge:
            if (!reads && !mail.sent && conversation->last_sent) end(mail, *conversation, Outcome::done);
            return;
        case foe::Opcode::error: {
            const auto code = foe::Layout::error_code::load(mail.data);
            auto reason = (mail.sent ? "by the master: " : "") + std::string(foe::to_text(code));
            if (const auto text = printable(rest); !text.empty()) reason += " (\"" + text + "\")";
            return end(mail, *conversation, Outcome::refused, static_cast<std::uint32_t>(code), reason);
        }
        default: return;
    }
}

void MailWatch::take_soe(const Mail& mail) {
    if (mail.data.size() < soe::kHeaderBytes) return;
    const auto header = soe::load_header(mail.data);
    const auto rest = mail.data.subspan(soe::kHeaderBytes);
    auto* conversation = open(mail);
    if (mail.sent) {
        const bool reads = header.opcode == soe::Opcode::read_request;
        if (!reads && header.opcode != soe::Opcode::write_request) return;
        // The fragments of a write request are one conversation.
        const bool more = !reads && conversation != nullptr && conversation->facts.action == Action::soe_write &&
                          !conversation->last_sent;
        if (!more) conversation = &begin(mail, reads ? Action::soe_read : Action::soe_write);
        conversation->facts.subindex = header.drive;
        conversation->facts.elements = header.elements;
        if (!reads) {
            append(*conversation, rest);
            conversation->last_sent = !header.incomplete;
        }
        // An incomplete message contains the number of the following fragments in place of the IDN.
        conversation->facts.index_known = !header.incomplete;
        if (!header.incomplete) conversation->facts.index = header.number;
        return;
    }
    // The last fragment of a write contains the IDN.
    const bool idn_known =
        conversation != nullptr && (conversation->facts.action == Action::soe_read || conversation->last_sent);
    if (conversation == nullptr ||
        (header.opcode != soe::Opcode::read_response && header.opcode != soe::Opcode::write_response) ||
        conversation->facts.subindex != header.drive ||
        (idn_known && !header.incomplete && conversation->facts.index != header.number))
        return;
    if (header.error) {
        const auto code = rest.size() >= soe::kErrorBytes ? load_le<soe::ErrorCode>(rest.last(soe::kErrorBytes))
                                                          : soe::ErrorCode::general;
        return end(mail, *conversation, Outcome::refused, static_cast<std::uint32_t>(code),
                   std::string(soe::to_text(code)));
    }
    if (conversation->facts.action == Action::soe_read) append(*conversation, rest);
    if (!header.incomplete) end(mail, *conversation, Outcome::done);
}

}  // namespace margay::analyse
