#include "common/slave_eeprom.hpp"

#include "common/slave_report.hpp"

#include <margay/margay.hpp>

namespace margay::samples {

std::string SlaveEeprom::read(std::uint32_t word, MutableBytes into) {
    const auto done = read_sii(ctx_, position_, word, into);
    return done ? std::string() : sentence(done.error());
}

// Writes one word at a time. Thus each counted word was read back, and an address above 16 bits is correct in the
// error text.
Eeprom::Written SlaveEeprom::write(std::uint32_t word, Bytes octets) {
    Written written;
    for (; !octets.empty(); octets = octets.subspan(2), ++written.words) {
        const auto done = write_sii(ctx_, position_, word + static_cast<std::uint32_t>(written.words), octets.first(2));
        if (!done) {
            written.error = sentence(done.error());
            break;
        }
    }
    return written;
}

}  // namespace margay::samples
