// The protocols of start-up commands by mailbox other than CoE (StartupCommand::mail). Each is linked only with the
// commands that name it.
#pragma once

#include "mailbox/channel.hpp"

#include <margay/startup_mail.hpp>

namespace margay {

struct detail::StartupMail {
    std::uint16_t protocol;  // mailbox_protocol
    MailboxType type;
    // For a command that is a message: whether the answer of a slave contains only a result.
    bool (*valid)(Bytes message);
    // Executes a valid command, which outlives the task, and returns the error of the answer.
    Task<Result<>> (*send)(MailboxChannel& channel, const StartupCommand& command, const MailPatience& patience);
};

}  // namespace margay
