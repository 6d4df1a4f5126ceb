// EoE requests over a mailbox channel: IP parameters and address filters. One at a time for each slave.
#pragma once

#include "mailbox/channel.hpp"
#include "wire/eoe.hpp"

#include <margay/eoe.hpp>

namespace margay {

// One request: the octets behind its header, and the parameters that the response has.
struct EoeCall {
    wire::eoe::Type type{};  // of the request; the response has the next number
    Step step = Step::none;
    const EoeIp* set_ip = nullptr;
    bool compact = false;
    const EoeFilter* set_filter = nullptr;
    Bytes parameters{};  // in place of set_ip and set_filter: as they are on the wire
    EoeIp* got_ip = nullptr;
    EoeFilter* got_filter = nullptr;
};

// The part of a request in its exchange, without bus and time.
class EoeClient final : public MailClient {
  public:
    explicit EoeClient(const EoeCall& call) : call_(call) {}
    // Before the request is sent again.
    void restart() { error_ = {}; }
    std::size_t compose(MutableBytes data) override;
    Taken accept(const wire::MailboxMessage& mail) override;
    // After Taken::all: the error of the answer. Slave and step are not set.
    [[nodiscard]] const Error& error() const { return error_; }

  private:
    [[nodiscard]] bool take(Bytes parameters);

    const EoeCall& call_;
    Error error_;
};

// Executes the request. The objects to which `call` points outlive the task.
[[nodiscard]] Task<Result<>> eoe_call(MailboxChannel& channel, EoeCall call, MailPatience patience);

// Exchanges the frames of `port` with its slave, without end. The port outlives the task.
[[nodiscard]] Task<Result<>> eoe_relay(MailboxChannel& channel, EoePort& port);

}  // namespace margay
