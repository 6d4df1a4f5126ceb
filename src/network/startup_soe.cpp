// Start-up commands of SoE.
#include "mailbox/soe.hpp"
#include "network/startup_mail.hpp"

namespace margay {
namespace {

Task<Result<>> send_parameter(MailboxChannel& channel, const StartupCommand& command, const MailPatience& patience) {
    const SoeTarget target{.idn = Idn{command.index}, .drive = command.subindex};
    if (command.kind == StartupCommand::Kind::execute_parameter)
        co_return co_await required(soe_execute(channel, target, patience));
    co_return co_await required(soe_write(channel, target, command.octets(), patience));
}

}  // namespace

constinit const detail::StartupMail detail::kSoeStartup{
    .protocol = mailbox_protocol::kSoE, .type = MailboxType::soe, .valid = nullptr, .send = send_parameter};

}  // namespace margay
