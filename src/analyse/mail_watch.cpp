#include "analyse/mail_watch.hpp"

#include "wire/aoe.hpp"
#include "wire/coe.hpp"
#include "wire/esc.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::analyse {

using wire::Command;
using wire::MailboxType;

namespace {

constexpr std::size_t kMostOpen = 4096;  // conversations at the same time

bool known_type(MailboxType type) {
    switch (type) {
        case MailboxType::error:
        case MailboxType::aoe:
        case MailboxType::eoe:
        case MailboxType::coe:
        case MailboxType::foe:
        case MailboxType::soe:
        case MailboxType::voe: return true;
    }
    return false;
}

// Whether octets at an unknown place are an SDO message. Other messages are not recognised without the addresses of the
// mailboxes.
bool looks_like_sdo(Bytes data) {
    const auto mail = wire::load_mailbox_message(data);
    if (!mail || mail->header.type != MailboxType::coe || mail->header.channel != 0) return false;
    if (mail->data.size() < wire::coe::kSdoBytes) return false;
    const auto header = wire::coe::load_header(mail->data);
    const auto index = wire::coe::SdoLayout::index::load(mail->data);
    return header.number == 0 && index >= 0x1000 &&
           (header.service == wire::coe::Service::sdo_request || header.service == wire::coe::Service::sdo_response);
}

// The octets of the mailbox to the slave (`sent`) or from the slave whose first octet the datagram addresses; 0: the
// datagram addresses none. If the recording does not show the mailbox, the number of octets of the datagram is used.
std::size_t mailbox_at(const SlaveTrack& slave, std::uint16_t address, bool sent, Bytes data) {
    bool known = false;
    for (const auto& [n, sm] : slave.sync_managers) {
        if (!sm.mailbox() || sm.ecat_writes() != sent || sm.length_bytes == 0) continue;
        known = true;
        if (sm.physical_start == address) return sm.length_bytes;
    }
    namespace word = wire::sii::word;
    if (slave.sii_has(word::kBootMailbox * 2, wire::sii::kMailboxesBytes)) {
        const auto boxes = wire::sii::load_mailboxes(Bytes(slave.sii).subspan(word::kBootMailbox * 2));
        for (const auto& box : {boxes.standard, boxes.boot}) {
            const std::size_t octets = sent ? box.out_bytes : box.in_bytes;
            if (octets == 0) continue;
            known = true;
            if ((sent ? box.out_start : box.in_start) == address) return octets;
        }
    }
    return !known && looks_like_sdo(data) ? data.size() : 0;
}

}  // namespace

bool is_kept_object(std::uint16_t index) {
    return index == 0x1008 || index == 0x1018 || (index >= 0x1C10 && index < 0x1C30) ||
           (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00);
}

void keep_object(SlaveTrack& slave, const Conversation& facts, Bytes data) {
    constexpr std::size_t kMostObjects = 8192;
    const std::uint32_t object = std::uint32_t{facts.index} << 8;
    auto& objects = slave.objects;
    const auto keep = [&](std::uint32_t subindex, Bytes value) {
        if (objects.size() < kMostObjects || objects.contains(object | subindex))
            objects[object | subindex] = {value.begin(), value.end()};
    };
    if (!facts.complete) return keep(facts.subindex, data);
    const bool list = facts.index >= 0x1C10 && facts.index < 0x1C30;
    const std::size_t octets = list ? 2 : 4;  // octets of each value, except subindex 0
    if (facts.subindex == 0) {                // subindex 0 has 16 bits
        if (data.size() < 2) return;
        objects.erase(objects.lower_bound(object), objects.upper_bound(object | 0xFF));
        keep(0, data.first(1));
        data = data.subspan(2);
    }
    for (std::uint32_t subindex = 1; data.size() >= octets && subindex <= 0xFF; ++subindex) {
        keep(subindex, data.first(octets));
        data = data.subspan(octets);
    }
}

std::string printable(Bytes octets) {
    const auto end = std::ranges::find(octets, std::byte{0});
    std::vector<char> text(2 * octets.size());
    return std::string(wire::sii::to_utf8({octets.begin(), end}, text));
}

bool MailWatch::is_look(const Exchanged& e, const SlaveTrack* slave) {
    const auto address = e.header.address.ado();
    if (e.header.command != Command::FPRD && e.header.command != Command::APRD) return false;
    return slave != nullptr && address >= wire::reg::kProcessRam && mailbox_at(*slave, address, false, e.received) != 0;
}

void MailWatch::look(const Exchanged& e, SlaveTrack* slave) {
    const auto c = e.header.command;
    const bool sent = c == Command::FPWR || c == Command::APWR;
    sent_.came_back(e);
    if (slave == nullptr || !e.answered || e.wkc != 1 || (!sent && c != Command::FPRD && c != Command::APRD)) return;
    const auto address = e.header.address.ado();
    if (address < wire::reg::kProcessRam) return;
    const auto data = sent ? e.sent : e.received;
    const auto octets = mailbox_at(*slave, address, sent, data);
    if (octets == 0) return;
    for (const auto& lost : sent_.take(e.header, e.sent_at)) {
        if (sent && std::ranges::equal(lost.data, data)) continue;  // the master has repeated the message
        if (const auto all = mailbox_at(*slave, lost.address, true, lost.data); all != 0)
            pass(lost.when, *slave, true, lost.data, all);
    }
    pass(e.at, *slave, sent, data, octets);
}

