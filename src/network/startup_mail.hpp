// The protocols of start-up commands that are messages (StartupCommand::mail). Each is linked only with the commands
// that name it.
#pragma once

#include "mailbox/channel.hpp"

#include <margay/startup_mail.hpp>

namespace margay {

struct detail::StartupMail {
    std::uint16_t protocol;  // mailbox_protocol
    MailboxType type;
    // Whether a slave answers the message with a result alone.
    bool (*valid)(Bytes message);
    // Sends a valid message, which outlives the task, and returns the error of the answer.
    Task<Result<>> (*send)(MailboxChannel& channel, Bytes message, const MailPatience& patience);
};

}  // namespace margay
