// The order in which the messages of the clients begin.
#include "gateway/router.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay::gateway {
namespace {

using namespace std::chrono_literals;
using wire::MailboxErrorCode;
using Kind = Transaction::Kind;

// The limit of requests at the same time is one for each client, plus this number.
constexpr std::size_t kSlotsBeside = 8;
constexpr std::size_t kMostOfClient = 4;
constexpr auto kListen = 1s;
constexpr auto kListenAtMost = 1h;

}  // namespace

// Each client begins one message in its turn, so that all of them get equal shares.
void Router::start_waiting(Moment now) {
    for (bool any = true; any;) {
        any = false;
        for (std::size_t n = 0; n < clients_.size(); ++n)
            any |= start_one(*clients_[(next_ + n) % clients_.size()], now);
    }
    if (!clients_.empty()) next_ = (next_ + 1) % clients_.size();
}

// Begins one waiting message of the client. Returns whether one has begun. Messages to one protocol of one slave keep
// their order.
bool Router::start_one(Client& client, Moment now) {
    if (!client.takes_replies()) return false;
    for (auto each = client.waiting.begin(); each != client.waiting.end(); ++each) {
        const auto& header = each->mail.header;
        const auto same = [&](const Client::Waiting& other) {
            return other.mail.header.address == header.address && other.mail.header.type == header.type;
        };
        if (std::any_of(client.waiting.begin(), each, same)) continue;
        if (!start(client, *each, now)) continue;
        client.waiting.erase(each);
        return true;
    }
    return false;
}

bool Router::start(Client& client, Client::Waiting& message, Moment now) {
    const Mail& mail = message.mail;
    const SlaveFacts* slave = table_.find(mail.header.address);
    // For a known slave, slightly older facts are sufficient, because the request checks the address.
    const bool fresh = table_.is_fresh(now);
    if (!fresh) table_.refresh(now);
    if (!fresh && (slave == nullptr || !table_.is_usable(now))) return false;
    if (mail.header.address == 0) {
        answer_for_master(client, mail, now);
        return true;
    }
    if (slave == nullptr) {
        reply_error(&client, mail.header, MailboxErrorCode::syntax, now);
        return true;
    }
    const Key key{mail.header.address, mail.header.type};
    if (!may_converse(client, key, now) || !has_slot(client)) return false;
    const auto conversation = conversations_.find(key);
    const bool over = conversation != conversations_.end() && conversation->second.over;
    const auto transaction = transaction_of(mail.header.type, mail.data, over);
    if (transaction.kind == Kind::listening && !listen(client, *slave, mail, now)) return false;
    auto job = std::make_unique<MailJob>(*slave, std::move(message.mail), transaction, client);
    job->again = message.again;
    submit_mail(std::move(job), now);
    return true;
}

// Whether a message may begin: only one message of each protocol of a slave at the same time, and none during a
// conversation of another client.
bool Router::may_converse(Client& client, const Key& key, Moment now) {
    const auto same = [&](const std::unique_ptr<MailJob>& job) {
        return job->station.value == key.first && job->type == key.second;
    };
    if (std::ranges::any_of(running_, same)) return false;
    const auto found = conversations_.find(key);
    return found == conversations_.end() || found->second.client == &client || now >= found->second.until;
}

// Whether a slot is free. One slot is reserved for each client without a request.
bool Router::has_slot(const Client& client) const {
    const std::size_t slots = settings_.clients + kSlotsBeside;
    const std::size_t used = running_.size() + ending_.size();
    if (used >= slots || client.running >= kMostOfClient) return false;
    if (client.running == 0) return true;
    const auto kept = std::ranges::count_if(clients_, [](const Client* each) { return each->running == 0; });
    return used + static_cast<std::size_t>(kept) < slots;
}

// Begins to wait for the mail of the slave before the message is sent. A client listens to one slave at the same time.
bool Router::listen(Client& client, const SlaveFacts& slave, const Mail& mail, Moment now) {
    const Key key{mail.header.address, mail.header.type};
    for (auto& [other, conversation] : conversations_) {
        if (conversation.client != &client || conversation.listening == nullptr || other == key) continue;
        if (!conversation.answered) return false;
        conversation.until = now;
    }
    Conversation& conversation = conversations_[key];
    if (conversation.client != &client || conversation.listening == nullptr) {
        end(conversation);
        conversation.client = &client;
        conversation.answered = false;
        conversation.listening = std::make_unique<MailJob>(slave, mail.header.type);
        conversation.listening->timeout = std::chrono::duration_cast<Duration>(kListenAtMost);
        (void)submit(ctx_, *conversation.listening);  // a refusal ends the conversation
    }
    conversation.header = mail.header;
    conversation.until = now + kListen;
    return true;
}

void Router::submit_mail(std::unique_ptr<MailJob> job, Moment now) {
    job->begun = now;
    job->timeout = timeout_of(job->transaction);
    ++job->client->running;
    (void)submit(ctx_, *job);  // the state of the request shows a refusal
    running_.push_back(std::move(job));
}

void Router::answer_for_master(Client& client, const Mail& mail, Moment now) {
    if (mail.header.type != MailboxType::coe)
        return reply_error(&client, mail.header, MailboxErrorCode::unsupported_protocol, now);
    const auto answer = objects_.answer(mail.data);
    if (answer.refusal) return reply_error(&client, mail.header, *answer.refusal, now);
    for (const auto& data : answer.mails) reply(&client, mail.header, data, now);
}

void Router::expire_waiting(Moment now) {
    for (Client* client : clients_)
        std::erase_if(client->waiting, [&](const Client::Waiting& each) {
            if (now - each.since <= settings_.reply_timeout) return false;
            reply_error(client, each.mail.header, MailboxErrorCode::service_in_work, now);
            return true;
        });
}

void Router::refuse_all_waiting(Moment now) {
    for (Client* client : clients_)
        for (auto all = std::exchange(client->waiting, {}); const auto& each : all)
            reply_error(client, each.mail.header, MailboxErrorCode::no_more_memory, now);
}

}  // namespace margay::gateway
