// Mailbox messages, put together to conversations.
#pragma once

#include "analyse/slave_tracks.hpp"
#include "wire/mailbox.hpp"

namespace margay::analyse {

// A conversation that is not over.
struct OpenConversation {
    Conversation facts{};
    std::vector<std::byte> data{};  // as far as kMostObject
    std::uint64_t announced = 0;    // octets of an SDO
    bool last_sent = false;         // the last octets are on their way
};

class MailWatch {
  public:
    MailWatch(Analysis& analysis, SlaveTracks& slaves) : analysis_(analysis), slaves_(slaves) {}
    void look(const Exchanged& e, SlaveTrack* slave);
    // Whether the datagram looks for mail; its working counter is 0 where there is none.
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
    [[nodiscard]] OpenConversation* open(const Mail& mail);
    OpenConversation& begin(const Mail& mail, Action action);
    void end(const Mail& mail, Outcome outcome, std::uint32_t code = 0, std::string reason = {});
    void close(std::size_t slave, wire::MailboxType type, Moment when, Outcome outcome);
    void append(OpenConversation& conversation, Bytes data);

    void take(const Mail& mail);
    void take_coe(const Mail& mail);
    void take_sdo_request(const Mail& mail);
    void take_sdo_response(const Mail& mail);
    void take_sdo_information(const Mail& mail);
    void take_description(const Mail& mail);
    void take_emergency(const Mail& mail);
    void take_foe(const Mail& mail);
    void take_soe(const Mail& mail);
    void take_aoe(const Mail& mail);
    void take_error(const Mail& mail);

    Analysis& analysis_;
    SlaveTracks& slaves_;
    std::map<std::pair<std::size_t, wire::MailboxType>, OpenConversation> open_{};
};

// Objects whose values tell the identity and the PDOs of a slave.
[[nodiscard]] bool is_kept_object(std::uint16_t index);
// The text up to the first zero, with '?' in place of what is not printable ASCII.
[[nodiscard]] std::string printable(Bytes octets);

}  // namespace margay::analyse
