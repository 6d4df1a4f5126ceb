// The messages by EoE and AoE of ENI files: their reader, and how they are sent.
#include <margay/aoe.hpp>
#include <margay/eoe.hpp>
#include <margay/mailbox.hpp>
#include <margay/margay.hpp>

#include "files/eni_read.hpp"
#include "files/esi_read.hpp"
#include "files/modules.hpp"
#include "wire/aoe.hpp"
#include "wire/eoe.hpp"

#include <algorithm>
#include <charconv>

namespace margay::files {
namespace {

namespace aoe = wire::aoe;
namespace eoe = wire::eoe;

constexpr std::uint32_t kNetIdGroup = 1;  // as AoeSetNetId
constexpr std::uint32_t kNetIdOffset = 3;

// ------------------------------------------------------------------ the reader

// IP parameters with at least one of them, and of exactly the size that their flags announce.
std::optional<EoeIp> exact_ip(Bytes data) {
    constexpr std::uint32_t kFlags = 0x1'003F;  // six parameters, and the time stamp
    if (data.size() < sizeof(std::uint32_t)) return std::nullopt;
    const auto flags = load_le<std::uint32_t>(data);
    const auto ip = eoe::load_ip(data);
    if (flags == 0 || (flags & ~kFlags) != 0 || !ip) return std::nullopt;
    std::array<std::byte, eoe::kIpBytes> again{};
    return data.size() == eoe::kIpBytes || data.size() == eoe::store_ip(again, *ip, true) ? ip : std::nullopt;
}

// The message as it is sent. Some tools leave the EoE header out: then the data begins with the flags of the IP
// parameters.
void read_eoe_data(Bytes data, EniMail& mail) {
    if (data.size() < eoe::kHeaderBytes) return;
    const Bytes parameters = data.subspan(eoe::kHeaderBytes);
    const eoe::Header header = eoe::load_header(data);
    if (header.type == eoe::Type::set_ip_request) mail.ip = exact_ip(parameters);
    if (!mail.ip) mail.ip = exact_ip(data);
    if (!mail.ip && header.type == eoe::Type::set_filter_request && parameters.size() == eoe::kFilterBytes)
        mail.filter = eoe::load_filter(parameters);
}

void read_eoe(Reader& r, Node protocol, EniSlaveData& s) {
    for (const Node node : protocol.child("InitCmds").children("InitCmd")) {
        if (r.boolean(child(node, "Disabled"))) continue;
        EniMail mail{.transitions = read_transitions(r, node)};
        read_eoe_data(r.octets(child(node, "Data")), mail);
        if (!mail.ip && !mail.filter)
            r.remark(node,
                     "the start-up command of EoE is not sent: its data is neither that of IP parameters nor of an "
                     "address filter");
        else if (mail.transitions != Transition::none)
            s.slave.mail.push_back(std::move(mail));
    }
}

// Whether this is a command whose answer is a result alone.
bool writes(Bytes command) {
    if (command.size() < aoe::kHeaderBytes) return false;
    const aoe::Header header = aoe::load_header(command);
    if ((header.flags & (aoe::state_flag::kResponse | aoe::state_flag::kNoReturn)) != 0) return false;
    const Bytes data = command.subspan(aoe::kHeaderBytes);
    if (header.data_bytes != data.size()) return false;
    if (header.command == aoe::Command::write_control)
        return data.size() >= aoe::kControlBytes &&
               aoe::ControlLayout::bytes::load(data) == data.size() - aoe::kControlBytes;
    return header.command == aoe::Command::write && data.size() >= aoe::kIndexBytes &&
           aoe::IndexLayout::bytes::load(data) == data.size() - aoe::kIndexBytes;
}

bool gives_net_id(const EniMail& mail) {
    const Bytes command(mail.aoe_command);
    if (command.size() < aoe::kHeaderBytes + aoe::kIndexBytes) return false;
    const Bytes data = command.subspan(aoe::kHeaderBytes);
    return aoe::load_header(command).command == aoe::Command::write &&
           aoe::IndexLayout::group::load(data) == kNetIdGroup && aoe::IndexLayout::offset::load(data) == kNetIdOffset;
}

// "1.2.3.4.1.1"
std::optional<AoeNetId> net_id_of(std::string_view text) {
    AoeNetId id;
    const char* at = text.data();
    const char* const end = at + text.size();
    for (std::size_t n = 0; n < id.octets.size(); ++n) {
        if (n != 0 && (at == end || *at++ != '.')) return std::nullopt;
        const auto [next, error] = std::from_chars(at, end, id.octets[n]);
        if (error != std::errc()) return std::nullopt;
        at = next;
    }
    return at == end ? std::optional(id) : std::nullopt;
}

void read_aoe(Reader& r, Node protocol, EniSlaveData& s) {
    bool named = false;
    std::vector<EniMail> commands;
    for (const Node node : protocol.child("InitCmds").children("InitCmd")) {
        if (r.boolean(child(node, "Disabled"))) continue;
        EniMail mail{.transitions = read_transitions(r, node)};
        mail.aoe_command = r.octets(child(node, "Data"));
        if (!writes(mail.aoe_command)) {
            r.remark(node, "the start-up command of AoE is not sent: its data is no AoE command that writes");
            continue;
        }
        if (mail.transitions == Transition::none) continue;
        named = named || gives_net_id(mail);
        commands.push_back(std::move(mail));
    }
    if (const Value id = child(protocol, "NetId"); id.there && !id.text.empty()) {
        EniMail mail{.transitions = Transition::init_to_preop, .net_id = net_id_of(id.text)};
        if (!mail.net_id)
            r.fail(id.at,
                   "NetId is '" + Reader::text(id) + "', and not six numbers from 0 to 255 with dots between them");
        else if (!named)
            s.slave.mail.push_back(std::move(mail));
    }
    std::ranges::move(commands, std::back_inserter(s.slave.mail));
}

// ------------------------------------------------------------------ sending

// There is no mailbox in INIT: mail of IP and IB is sent when the slave has reached the state.
bool is_due(const EniMail& mail, Transition which, Moment moment) {
    const bool early = which == Transition::init_to_preop || which == Transition::init_to_boot;
    return contains(mail.transitions, which) && moment == (early ? Moment::after : Moment::before);
}

// The error that the answer to an AoE command tells.
Result<> judge_aoe(Bytes command, Bytes answer, std::uint16_t slave) {
    Error error{.code = Errc::protocol, .step = Step::aoe_write, .slave = slave};
    if (answer.size() < aoe::kHeaderBytes) return error;
    const aoe::Header sent = aoe::load_header(command);
    const aoe::Header header = aoe::load_header(answer);
    const bool mine = header.command == sent.command && header.invoke_id == sent.invoke_id &&
                      (header.flags & aoe::state_flag::kResponse) != 0;
    if (!mine) return error;
    const auto refused = [&](Errc code, std::uint32_t detail) {
        error.code = code;
        error.detail = detail;
        return error;
    };
    if (header.error_code != 0) return refused(Errc::aoe_error, header.error_code);
    if (answer.size() < aoe::kHeaderBytes + aoe::kResultBytes) return error;
    const auto result = load_le<std::uint32_t>(answer, aoe::kHeaderBytes);
    if (result != 0) return refused(Errc::aoe_result, result);
    return {};
}

constexpr std::size_t kAoeAnswer = aoe::kHeaderBytes + aoe::kResultBytes;

Task<> send_one(HookedSlave slave, const EniMail& mail) {
    if (mail.ip) {
        auto done = co_await slave.eoe_set_ip(*mail.ip);
        co_return done;
    }
    if (mail.filter) {
        auto done = co_await slave.eoe_set_filter(*mail.filter);
        co_return done;
    }
    if (mail.net_id) {
        auto done = co_await slave.aoe_set_net_id(*mail.net_id);
        co_return done;
    }
    std::array<std::byte, kAoeAnswer> answer{};
    auto got = co_await slave.raw_mail(MailboxType::aoe, mail.aoe_command, answer);
    if (!got) co_return got.error();
    co_return judge_aoe(mail.aoe_command, Bytes(answer).first(*got), slave.number());
}

// The same by requests, for the owner of the context.
Result<> send_now(Context& ctx, std::uint16_t slave, const EniMail& mail) {
    if (mail.ip) return EOEset_ip(ctx, slave, *mail.ip);
    if (mail.filter) return EOEset_filter(ctx, slave, *mail.filter);
    if (mail.net_id) return AOEset_net_id(ctx, slave, *mail.net_id);
    std::array<std::byte, kAoeAnswer> answer{};
    const auto got = raw_mail(ctx, slave, MailboxType::aoe, mail.aoe_command, answer);
    if (!got) return got.error();
    return judge_aoe(mail.aoe_command, Bytes(answer).first(*got), slave);
}

Result<> send_first(Context& ctx, const EniSlave& slave) {
    for (const EniMail& mail : slave.mail) {
        if (!is_due(mail, Transition::init_to_preop, Moment::after)) continue;
        if (const auto sent = send_now(ctx, slave.number, mail); !sent) return sent;
    }
    return {};
}

// The detected modules, where the slave has a list of them.
Result<> check_detected(Context& ctx, const EniSlave& slave) {
    constexpr std::uint32_t kNoObject = 0x0602'0000;
    const auto other = find_other_module(ctx, slave.number, slave.modules);
    if (!other && other.error().code == Errc::sdo_abort && other.error().detail == kNoObject) return {};
    if (!other) return other.error();
    if (!other->there) return {};
    return Error{.code = Errc::check_failed,
                 .step = Step::sdo_upload,
                 .slave = slave.number,
                 .index = kDetectedModules,
                 .subindex = static_cast<std::uint8_t>(other->slot + 1),
                 .expected = other->wanted,
                 .actual = other->found};
}

}  // namespace

void read_eni_mail(Reader& r, Node mailbox, EniSlaveData& s) {
    read_eoe(r, mailbox.child("EoE"), s);
    read_aoe(r, mailbox.child("AoE"), s);
    for (const char* name : {"FoE", "VoE"})
        for (const Node node : mailbox.child(name).child("InitCmds").children("InitCmd"))
            r.remark(node, std::string("the start-up command of ") + name + " is not supported and not sent");
}

Task<> send_mail(HookedSlave slave, Transition which, Moment moment, void* user) {
    for (const EniMail& mail : static_cast<const EniSlave*>(user)->mail) {
        if (!is_due(mail, which, moment)) continue;
        auto sent = co_await send_one(slave, mail);
        if (!sent) co_return sent.error();
    }
    co_return {};
}

Result<> after_scan(Context& ctx, const EniConfiguration& eni) {
    Result<> first;
    const auto keep = [&](const Result<>& done) {
        if (first && !done) first = done;
    };
    for (const EniSlave& one : eni.slaves) {
        if (one.number > ctx.slaves().size()) continue;
        const Slave& slave = ctx.slave(one.number);
        if (!one.mail.empty()) {
            slave.hooks.transition = send_mail;
            slave.hooks.user = const_cast<EniSlave*>(&one);  // the hook only reads it
        }
        if (slave.al.state != AlState::preop || slave.al.error) continue;
        keep(send_first(ctx, one));
        if (one.modules.empty()) continue;
        keep(check_detected(ctx, one));
    }
    return first;
}

}  // namespace margay::files
