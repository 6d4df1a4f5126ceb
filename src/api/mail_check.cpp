// The check of requests whose message must fit into one mailbox.
#include "api/mail.hpp"

namespace margay {

Error check_message(Network& network, std::size_t bytes, const Error& where) {
    const std::size_t most = network.mailbox(network.slave(where.slave)).send_room();
    if (bytes <= most) return {};
    Error error = invalid(Argument::mail_size, where.step, where.slave);
    error.expected = static_cast<std::uint32_t>(most);
    error.actual = static_cast<std::uint32_t>(bytes);
    return error;
}

}  // namespace margay
