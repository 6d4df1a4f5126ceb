#include "common/slave_eeprom.hpp"

#include "common/slave_report.hpp"

#include <margay/margay.hpp>

namespace margay::samples {

namespace {

// The size word of an EEPROM that is repaired may be wrong, so the words beyond it are accessed too.
template <class Request, class Octets>
Result<> access(Context& ctx, std::uint16_t slave, std::uint32_t word, Octets octets) {
    Request request;
    request.slave = slave;
    request.word = word;
    request.data = octets;
    request.beyond_end = true;
    const auto submitted = submit(ctx, request);
    return submitted ? wait(ctx, request) : submitted;
}

}  // namespace

std::string SlaveEeprom::read(std::uint32_t word, MutableBytes into) {
    const auto done = access<SiiReadRequest>(ctx_, number_, word, into);
    return done ? std::string() : sentence(done.error());
}

// Writes one word at a time. Thus each counted word was read back.
Eeprom::Written SlaveEeprom::write(std::uint32_t word, Bytes octets) {
    Written written;
    for (; !octets.empty(); octets = octets.subspan(2), ++written.words) {
        const auto done =
            access<SiiWriteRequest>(ctx_, number_, word + static_cast<std::uint32_t>(written.words), octets.first(2));
        if (!done) {
            written.error = sentence(done.error());
            break;
        }
    }
    return written;
}

}  // namespace margay::samples
