// Requests for registers of an ESC.
#include "api/master.hpp"
#include "api/operation.hpp"
#include "station/register_access.hpp"

#include <margay/margay.hpp>

namespace margay {
namespace {

template <class R>
Error check_registers(Network& network, const R& r, Step step) {
    Error refused = check_slave(network, r.slave, step);
    refused.index = r.address;
    if (refused.code != Errc::none) return refused;
    if (is_register_range(r.address, r.data.size())) return {};
    return invalid(Argument::register_octets, step, r.slave, r.address);
}

Result<> result_of(const Station& station, const Datagram& datagram, Step step, std::uint16_t address) {
    const Error error = error_of_reply(station, datagram.reply(), step, address);
    return error.code == Errc::none ? Result<>() : Result<>(error);
}

}  // namespace

static Error check(Network& network, const RegisterReadRequest& request) {
    return check_registers(network, request, Step::read_register);
}
static Error check(Network& network, const RegisterWriteRequest& request) {
    Error refused = check_registers(network, request, Step::write_register);
    if (refused.code != Errc::none) return refused;
    refused = check_same_slave(network, request.slave, Step::write_register);
    refused.index = request.address;
    return refused;
}

static Task<Result<>> run(Network& network, RegisterReadRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    Datagram datagram(station.engine.link(), wire::Command::FPRD, {station.address, request.address}, request.data);
    co_await datagram;
    co_return result_of(station, datagram, Step::read_register, request.address);
}

static Task<Result<>> run(Network& network, RegisterWriteRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    Datagram datagram(station.engine.link(), wire::Command::FPWR, {station.address, request.address}, request.data);
    co_await datagram;
    co_return result_of(station, datagram, Step::write_register, request.address);
}

static constexpr OperationDescription kRead =
    describe_operation<RegisterReadRequest, check, run>(Operation::read_register, Step::read_register);
static constexpr OperationDescription kWrite =
    describe_operation<RegisterWriteRequest, check, run>(Operation::write_register, Step::write_register);
RegisterReadRequest::RegisterReadRequest() : SlaveRequest(kRead) {}
RegisterWriteRequest::RegisterWriteRequest() : SlaveRequest(kWrite) {}

Result<> read_register(Context& ctx, std::uint16_t slave, std::uint16_t address, std::span<std::byte> data) {
    RegisterReadRequest request;
    request.slave = slave;
    request.address = address;
    request.data = data;
    return submit_and_wait(ctx, request);
}

Result<> write_register(Context& ctx, std::uint16_t slave, std::uint16_t address, std::span<const std::byte> data) {
    RegisterWriteRequest request;
    request.slave = slave;
    request.address = address;
    request.data = data;
    return submit_and_wait(ctx, request);
}

}  // namespace margay
