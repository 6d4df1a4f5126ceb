// Writes the SII EEPROM: see sii_access.hpp.
#include "station/sii_access.hpp"
#include "wire/sii_area.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace control = wire::sii_control;
namespace reg = wire::reg;
namespace sii = wire::sii;

constexpr Duration kWordTimeout = std::chrono::milliseconds(100);  // real EEPROMs need up to 10 ms
constexpr Duration kPause = std::chrono::microseconds(500);        // between two reads of the status, and after a NACK
constexpr int kNackTries = 3;                                      // at least, whatever time passes between two polls

using Word = std::array<std::byte, sii::kWordBytes>;

// Waits until the interface is ready and returns its status.
Task<Result<std::uint16_t>> wait_ready(Station station, Time give_up) {
    for (;;) {
        const Time sent = station.engine.now();  // for the reason, see SiiReader::read()
        const auto status =
            co_await required(::margay::read<std::uint16_t>(station, reg::kSiiControl, Step::write_sii));
        if ((status & control::kBusy) == 0) co_return status;
        if (sent >= give_up) co_return station.error(Errc::sii_busy, Step::write_sii);
        co_await station.engine.sleep_for(kPause);
    }
}

// Executes one write command: waits until ready, writes, waits until ready again. Returns the status after the command.
Task<Result<std::uint16_t>> order_write(Station station, std::uint32_t word, Word data, Time give_up) {
    co_await required(wait_ready(station, give_up));
    std::array<std::byte, 8> bytes{};  // control, address and data in one datagram, so that the command uses this data
    store_le<std::uint16_t>(bytes, 0, control::kCommandWrite | control::kWriteEnable);
    store_le<std::uint32_t>(bytes, 2, word);
    std::copy(data.begin(), data.end(), bytes.begin() + 6);
    co_await required(write_bytes(station, reg::kSiiControl.address, bytes, Step::write_sii));
    co_return co_await required(wait_ready(station, give_up));
}

// Repeats the command until the EEPROM acknowledges it: the EEPROM may still be storing the previous word.
Task<Result<>> write_until_acknowledged(Station station, std::uint32_t word, Word data) {
    const Time give_up = station.engine.now() + kWordTimeout;
    for (int tries = 1;; ++tries) {
        const auto status = co_await required(order_write(station, word, data, give_up));
        if ((status & control::kWriteEnableError) != 0)
            co_return station.error(Errc::sii_write_denied, Step::write_sii);
        if ((status & control::kMissingAcknowledge) == 0) co_return Nothing{};
        if (tries >= kNackTries && station.engine.now() >= give_up)
            co_return station.error(Errc::sii_nack, Step::write_sii);
        co_await station.engine.sleep_for(kPause);
    }
}

// Writes one word, waits and reads it back. Each error contains the word.
Task<Result<>> write_word(Station station, std::uint32_t word, Word data) {
    auto result = co_await write_until_acknowledged(station, word, data);
    Word back{};
    if (result) {
        SiiReader reader(station);
        auto read_back = co_await reader.read(word, back);
        result = read_back;
    }
    Error error = result.error();
    if (result && back != data) {
        error = station.error(Errc::sii_verify, Step::write_sii);
        error.expected = load_le<std::uint16_t>(data);
        error.actual = load_le<std::uint16_t>(back);
    }
    if (error.code == Errc::none) co_return Nothing{};
    error.step = Step::write_sii;
    error.set_word(word);
    co_return error;
}

Word word_octets(std::uint16_t value) {
    Word octets{};
    store_le(MutableBytes(octets), 0, value);
    return octets;
}

bool by_eeprom(Errc code) {
    return code == Errc::sii_nack || code == Errc::sii_busy || code == Errc::sii_verify ||
           code == Errc::sii_write_denied;
}

// Writes the old values of the first `count` writes of the plan, the last one first. When the EEPROM does not store a
// word, the others are still written; when the slave itself does not answer, undo() ends.
Task<Result<>> undo(Station station, const sii::AreaPlan& plan, std::size_t count) {
    const auto writes = plan.writes().first(count);
    for (std::size_t n = count; n-- > 0;) {
        auto written = co_await write_word(station, writes[n].word, word_octets(writes[n].before));
        if (!written && !by_eeprom(written.error().code)) co_return written;
    }
    co_return Nothing{};
}

// Writes the part of `data` (from `word` on) that is in the configuration area.
Task<Result<>> write_area(Station station, std::uint32_t word, Bytes data) {
    std::array<std::byte, sii::kConfigurationBytes> old{};
    SiiReader reader(station);
    auto read = co_await reader.read(0, old);
    if (!read) {
        Error error = read.error();
        error.step = Step::write_sii;
        error.set_word(word);
        co_return error;
    }
    auto wanted = old;
    const std::size_t at = word * sii::kWordBytes;
    std::copy_n(data.begin(), std::min(data.size(), wanted.size() - at), wanted.begin() + static_cast<int>(at));
    const auto plan = sii::plan_area(old, wanted);
    for (std::size_t n = 0; n < plan.writes().size(); ++n) {
        const auto& write = plan.writes()[n];
        auto written = co_await write_word(station, write.word, word_octets(write.after));
        if (written) continue;
        // The caller needs the first error; a read returns the current words.
        co_await completion(undo(station, plan, n + 1));
        co_return written;
    }
    co_return Nothing{};
}

}  // namespace

Task<Result<>> sii_write(Station station, std::uint32_t word, Bytes data, ReasonToEnd reason, void* user) {
    const auto ends = [&]() { return reason == nullptr ? Errc::none : reason(user, station.engine.now()); };
    const auto end = word + static_cast<std::uint32_t>(data.size() / sii::kWordBytes);
    for (auto at = std::max(word, sii::word::kIdentity); at < end; ++at) {
        const Errc code = ends();
        if (code != Errc::none) co_return sii_error(station, code, Step::write_sii, at);
        const std::size_t offset = (at - word) * sii::kWordBytes;
        co_await required(write_word(station, at, {data[offset], data[offset + 1]}));
    }
    if (word >= std::min(end, sii::word::kIdentity)) co_return Nothing{};
    const Errc code = ends();
    if (code != Errc::none) co_return sii_error(station, code, Step::write_sii, word);
    co_return co_await required(write_area(station, word, data));
}

}  // namespace margay
