// Routes the messages of all clients to the slaves and the replies back. Used by one thread, with time as an argument
// and without sockets.
#pragma once

#include "gateway/client.hpp"
#include "gateway/mail_job.hpp"
#include "gateway/master_objects.hpp"
#include "gateway/slave_table.hpp"

#include <margay/gateway/mailbox_gateway.hpp>

#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace margay::gateway {

class Router {
  public:
    struct Counts {
        std::atomic<std::uint64_t> messages{0}, replies{0}, errors{0}, lost{0};
    };

    Router(Context& ctx, const MailboxGatewaySettings& settings);
    // Call it in the thread of the owner, or while the owner polls.
    ~Router() = default;
    Router(const Router&) = delete;
    Router& operator=(const Router&) = delete;

    void add(Client& client) { clients_.push_back(&client); }
    // Call it when the client has closed its connection: its requests are cancelled, and their replies are dropped.
    void remove(Client& client);
    // Whether a message of the client waits or is executed, or one of its conversations has not ended.
    [[nodiscard]] bool uses(const Client& client) const;
    // Whether the client may send another message.
    [[nodiscard]] bool has_room(const Client& client) const {
        return client.waiting.size() < settings_.waiting && client.takes_replies();
    }

    void receive(Client& client, Mail mail, Moment now);
    // Refuses a message because there is no place for it. The client need not be one that was added.
    void refuse(Client& client, const Mail& mail, Moment now);
    void step(Moment now);
    // The time after which step() must be called, if no message comes from a client before.
    [[nodiscard]] std::chrono::nanoseconds patience(Moment now) const;

    [[nodiscard]] const Counts& counts() const { return counts_; }

  private:
    using Key = std::pair<std::uint16_t, wire::MailboxType>;
    // Messages that belong together, for example the segments of an object: no other client comes between them.
    struct Conversation {
        Client* client = nullptr;
        Moment until{};
        bool over = false;             // the slave has sent the last packet of a file
        bool answered = false;         // `listening` has received mail
        wire::MailboxHeader header{};  // of the last message
        std::unique_ptr<MailJob> listening{};
    };
    using Conversations = std::map<Key, Conversation>;

    // router_start.cpp
    void start_waiting(Moment now);
    [[nodiscard]] bool start_one(Client& client, Moment now);
    [[nodiscard]] bool start(Client& client, Client::Waiting& message, Moment now);
    [[nodiscard]] bool may_converse(Client& client, const Key& key, Moment now);
    [[nodiscard]] bool has_slot(const Client& client) const;
    [[nodiscard]] bool listen(Client& client, const SlaveFacts& slave, const Mail& mail, Moment now);
    void submit_mail(std::unique_ptr<MailJob> job, Moment now);
    void answer_for_master(Client& client, const Mail& mail, Moment now);
    void expire_waiting(Moment now);
    void refuse_all_waiting(Moment now);

    // router.cpp
    void look_after(std::unique_ptr<MailJob>& job, Moment now);
    void finish(std::unique_ptr<MailJob> job, Moment now);
    void fail(MailJob& job, wire::MailboxErrorCode code, Moment now);
    void deliver_earlier(MailJob& job, Moment now);
    void converse(MailJob& job, bool on, Moment now);
    void end(Conversation& conversation);
    void look_after_conversations(Moment now);
    void put_away(std::unique_ptr<MailJob> job);
    void reply(Client* client, wire::MailboxHeader header, Bytes data, Moment now);
    void reply_error(Client* client, wire::MailboxHeader header, wire::MailboxErrorCode code, Moment now);
    void refuse_change(Client& client, const Mail& mail, const Transaction& transaction, Moment now);
    [[nodiscard]] Duration timeout_of(const Transaction& transaction) const;

    Context& ctx_;
    MailboxGatewaySettings settings_;
    SlaveTable table_;
    MasterObjects objects_;
    std::vector<Client*> clients_{};
    std::size_t next_ = 0;  // the client whose turn is first
    std::vector<std::unique_ptr<MailJob>> running_{};
    std::vector<std::unique_ptr<MailJob>> ending_{};  // cancelled requests that are not over yet
    Conversations conversations_{};
    Counts counts_{};
};

}  // namespace margay::gateway
