#include "gateway/transaction.hpp"

#include "wire/aoe.hpp"
#include "wire/coe.hpp"
#include "wire/eoe.hpp"
#include "wire/foe.hpp"
#include "wire/soe.hpp"
#include "wire/voe.hpp"

namespace margay::gateway {
namespace {

namespace coe = wire::coe;
namespace foe = wire::foe;
namespace soe = wire::soe;
namespace aoe = wire::aoe;
namespace eoe = wire::eoe;
using wire::MailboxErrorCode;
using wire::MailboxType;
using Kind = Transaction::Kind;

Transaction refused(MailboxErrorCode code) { return {.kind = Kind::refused, .refusal = code}; }

std::uint8_t specifier_of(Bytes sdo) { return coe::sdo::specifier(coe::SdoLayout::command::load(sdo)); }

// ------------------------------------------------------------------ CoE

Transaction of_sdo(Bytes data) {
    if (data.size() < coe::kSegmentHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    Transaction t{.service = static_cast<std::uint16_t>(coe::Service::sdo_request), .specifier = specifier_of(data)};
    t.kind = t.specifier == coe::kAbortSpecifier ? Kind::unanswered : Kind::answered;
    const bool initiate = t.specifier == coe::request::kDownload || t.specifier == coe::request::kUpload;
    if (initiate && data.size() < coe::SdoLayout::subindex::end) return refused(MailboxErrorCode::size_too_short);
    if (initiate) t.object = coe::SdoLayout::index::load(data);
    t.download = t.specifier == coe::request::kDownload || t.specifier == coe::request::kDownloadSegment;
    t.changes = t.download || t.specifier > coe::kAbortSpecifier;
    return t;
}

Transaction of_information(Bytes data) {
    if (data.size() < coe::kInfoHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    const auto opcode = static_cast<std::uint8_t>(coe::InfoLayout::opcode::load(data) & ~coe::kInfoIncomplete);
    switch (static_cast<coe::InfoOpcode>(opcode)) {
        case coe::InfoOpcode::list_request:
        case coe::InfoOpcode::object_request:
        case coe::InfoOpcode::entry_request:
            return {.kind = Kind::answered,
                    .service = static_cast<std::uint16_t>(coe::Service::sdo_information),
                    .specifier = opcode};
        default: return refused(MailboxErrorCode::service_not_supported);
    }
}

Transaction of_coe(Bytes data) {
    if (data.size() < coe::kHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    const auto header = coe::load_header(data);
    const auto service = static_cast<std::uint16_t>(header.service);
    switch (header.service) {
        case coe::Service::sdo_request: return of_sdo(data);
        case coe::Service::sdo_information: return of_information(data);
        case coe::Service::rx_pdo: return {.kind = Kind::unanswered, .changes = true, .service = service};
        case coe::Service::tx_pdo_remote_request:
        case coe::Service::rx_pdo_remote_request:
            return {.kind = Kind::answered, .service = service, .object = header.number};
        case coe::Service::emergency:
        case coe::Service::sdo_response:
        case coe::Service::tx_pdo: return refused(MailboxErrorCode::service_not_supported);
    }
    return refused(MailboxErrorCode::invalid_header);
}

bool is_abort(Bytes mail) {
    return mail.size() >= coe::SdoLayout::command::end && specifier_of(mail) == coe::kAbortSpecifier;
}

bool answers_sdo(const Transaction& t, coe::Service service, Bytes mail) {
    if (mail.size() < coe::SdoLayout::command::end) return false;
    if (service != coe::Service::sdo_response && service != coe::Service::sdo_request) return false;
    if (is_abort(mail)) return true;
    if (service != coe::Service::sdo_response) return false;
    const auto with_object = [&](std::uint8_t wanted) {
        return specifier_of(mail) == wanted && mail.size() >= coe::SdoLayout::subindex::end &&
               coe::SdoLayout::index::load(mail) == t.object;
    };
    switch (t.specifier) {
        case coe::request::kDownload: return with_object(coe::response::kDownload);
        case coe::request::kUpload: return with_object(coe::response::kUpload);
        case coe::request::kDownloadSegment: return specifier_of(mail) == coe::response::kDownloadSegment;
        case coe::request::kUploadSegment: return specifier_of(mail) == coe::response::kUploadSegment;
        default: return true;
    }
}

coe::InfoOpcode information_opcode(Bytes mail) {
    return static_cast<coe::InfoOpcode>(coe::InfoLayout::opcode::load(mail) & ~coe::kInfoIncomplete);
}

bool answers_coe(const Transaction& t, Bytes mail) {
    if (mail.size() < coe::kHeaderBytes) return false;
    const auto header = coe::load_header(mail);
    switch (static_cast<coe::Service>(t.service)) {
        case coe::Service::sdo_request: return answers_sdo(t, header.service, mail);
        case coe::Service::sdo_information:
            return header.service == coe::Service::sdo_information && mail.size() >= coe::kInfoHeaderBytes &&
                   (information_opcode(mail) == static_cast<coe::InfoOpcode>(t.specifier + 1) ||
                    information_opcode(mail) == coe::InfoOpcode::error);
        case coe::Service::tx_pdo_remote_request:
            return header.service == coe::Service::tx_pdo && header.number == t.object;
        case coe::Service::rx_pdo_remote_request:
            return header.service == coe::Service::rx_pdo && header.number == t.object;
        default: return false;
    }
}

// Whether segments follow the first message of a transfer, in either direction: the message announces more octets than
// it contains.
bool is_first_part(Bytes sdo) {
    if (sdo.size() < coe::SdoLayout::complete_size::end) return false;
    if ((coe::SdoLayout::command::load(sdo) & coe::sdo::kExpedited) != 0) return false;
    return coe::SdoLayout::complete_size::load(sdo) > sdo.size() - coe::SdoLayout::normal_data;
}

bool is_last_segment(Bytes sdo) { return (coe::SdoLayout::command::load(sdo) & coe::sdo::kLastSegment) != 0; }

bool sdo_goes_on(const Transaction& t, Bytes data, Bytes answer) {
    if (static_cast<coe::Service>(t.service) != coe::Service::sdo_request || is_abort(answer)) return false;
    switch (t.specifier) {
        case coe::request::kDownload: return is_first_part(data);
        case coe::request::kUpload: return is_first_part(answer);
        case coe::request::kDownloadSegment: return !is_last_segment(data);
        case coe::request::kUploadSegment: return !is_last_segment(answer);
        default: return false;
    }
}

// ------------------------------------------------------------------ FoE

Transaction of_foe(Bytes data, bool over) {
    if (data.size() < foe::kHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    const auto opcode = foe::Layout::opcode::load(data);
    Transaction t{.kind = Kind::answered, .service = static_cast<std::uint16_t>(opcode)};
    switch (opcode) {
        case foe::Opcode::write:
        case foe::Opcode::data: t.changes = true; return t;
        case foe::Opcode::acknowledge:
            if (over) t.kind = Kind::unanswered;
            return t;
        case foe::Opcode::read:
        case foe::Opcode::busy: return t;
        case foe::Opcode::error: t.kind = Kind::unanswered; return t;
    }
    return refused(MailboxErrorCode::service_not_supported);
}

bool answers_foe(const Transaction& t, Bytes mail) {
    if (mail.size() < foe::Layout::opcode::end) return false;
    const auto opcode = foe::Layout::opcode::load(mail);
    if (opcode == foe::Opcode::error || opcode == foe::Opcode::busy) return true;
    switch (static_cast<foe::Opcode>(t.service)) {
        case foe::Opcode::read:
        case foe::Opcode::acknowledge: return opcode == foe::Opcode::data;
        case foe::Opcode::write:
        case foe::Opcode::data: return opcode == foe::Opcode::acknowledge;
        default: return opcode == foe::Opcode::data || opcode == foe::Opcode::acknowledge;
    }
}

bool foe_goes_on(const Transaction& t, Bytes data, Bytes answer, const Rooms& rooms) {
    const auto opcode = foe::Layout::opcode::load(answer);
    if (opcode == foe::Opcode::error) return false;
    // The last packet of a file is shorter than the mailbox.
    const bool last_sent = static_cast<foe::Opcode>(t.service) == foe::Opcode::data && data.size() < rooms.to_slave;
    return !(last_sent && opcode == foe::Opcode::acknowledge);
}

// ------------------------------------------------------------------ SoE, EoE, AoE

Transaction of_soe(Bytes data) {
    if (data.size() < soe::kHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    const auto header = soe::load_header(data);
    Transaction t{.kind = Kind::answered,
                  .service = static_cast<std::uint16_t>(header.opcode),
                  .specifier = header.drive,
                  .object = header.number};
    if (header.opcode == soe::Opcode::read_request) return t;
    if (header.opcode != soe::Opcode::write_request) return refused(MailboxErrorCode::service_not_supported);
    t.changes = true;
    t.goes_on = header.incomplete;
    if (header.incomplete) t.kind = Kind::unanswered;
    return t;
}

bool answers_soe(const Transaction& t, Bytes mail) {
    if (mail.size() < soe::kHeaderBytes) return false;
    const auto header = soe::load_header(mail);
    const bool right = static_cast<soe::Opcode>(t.service) == soe::Opcode::read_request
                           ? header.opcode == soe::Opcode::read_response
                           : header.opcode == soe::Opcode::write_response;
    return right && header.drive == t.specifier && (header.incomplete || header.number == t.object);
}

Transaction of_eoe(Bytes data) {
    if (data.size() < eoe::kHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    const auto type = eoe::load_header(data).type;
    Transaction t{.kind = Kind::answered, .service = static_cast<std::uint16_t>(type)};
    switch (type) {
        case eoe::Type::set_ip_request:
        case eoe::Type::set_filter_request: t.changes = true; return t;
        case eoe::Type::get_ip_request:
        case eoe::Type::get_filter_request: return t;
        default: return refused(MailboxErrorCode::service_not_supported);
    }
}

bool answers_eoe(const Transaction& t, Bytes mail) {
    return mail.size() >= eoe::kHeaderBytes && static_cast<unsigned>(eoe::load_header(mail).type) == t.service + 1U;
}

Transaction of_aoe(Bytes data) {
    if (data.size() < aoe::kHeaderBytes) return refused(MailboxErrorCode::size_too_short);
    const auto header = aoe::load_header(data);
    Transaction t{
        .kind = Kind::answered, .service = static_cast<std::uint16_t>(header.command), .invoke_id = header.invoke_id};
    t.changes = header.command != aoe::Command::read && header.command != aoe::Command::read_state &&
                header.command != aoe::Command::read_device_info;
    if ((header.flags & (aoe::state_flag::kResponse | aoe::state_flag::kNoReturn)) != 0) t.kind = Kind::unanswered;
    return t;
}

bool answers_aoe(const Transaction& t, Bytes mail) {
    if (mail.size() < aoe::kHeaderBytes) return false;
    const auto header = aoe::load_header(mail);
    return (header.flags & aoe::state_flag::kResponse) != 0 && header.invoke_id == t.invoke_id &&
           static_cast<std::uint16_t>(header.command) == t.service;
}

Transaction untyped(MailboxType type, Bytes data, bool over) {
    switch (type) {
        case MailboxType::aoe: return of_aoe(data);
        case MailboxType::eoe: return of_eoe(data);
        case MailboxType::coe: return of_coe(data);
        case MailboxType::foe: return of_foe(data, over);
        case MailboxType::soe: return of_soe(data);
        case MailboxType::voe:
            if (data.size() < wire::voe::kHeaderBytes) return refused(MailboxErrorCode::size_too_short);
            return {.kind = Kind::listening, .changes = true};
        case MailboxType::error: break;
    }
    return refused(MailboxErrorCode::unsupported_protocol);
}

}  // namespace

Transaction transaction_of(MailboxType type, Bytes data, bool over) {
    Transaction t = untyped(type, data, over);
    t.type = type;
    return t;
}

bool answers(const Transaction& t, Bytes mail) {
    switch (t.type) {
        case MailboxType::aoe: return answers_aoe(t, mail);
        case MailboxType::eoe: return answers_eoe(t, mail);
        case MailboxType::coe: return answers_coe(t, mail);
        case MailboxType::foe: return answers_foe(t, mail);
        case MailboxType::soe: return answers_soe(t, mail);
        case MailboxType::voe: return true;
        case MailboxType::error: break;
    }
    return false;
}

bool more_follows(const Transaction& t, Bytes mail) {
    if (t.kind == Kind::listening) return true;
    if (t.type == MailboxType::coe)
        return static_cast<coe::Service>(t.service) == coe::Service::sdo_information &&
               mail.size() >= coe::kInfoHeaderBytes && information_opcode(mail) != coe::InfoOpcode::error &&
               (coe::InfoLayout::opcode::load(mail) & coe::kInfoIncomplete) != 0;
    return t.type == MailboxType::soe && mail.size() >= soe::kHeaderBytes && soe::load_header(mail).incomplete;
}

bool goes_on(const Transaction& t, Bytes data, Bytes answer, const Rooms& rooms) {
    if (answer.empty()) return t.goes_on;
    if (t.type == MailboxType::coe) return sdo_goes_on(t, data, answer);
    return t.type == MailboxType::foe && answer.size() >= foe::Layout::opcode::end &&
           foe_goes_on(t, data, answer, rooms);
}

bool ends_file(const Transaction& t, Bytes answer, const Rooms& rooms) {
    return t.type == MailboxType::foe && answer.size() >= foe::Layout::opcode::end &&
           foe::Layout::opcode::load(answer) == foe::Opcode::data && answer.size() < rooms.from_slave;
}

}  // namespace margay::gateway