void MailWatch::pass(Moment when, SlaveTrack& slave, bool sent, Bytes data, std::size_t mailbox) {
    const auto mail = wire::load_mailbox_message(data);
    if (!mail || !known_type(mail->header.type)) return;
    // A message that is equal to the previous message, counter included, is a repetition.
    if (auto& last = slave.last_mail[sent ? 0 : 1]; mail->header.counter != 0) {
        const auto whole = data.first(wire::kMailboxHeaderBytes + mail->data.size());
        if (std::ranges::equal(last, whole)) return;
        last.assign(whole.begin(), whole.end());
    }
    auto& counts = slaves_.facts(slave).mail[mail->header.type];
    ++(sent ? counts.sent : counts.received);
    (sent ? counts.sent_bytes : counts.received_bytes) += mail->data.size();
    const auto room = std::max(mailbox, data.size()) - wire::kMailboxHeaderBytes;
    take({when, slave, sent, mail->header, mail->data, room});
}

void MailWatch::take(const Mail& mail) {
    switch (mail.header.type) {
        case MailboxType::coe: return take_coe(mail);
        case MailboxType::foe: return take_foe(mail);
        case MailboxType::soe: return take_soe(mail);
        case MailboxType::aoe: return take_aoe(mail);
        case MailboxType::error: return take_error(mail);
        default: return;
    }
}

OpenConversation* MailWatch::open(const Mail& mail) {
    const auto found = open_.find({mail.slave.number, mail.header.type});
    return found == open_.end() ? nullptr : &found->second.back();
}

// A slave may answer a CoE request after the master has given it up, and the answer contains the object. The answers of
// other protocols do not always identify the request.
OpenConversation& MailWatch::begin(const Mail& mail, Action action) {
    constexpr std::size_t kMostSuperseded = 4;
    const Key key{mail.slave.number, mail.header.type};
    const std::size_t kept = mail.header.type == MailboxType::coe ? kMostSuperseded : 0;
    if (const auto found = open_.find(key); found != open_.end()) {
        for (auto& conversation : found->second) conversation.superseded = true;
        while (found->second.size() > kept) close(found->second, 0, mail.when, Outcome::unanswered);
    } else if (open_.size() >= kMostOpen) {
        close_all(open_.begin(), mail.when);
    }
    auto& conversation = open_[key].emplace_back();
    conversation.facts = {.begin = mail.when, .end = mail.when, .slave = mail.slave.number, .action = action};
    return conversation;
}

void MailWatch::append(OpenConversation& conversation, Bytes data) {
    conversation.facts.bytes += data.size();
    const auto room = kMostObject - std::min(kMostObject, conversation.data.size());
    const auto part = data.first(std::min(room, data.size()));
    conversation.data.insert(conversation.data.end(), part.begin(), part.end());
}

void MailWatch::end(const Mail& mail, OpenConversation& conversation, Outcome outcome, std::uint32_t code,
                    std::string reason) {
    auto& facts = conversation.facts;
    facts.code = code;
    facts.reason = std::move(reason);
    facts.late = conversation.superseded;
    const bool sdo = facts.action == Action::sdo_upload || facts.action == Action::sdo_download;
    if (sdo && outcome == Outcome::done && is_kept_object(facts.index))
        keep_object(mail.slave, facts, conversation.data);
    const auto found = open_.find({mail.slave.number, mail.header.type});
    auto& conversations = found->second;
    close(conversations, static_cast<std::size_t>(&conversation - conversations.data()), mail.when, outcome);
    if (conversations.empty()) open_.erase(found);
}

void MailWatch::close(Conversations& conversations, std::size_t at, Moment when, Outcome outcome) {
    const auto closed = conversations.begin() + static_cast<std::ptrdiff_t>(at);
    auto facts = std::move(closed->facts);
    facts.outcome = outcome;
    if (outcome != Outcome::unanswered) facts.end = when;
    auto& data = closed->data;
    data.resize(std::min(data.size(), Conversation::kKept));
    facts.data = std::move(data);
    conversations.erase(closed);
    analysis_.conversations.add(std::move(facts), kMostConversations);
}

void MailWatch::close_all(std::map<Key, Conversations>::iterator of, Moment when) {
    auto& conversations = of->second;
    while (!conversations.empty())
        close(conversations, 0, when, conversations[0].superseded ? Outcome::unanswered : Outcome::unfinished);
    open_.erase(of);
}

void MailWatch::finish(Moment end) {
    while (!open_.empty()) close_all(open_.begin(), end);
    const auto begins_before = [](const Conversation& a, const Conversation& b) { return a.begin.is_before(b.begin); };
    std::ranges::stable_sort(analysis_.conversations.items, begins_before);
}

void MailWatch::take_aoe(const Mail& mail) {
    if (mail.sent || mail.data.size() < wire::aoe::kHeaderBytes) return;
    if (wire::aoe::load_header(mail.data).error_code != 0) ++slaves_.facts(mail.slave).mail[MailboxType::aoe].errors;
}

// A mailbox error is treated as the answer to the youngest conversation.
void MailWatch::take_error(const Mail& mail) {
    ++slaves_.facts(mail.slave).mail[MailboxType::error].errors;
    if (mail.data.size() < wire::kMailboxErrorBytes) return;
    auto youngest = open_.end();
    for (auto at = open_.begin(); at != open_.end(); ++at)
        if (at->first.first == mail.slave.number &&
            (youngest == open_.end() || !at->second.back().facts.begin.is_before(youngest->second.back().facts.begin)))
            youngest = at;
    if (youngest == open_.end()) return;
    const auto detail = wire::MailboxErrorLayout::detail::load(mail.data);
    Mail answer = mail;
    answer.header.type = youngest->first.second;
    end(answer, youngest->second.back(), Outcome::refused, static_cast<std::uint32_t>(detail),
        "mailbox error: " + std::string(wire::to_text(detail)));
}

}  // namespace margay::analyse
