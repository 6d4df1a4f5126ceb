// Combines mailbox messages to conversations.
#pragma once

#include "analyse/sent_mail.hpp"
#include "analyse/slave_tracks.hpp"
#include "wire/mailbox.hpp"

namespace margay::analyse {

// A conversation that has not ended.
struct OpenConversation {
    Conversation facts{};
    std::vector<std::byte> data{};          // at most kMostObject octets
    std::uint64_t announced = 0;            // octets of an SDO
    std::optional<std::uint32_t> packet{};  // FoE: the number of the last packet
    bool begun = false;                     // the first answer has come
    bool last_sent = false;                 // the last octets were sent
    bool superseded = false;                // the next request was sent before the answer came
};

class MailWatch {
  public:
    MailWatch(Analysis& analysis, SlaveTracks& slaves) : analysis_(analysis), slaves_(slaves) {}
    // Call it for each datagram when its frame is sent.
    void note_sent(const Exchanged& request) { sent_.note(request); }
    // Call it for each datagram when its frame has come back, or was given up. `slave`: nullptr if it is not known.
    void look(const Exchanged& e, SlaveTrack* slave);
    // Whether the datagram looks for mail. Its working counter is 0 if there is no mail.
    [[nodiscard]] static bool is_look(const Exchanged& e, const SlaveTrack* slave);
    void finish(Moment end);

    static constexpr std::size_t kMostObject = 2048;  // octets

  private:
    struct Mail {
        Moment when{};
        SlaveTrack& slave;
        bool sent;  // to the slave
        wire::MailboxHeader header{};
        Bytes data{};
        std::size_t room = 0;  // octets of data that fit into the mailbox
    };
    using Key = std::pair<std::size_t, wire::MailboxType>;
    // The youngest conversation is the last one. The others are superseded, but a late answer may belong to one of
    // them.
    using Conversations = std::vector<OpenConversation>;

    // The youngest conversation of the slave in this protocol.
    [[nodiscard]] OpenConversation* open(const Mail& mail);
    // The youngest conversation to which the answer belongs; nullptr: none.
    template <class Belongs>
    [[nodiscard]] OpenConversation* open(const Mail& mail, Belongs belongs);
    OpenConversation& begin(const Mail& mail, Action action);
    void end(const Mail& mail, OpenConversation& conversation, Outcome outcome, std::uint32_t code = 0,
             std::string reason = {});
    void close(Conversations& conversations, std::size_t at, Moment when, Outcome outcome);
    void close_all(std::map<Key, Conversations>::iterator of, Moment when);
    void append(OpenConversation& conversation, Bytes data);

    // Processes a message that a slave has accepted, or has sent. `mailbox`: the octets of the mailbox.
    void pass(Moment when, SlaveTrack& slave, bool sent, Bytes data, std::size_t mailbox);
    void take(const Mail& mail);
    void take_coe(const Mail& mail);
    void take_sdo_request(const Mail& mail);
    void take_sdo_response(const Mail& mail);
    void take_sdo_information(const Mail& mail);
    void take_description(const Mail& mail, OpenConversation& conversation);
    void take_emergency(const Mail& mail);
    void take_foe(const Mail& mail);
    void take_soe(const Mail& mail);
    void take_aoe(const Mail& mail);
    void take_error(const Mail& mail);

    Analysis& analysis_;
    SlaveTracks& slaves_;
    SentMail sent_{};
    std::map<Key, Conversations> open_{};
};

// Whether the values of the object contain the identity or the PDOs of a slave.
[[nodiscard]] bool is_kept_object(std::uint16_t index);
// Keeps the values that the conversation has transferred. Complete access transfers each value of the object.
void keep_object(SlaveTrack& slave, const Conversation& facts, Bytes data);
// The text up to the first zero, as wire::sii::to_utf8() converts it.
[[nodiscard]] std::string printable(Bytes octets);

}  // namespace margay::analyse
