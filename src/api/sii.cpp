// The requests that read and write the SII EEPROM of a slave.
#include "station/sii_access.hpp"

#include "api/master.hpp"
#include "api/operation.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

// The end of the words that the request may access: the size of the EEPROM, if it is known and not ignored
// (`beyond_end`).
std::uint32_t end_word(const Slave& slave, bool beyond_end) {
    const auto words = static_cast<std::uint32_t>(slave.sii_bytes / 2);
    return words == 0 || beyond_end ? SiiReader::kNone : words;
}

// Checks the parameters: the SII is read and written in words, and not beyond its end.
template <class R>
Error check_words(Network& network, const R& r, Step step) {
    Error refused = check_slave(network, r.slave, step);
    refused.set_word(r.word);
    if (refused.code != Errc::none) return refused;
    refused = invalid(Argument::sii_size, step, r.slave);
    refused.set_word(r.word);
    if (r.data.empty() || r.data.size() % 2 != 0) return refused;
    const std::uint32_t end = end_word(network.slave(r.slave), r.beyond_end);
    if (r.word <= end && r.data.size() / 2 <= end - r.word) return {};
    refused = invalid(Argument::sii_words, step, r.slave);
    refused.expected = end;
    refused.set_word(std::max(r.word, end));
    return refused;
}

// An error of the assignment of the interface names the step and the first word of the request.
template <class R>
Error assign_error(Error error, const R& request, Step step) {
    error.step = step;
    error.set_word(request.word);
    return error;
}

}  // namespace

static Error check(Network& network, const SiiReadRequest& request) {
    return check_words(network, request, Step::read_sii);
}
static Error check(Network& network, const SiiWriteRequest& request) {
    const Error refused = check_words(network, request, Step::write_sii);
    return refused.code != Errc::none ? refused : check_same_slave(network, request.slave, Step::write_sii);
}

// Both sequences give the EEPROM back to the slave at the end, also after cancel() and when the timeout is over:
// without it some slaves refuse PREOP (AL status code 0x0050).
static Task<Result<>> run(Network& network, SiiReadRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assign_error(assigned.error(), request, Step::read_sii);
    SiiReader reader(station);
    Result<> read;
    constexpr std::size_t kPiece = 32;  // octets between two looks at the reason to end
    for (std::size_t at = 0; read && at < request.data.size(); at += kPiece) {
        const std::size_t octets = std::min(kPiece, request.data.size() - at);
        const auto word = request.word + static_cast<std::uint32_t>(at / 2);
        const bool last = at + octets == request.data.size();
        const std::uint32_t then = last ? SiiReader::kNone : word + static_cast<std::uint32_t>(octets / 2);
        read = co_await reader.read(word, request.data.subspan(at, octets), then);
        const Errc code = reason_to_end(request, network.engine.now());
        if (read && !last && code != Errc::none) read = sii_error(station, code, Step::read_sii, word);
    }
    auto given_back = co_await sii_assign(station, true);
    if (!read || given_back) co_return read;
    co_return assign_error(given_back.error(), request, Step::read_sii);
}

static Task<Result<>> run(Network& network, SiiWriteRequest& request) {
    const Station station = network.station(network.slave(request.slave));
    auto assigned = co_await sii_assign(station, false);
    if (!assigned) co_return assign_error(assigned.error(), request, Step::write_sii);
    struct Both {
        Network& network;
        SiiWriteRequest& request;
    } both{network, request};
    const auto reason = [](void* user, Time now) {
        Both& of = *static_cast<Both*>(user);
        const Error other = check_same_slave(of.network, of.request.slave, Step::write_sii);
        return other.code != Errc::none ? other.code : reason_to_end(of.request, now);
    };
    auto written = co_await sii_write(station, request.word, request.data, reason, &both);
    auto given_back = co_await sii_assign(station, true);
    if (!written || given_back) co_return written;
    co_return assign_error(given_back.error(), request, Step::write_sii);
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
