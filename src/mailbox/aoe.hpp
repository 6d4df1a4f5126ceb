// AoE commands over a mailbox channel: any number at a time for each slave, distinguished by their invoke IDs.
#pragma once

#include "mailbox/channel.hpp"
#include "wire/aoe.hpp"

namespace margay {

// One command. The device answers to `source`. The data of the request is `head`, then `data`. The data of the response
// is the result, then, if `counted`, the number of octets, then the octets, which go to `into`.
struct AoeCall {
    wire::aoe::Command command{};
    Step step = Step::none;
    std::uint8_t head_bytes = 0;
    bool counted = false;
    AoeAddress target{};
    AoeAddress source{};
    std::array<std::byte, wire::aoe::kNotificationBytes> head{};
    Bytes data{};
    MutableBytes into{};
};

// The client of a command in its exchange, independent of bus and time.
class AoeClient final : public MailClient {
  public:
    // `call` outlives the client.
    AoeClient(const AoeCall& call, std::uint32_t invoke_id) : call_(call), invoke_id_(invoke_id) {}
    std::size_t compose(MutableBytes data) override;
    Taken accept(const wire::MailboxMessage& mail) override;
    // After Taken::all: the error of the answer. Slave and step are not set.
    [[nodiscard]] const Error& error() const { return error_; }
    // Octets that the answer has brought for `into`, also if they did not fit.
    [[nodiscard]] std::size_t bytes() const { return bytes_; }

  private:
    [[nodiscard]] Error take(Bytes response);
    [[nodiscard]] Error refusal(Errc code, std::uint32_t detail) const;

    const AoeCall& call_;
    std::uint32_t invoke_id_;
    std::size_t bytes_ = 0;
    Error error_;
};

// The invoke id of a command that is no request of the queue: a start-up command, or a command of a hook. The number
// depends on the time, so that the answer to a command that was given up is not mistaken for the answer to the next
// command. Requests of the queue use their tickets as invoke ids, which count from 1.
[[nodiscard]] std::uint32_t aoe_invoke_id(Time now);

// Executes the command and returns the number of octets in `call.into`. `call` outlives the task. Errors: aoe_error
// (detail: the code in the AoE header), aoe_result (detail: the result), protocol, capacity, timeout …
[[nodiscard]] Task<Result<std::size_t>> aoe_call(MailboxChannel& channel, const AoeCall& call, std::uint32_t invoke_id,
                                                 const MailPatience& patience);

}  // namespace margay
