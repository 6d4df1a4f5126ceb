// The requests that read and write the SII EEPROM of a slave.
#include "station/sii_access.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

#include <algorithm>

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

// Both sequences give the EEPROM back to the slave at the end, also after cancel() and when the timeout is over:
// without it some slaves refuse PREOP (AL status code 0x0050).
static Task<Result<>> run(Network& network, SiiReadRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    SiiReader reader(station);
    Result<> read;
    constexpr std::size_t kPiece = 128;  // octets between two looks at the reason to end
    for (std::size_t at = 0; read && at < request.data.size(); at += kPiece) {
        const std::size_t octets = std::min(kPiece, request.data.size() - at);
        const auto word = request.word + static_cast<std::uint32_t>(at / 2);
        const bool last = at + octets == request.data.size();
        const std::uint32_t then = last ? SiiReader::kNone : word + static_cast<std::uint32_t>(octets / 2);
        read = co_await reader.read(word, request.data.subspan(at, octets), then);
        const Errc code = reason_to_end(request, network.engine.now());
        if (read && !last && code != Errc::none)
            read = station.error(code, Step::read_sii, static_cast<std::uint16_t>(word));
    }
    auto given_back = co_await sii_assign(station, true);
    co_return read ? given_back : read;
}

static Task<Result<>> run(Network& network, SiiWriteRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assigned;
    const auto reason = [](void* user, Time now) { return reason_to_end(*static_cast<SiiWriteRequest*>(user), now); };
    auto written = co_await sii_write(station, request.word, request.data, reason, &request);
    auto given_back = co_await sii_assign(station, true);
    co_return written ? given_back : written;
}

static constexpr OperationDescription kRead = describe_operation<SiiReadRequest, check, run>(
    Operation::read_sii, Step::read_sii, Needs::its_slave, Ends::by_itself, Timing::by_sequence_alone);
static constexpr OperationDescription kWrite = describe_operation<SiiWriteRequest, check, run>(
    Operation::write_sii, Step::write_sii, Needs::its_slave, Ends::by_itself, Timing::by_sequence_alone);
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
