// The request for one datagram of any command.
#include <margay/datagram.hpp>

#include "api/master.hpp"
#include "api/operation.hpp"
#include "station/register_access.hpp"

#include <margay/margay.hpp>

namespace margay {
namespace {

constexpr Step kStep = Step::exchange_datagram;

bool only_sends(DatagramCommand command) {
    return command == DatagramCommand::apwr || command == DatagramCommand::fpwr || command == DatagramCommand::bwr ||
           command == DatagramCommand::lwr;
}

wire::DatagramAddress address_of(const DatagramRequest& request) {
    if (wire::is_logical(static_cast<wire::Command>(request.command))) return request.logical;
    return {request.adp, request.ado};
}

}  // namespace

static Error check(Network&, const DatagramRequest& request) {
    const bool known = static_cast<std::uint8_t>(request.command) <= wire::kLastCommand;
    if (known && !request.data.empty() && request.data.size() <= wire::kMaxDatagramData) return {};
    return invalid(Argument::register_octets, kStep, 0, request.ado);
}

static Task<Result<>> run(Network& network, DatagramRequest& request) {
    const auto command = static_cast<wire::Command>(request.command);
    const Repeat repeat = request.repeat ? Repeat::yes : Repeat::no;
    Link& link = network.engine.link();
    Reply reply;
    if (only_sends(request.command)) {
        Datagram datagram(link, command, address_of(request), Bytes(request.data), repeat);
        reply = co_await datagram;
    } else {
        Datagram datagram(link, command, address_of(request), MutableBytes(request.data), repeat);
        reply = co_await datagram;
    }
    request.wkc = reply.ok() ? reply.wkc : std::uint16_t{0};
    Error error{.code = reply.errc, .step = kStep, .index = request.ado};
    error.detail = reply.ok() ? 0 : reply.detail();
    co_return error;
}

static constexpr OperationDescription kDatagram =
    describe_operation<DatagramRequest, check, run>(Operation::exchange_datagram, kStep);
DatagramRequest::DatagramRequest() : Request(kDatagram) {}

Result<std::uint16_t> exchange_datagram(Context& ctx, DatagramCommand command, std::uint16_t adp, std::uint16_t ado,
                                        std::span<std::byte> data, Duration timeout) {
    DatagramRequest request;
    request.command = command;
    request.adp = adp;
    request.ado = ado;
    request.data = data;
    request.timeout = timeout;
    return submit_and_wait(ctx, request, request.wkc);
}

}  // namespace margay
