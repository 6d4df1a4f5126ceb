// The requests that read and write the SII EEPROM of a slave.
#include "station/sii_access.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

namespace margay {
namespace {

// Checks the parameters: the SII is read and written in words.
Error check_words(Network& network, std::uint16_t slave, std::size_t octets, Step step) {
    const Error refused = check_slave(network, slave, step);
    if (refused.code != Errc::none || octets % 2 == 0) return refused;
    return {.code = Errc::invalid_argument, .step = step, .slave = slave};
}

}  // namespace

static Error check(Network& network, const SiiReadRequest& request) {
    return check_words(network, request.slave, request.data.size(), Step::read_sii);
}
static Error check(Network& network, const SiiWriteRequest& request) {
    return check_words(network, request.slave, request.data.size(), Step::write_sii);
}

// Gives the EEPROM back to the slave at the end: without it some slaves refuse PREOP (AL status code 0x0050).
static Task<Result<>> run(Network& network, SiiReadRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    SiiReader reader(station);
    auto read = co_await reader.read(request.word, request.data);
    auto given_back = co_await sii_assign(station, true);
    co_return read ? given_back : read;
}

static Task<Result<>> run(Network& network, SiiWriteRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    auto written = co_await sii_write(station, request.word, request.data);
    auto given_back = co_await sii_assign(station, true);
    co_return written ? given_back : written;
}

static constexpr OperationDescription kRead =
    describe_operation<SiiReadRequest, check, run>(Operation::read_sii, Step::read_sii, Needs::its_slave);
static constexpr OperationDescription kWrite =
    describe_operation<SiiWriteRequest, check, run>(Operation::write_sii, Step::write_sii, Needs::its_slave);
SiiReadRequest::SiiReadRequest() : SlaveRequest(kRead) {}
SiiWriteRequest::SiiWriteRequest() : SlaveRequest(kWrite) {}

Result<> read_sii(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<std::byte> data) {
    SiiReadRequest request;
    request.slave = slave;
    request.word = word;
    request.data = data;
    return submit_and_wait(ctx, request);
}

Result<> write_sii(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<const std::byte> data) {
    SiiWriteRequest request;
    request.slave = slave;
    request.word = word;
    request.data = data;
    return submit_and_wait(ctx, request);
}

}  // namespace margay
