// The request for a mailbox message of any protocol.
#include "mailbox/raw_mail.hpp"

#include "api/mail.hpp"
#include "wire/coe.hpp"
#include "wire/soe.hpp"

namespace margay {
namespace {

// Whether a message writes an object or a parameter that decides about process data. For a segmented download, the
// first message shows this. Messages of AoE are not checked.
bool writes_pdos(const RawMail& r) {
    namespace coe = wire::coe;
    if (r.type == MailboxType::soe && r.message.size() >= wire::soe::kHeaderBytes) {
        const auto header = wire::soe::load_header(r.message);
        return header.opcode == wire::soe::Opcode::write_request && !header.incomplete &&
               decides_on_telegram(header.idn());
    }
    return r.type == MailboxType::coe && r.message.size() >= coe::SdoLayout::subindex::end &&
           coe::load_header(r.message).service == coe::Service::sdo_request &&
           coe::sdo::specifier(coe::SdoLayout::command::load(r.message)) == coe::request::kDownload &&
           decides_on_pdos(coe::SdoLayout::index::load(r.message));
}

// Whether the slave has refused the download of a single subindex.
bool refused_download(const RawMail& r) {
    namespace coe = wire::coe;
    const Bytes answer = Bytes(r.answer).first(std::min(r.bytes, r.answer.size()));
    return r.type == MailboxType::coe && answer.size() >= coe::SdoLayout::command::end &&
           coe::sdo::specifier(coe::SdoLayout::command::load(answer)) == coe::kAbortSpecifier &&
           (coe::SdoLayout::command::load(r.message) & coe::sdo::kCompleteAccess) == 0;
}

}  // namespace

static Error check(Network& network, const RawMail& r) {
    const Error where{.step = Step::mailbox_send, .slave = r.slave};
    const Error refused = check_mailbox(network, where);
    if (refused.code != Errc::none) return refused;
    const auto type = static_cast<unsigned>(r.type);
    if (type == 0 || type > 15) return invalid(Argument::mail_type, where.step, r.slave);
    if (r.message.empty() && r.answer.empty()) return invalid(Argument::mail_size, where.step, r.slave);
    const StationAddress has = network.slave(r.slave).station_address;
    if (r.station != StationAddress{} && r.station != has) {
        Error other = where;
        other.code = Errc::unknown_slave;
        other.detail = r.station.value;
        other.actual = has.value;
        return other;
    }
    return check_message(network, r.message.size(), where);
}

static Task<Result<>> run(Network& network, RawMail& r) {
    r.bytes = 0;
    MailboxChannel& channel = channel_of(network, r);
    const MailPatience patience = patience_of(r);
    if (r.message.empty()) co_return co_await required(await_raw(channel, r, patience));
    const bool decides = writes_pdos(r);
    PdoWrite note(network, r.slave, decides);
    co_await required(transfer_raw(channel, r, patience));
    if (decides && refused_download(r)) note.refused();
    co_return Nothing{};
}

static constexpr OperationDescription kRaw =
    describe_mail<RawMail, check, run>(Operation::raw_mail, Step::mailbox_send);
RawMail::RawMail() : SlaveRequest(kRaw) {}

Result<std::size_t> raw_mail(Context& ctx, std::uint16_t slave, MailboxType type, std::span<const std::byte> message,
                             std::span<std::byte> answer, Duration timeout) {
    RawMail request;
    request.slave = slave;
    request.timeout = timeout;
    request.type = type;
    request.message = message;
    request.answer = answer;
    return submit_and_wait(ctx, request, request.bytes);
}

}  // namespace margay
