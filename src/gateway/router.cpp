#include "gateway/router.hpp"

#include "api/queue.hpp"
#include "wire/coe.hpp"

#include <margay/margay.hpp>

#include <algorithm>
#include <array>

namespace margay::gateway {
namespace {

using namespace std::chrono_literals;
using wire::MailboxErrorCode;
using Kind = Transaction::Kind;

constexpr int kListTimeouts = 4;  // a list has hundreds of fragments

MailboxErrorCode code_of(const Error& error) {
    switch (error.code) {
        case Errc::mailbox_error:
            return error.detail == 0 ? MailboxErrorCode::syntax : static_cast<MailboxErrorCode>(error.detail);
        case Errc::unknown_slave: return MailboxErrorCode::syntax;
        case Errc::unsupported: return MailboxErrorCode::unsupported_protocol;
        case Errc::invalid_argument:
        case Errc::protocol: return MailboxErrorCode::invalid_size;
        case Errc::timeout:
        case Errc::reply_lost:
        case Errc::mailbox_full: return MailboxErrorCode::service_in_work;
        case Errc::capacity:
        case Errc::canceled:
        case Errc::not_polled: return MailboxErrorCode::no_more_memory;
        // The slave is missing, or is in a state without this service.
        default: return MailboxErrorCode::service_not_supported;
    }
}

}  // namespace

Router::Router(Context& ctx, const MailboxGatewaySettings& settings)
    : ctx_(ctx), settings_(settings), table_(ctx), objects_(settings.name, settings.identity) {}

Duration Router::timeout_of(const Transaction& t) const {
    const auto time = std::chrono::duration_cast<Duration>(settings_.reply_timeout);
    const bool list =
        t.type == MailboxType::coe && static_cast<wire::coe::Service>(t.service) == wire::coe::Service::sdo_information;
    return list ? kListTimeouts * time : time;
}

// ------------------------------------------------------------------ replies

void Router::reply(Client* client, wire::MailboxHeader header, Bytes data, Moment now) {
    ++counts_.replies;
    if (client == nullptr || !client->send(frame_of(header, data), now)) ++counts_.lost;
}

void Router::reply_error(Client* client, wire::MailboxHeader header, MailboxErrorCode code, Moment now) {
    std::array<std::byte, wire::kMailboxErrorBytes> data{};
    wire::MailboxErrorLayout::type::store(data, wire::kMailboxErrorTypeCommand);
    wire::MailboxErrorLayout::detail::store(data, code);
    header.type = MailboxType::error;
    ++counts_.errors;
    reply(client, header, data, now);
}

// An SDO download is refused by an SDO abort, so that a tool shows the reason.
void Router::refuse_change(Client& client, const Mail& mail, const Transaction& t, Moment now) {
    namespace coe = wire::coe;
    if (!t.download) return reply_error(&client, mail.header, MailboxErrorCode::service_not_supported, now);
    std::array<std::byte, coe::kSdoBytes> data{};
    coe::store_header(data, {.service = coe::Service::sdo_request});
    coe::SdoLayout::command::store(data, coe::sdo::command(coe::kAbortSpecifier));
    if (t.specifier == coe::request::kDownload) {
        coe::SdoLayout::index::store(data, coe::SdoLayout::index::load(mail.data));
        coe::SdoLayout::subindex::store(data, coe::SdoLayout::subindex::load(mail.data));
    }
    coe::SdoLayout::complete_size::store(data, static_cast<std::uint32_t>(coe::Abort::local_control));
    reply(&client, mail.header, data, now);
}

// ------------------------------------------------------------------ messages of clients

void Router::receive(Client& client, Mail mail, Moment now) {
    ++counts_.messages;
    // An error reply is not answered: two ends that answer errors would never stop.
    if (mail.header.type == MailboxType::error) return;
    const auto refuse = [&](MailboxErrorCode code) { reply_error(&client, mail.header, code, now); };
    if (!mail.complete) return refuse(MailboxErrorCode::invalid_size);
    const auto transaction = transaction_of(mail.header.type, mail.data, false);
    if (transaction.kind == Kind::refused) return refuse(transaction.refusal);
    if (settings_.read_only && transaction.changes && mail.header.address != 0)
        return refuse_change(client, mail, transaction, now);
    if (client.waiting.size() >= settings_.waiting) return refuse(MailboxErrorCode::no_more_memory);
    client.waiting.push_back({.mail = std::move(mail), .since = now});
}

void Router::refuse(Client& client, const Mail& mail, Moment now) {
    if (mail.header.type != MailboxType::error)
        reply_error(&client, mail.header, MailboxErrorCode::no_more_memory, now);
}

void Router::remove(Client& client) {
    client.waiting.clear();
    client.running = 0;
    std::erase(clients_, &client);
    for (auto& job : running_)
        if (job->client == &client) {
            job->client = nullptr;
            job->cancel();
        }
    for (auto& [key, conversation] : conversations_)
        if (conversation.client == &client) end(conversation);
    std::erase_if(conversations_, [](const auto& each) { return each.second.client == nullptr; });
}

bool Router::uses(const Client& client) const {
    return !client.waiting.empty() || client.running != 0 ||
           std::ranges::any_of(conversations_, [&](const auto& each) { return each.second.client == &client; });
}

// ------------------------------------------------------------------ the loop

void Router::step(Moment now) {
    if (table_.step(now)) {
        if (table_.polled())
            objects_.update(table_.slaves());
        else
            refuse_all_waiting(now);
    }
    for (auto& job : running_) look_after(job, now);
    std::erase(running_, nullptr);
    look_after_conversations(now);
    std::erase_if(ending_, [](const auto& job) { return !job->busy(); });
    expire_waiting(now);
    start_waiting(now);
}

// The state of a request is checked often in its first milliseconds, because most requests end in this time.
std::chrono::nanoseconds Router::patience(Moment now) const {
    std::chrono::nanoseconds time = 250ms;
    for (const auto& job : running_)
        time = std::min<std::chrono::nanoseconds>(time, now - job->begun < 50ms ? 200us : 2ms);
    const auto waits = [](const Client* client) { return !client->waiting.empty(); };
    if (table_.busy()) time = std::min<std::chrono::nanoseconds>(time, 200us);
    if (!conversations_.empty() || !ending_.empty() || std::ranges::any_of(clients_, waits))
        time = std::min<std::chrono::nanoseconds>(time, 2ms);
    return time;
}

void Router::put_away(std::unique_ptr<MailJob> job) {
    job->client = nullptr;
    job->cancel();
    if (job->busy()) ending_.push_back(std::move(job));
}

void Router::deliver_earlier(MailJob& job, Moment now) {
    while (const auto mail = job.earlier()) reply(job.client, job.mail.header, *mail, now);
}

void Router::look_after(std::unique_ptr<MailJob>& job, Moment now) {
    const bool over = !job->busy();  // read before the ring is emptied, so that no mail can follow
    if (job->client != nullptr) deliver_earlier(*job, now);
    if (over) return finish(std::move(job), now);
    const bool accepted = RequestAccess::accepted(*job);
    const auto limit = accepted ? kOwnerSilent + timeout_of(job->transaction) : Duration(kOwnerSilent);
    if (now - job->begun <= limit) return;
    // The owner does not poll, or has stopped to poll.
    fail(*job, accepted ? MailboxErrorCode::service_in_work : MailboxErrorCode::no_more_memory, now);
    put_away(std::move(job));
}

void Router::fail(MailJob& job, MailboxErrorCode code, Moment now) {
    converse(job, false, now);
    if (job.client == nullptr) return;
    --job.client->running;
    reply_error(job.client, job.mail.header, code, now);
}

void Router::finish(std::unique_ptr<MailJob> job, Moment now) {
    if (job->client == nullptr) return;
    const Error error = job->error();
    if (job->state() != RequestState::success) {
        // A scan has found the slaves again since the facts were read: the message is sent once more, with new facts.
        if (error.code == Errc::unknown_slave && !job->again) {
            --job->client->running;
            table_.forget();
            job->client->waiting.push_front({.mail = std::move(job->mail), .since = job->begun, .again = true});
            return;
        }
        return fail(*job, code_of(error), now);
    }
    if (job->lost()) return fail(*job, MailboxErrorCode::no_more_memory, now);
    --job->client->running;
    if (job->transaction.kind == Kind::listening) return;
    if (const SlaveFacts* slave = table_.find(job->station.value)) job->rooms = rooms_of(*slave);
    const bool answered = job->transaction.kind == Kind::answered;
    const Bytes answer = answered ? job->last() : Bytes();
    if (answered) reply(job->client, job->mail.header, answer, now);
    converse(*job, goes_on(job->transaction, job->mail.data, answer, job->rooms), now);
}

// ------------------------------------------------------------------ conversations

void Router::converse(MailJob& job, bool on, Moment now) {
    if (job.transaction.kind == Kind::listening) return;
    const Key key{job.station.value, job.transaction.type};
    const auto found = conversations_.find(key);
    if (!on || job.client == nullptr) {
        if (found != conversations_.end()) conversations_.erase(found);
        return;
    }
    Conversation& conversation = conversations_[key];
    conversation.client = job.client;
    conversation.until = now + settings_.pause_in_transfer;
    if (job.transaction.kind == Kind::answered) conversation.over = ends_file(job.transaction, job.last(), job.rooms);
}

void Router::end(Conversation& conversation) {
    conversation.client = nullptr;
    if (conversation.listening != nullptr) put_away(std::move(conversation.listening));
}

void Router::look_after_conversations(Moment now) {
    for (auto& [key, conversation] : conversations_) {
        MailJob* const job = conversation.listening.get();
        const bool over = job != nullptr && !job->busy();
        while (job != nullptr) {
            const auto mail = job->earlier();
            if (!mail) break;
            conversation.answered = true;
            reply(conversation.client, conversation.header, *mail, now);
        }
        if (over || now >= conversation.until) end(conversation);
    }
    std::erase_if(conversations_, [](const auto& each) { return each.second.client == nullptr; });
}

}  // namespace margay::gateway
