// The SII EEPROM of one slave, accessed through ESC registers 0x0500–0x050F (ETG.1000.4, "Slave information
// interface").
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <array>

namespace margay {

// An error that names a word of the EEPROM.
[[nodiscard]] inline Error sii_error(const Station& station, Errc code, Step step, std::uint32_t word) {
    Error error = station.error(code, step);
    error.set_word(word);
    return error;
}

// Reads ranges of the EEPROM with few accesses to the slave. One frame ("visit") fetches the block that was read and
// orders the next one. The reader measures how long the EEPROM needs for a block, so that a slow EEPROM is not polled
// too early.
class SiiReader {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    explicit SiiReader(const Station& station) : station_(station) {}
    SiiReader(const SiiReader&) = delete;
    SiiReader& operator=(const SiiReader&) = delete;

    // Reads words from `word` on. `into` has a whole number of words. `then` is the word that the caller reads next, if
    // known: its block is ordered ahead. The reader and `into` outlive the task. While an EEPROM stores a word it
    // acknowledges no command. A read that is not acknowledged is repeated every 0.5 ms until 100 ms are over, and at
    // least three times. error().word() is the word that could not be read. The range must end at or before
    // word kNone.
    [[nodiscard]] Task<Result<>> read(std::uint32_t word, MutableBytes into, std::uint32_t then = kNone);

    [[nodiscard]] Arena& arena() { return station_.arena(); }
    [[nodiscard]] const Station& station() const { return station_; }

  private:
    // What one visit read.
    struct Visit {
        std::uint16_t status = 0;
        std::uint32_t word = 0;
        std::array<std::byte, 8> data{};
    };
    class VisitAwaiter;

    [[nodiscard]] bool cached(std::uint32_t word) const {
        return block_word_ != kNone && word >= block_word_ && word - block_word_ < block_words_;
    }
    [[nodiscard]] std::uint32_t block_after(std::uint32_t word, std::uint32_t end, std::uint32_t then) const;
    [[nodiscard]] bool accept(const Visit& visit, std::uint32_t ordered_ahead, Time sent);
    void note_busy(Time sent);
    void note_ready(Time sent);
    [[nodiscard]] Duration between() const;
    [[nodiscard]] Error failure(Errc code, std::uint32_t word) const {
        return sii_error(station_, code, Step::read_sii, word);
    }

    Station station_;
    std::uint32_t block_word_ = kNone;  // first word of the cached block
    std::uint32_t block_words_ = 4;     // block size of the ESC: 4 words or 2
    std::array<std::byte, 8> block_{};
    std::uint32_t ordered_ = kNone;           // the word whose read command the ESC is executing
    Time ordered_at_ = Time::min();           // when the visit that ordered it was sent
    Duration known_busy_{0};                  // a visit this long after the order was too early
    Duration known_ready_ = Duration::max();  // a visit this long after the order was not too early
    Duration wait_{0};                        // from an order to the next visit
    bool idle_ = false;                       // it is certain that no command is being executed
    // The next visit will probably find the block, so it may order the next block.
    bool sure_ = false;
    std::uint8_t nacks_ = 0;
};

// Writes words. Each word is written, waited for and read back. A write that is not acknowledged is repeated every 0.5
// ms, up to 100 ms a word and at least three times: slow EEPROMs need 10 ms for a word, and some clear "busy" long
// before the word is stored.
//
// The order of the words protects the slave against an interruption after any word. Words 0x08 and up are written
// first, in rising order. The configuration area (words 0x00–0x07, which the ESC loads at power-up) is written last:
// only the words that differ, and in an order in which no mixture of old and new words has a right checksum
// (wire/sii_area.hpp). When a word of the area fails, this word and the words of the area written before get their old
// values again. Only a loss of power or connection between the first and the last changed word of the area leaves a
// wrong checksum: the ESC reports it (0x0502 bit 11) and does not load the area. No order of words avoids this: writing
// a single word to a right area makes its checksum wrong, unless the change has a checksum of zero.
//
// `reason` (may be nullptr) is called before each word from 0x08 on and before the configuration area: an error code
// other than none ends the write there with this code. The write of the area itself is not ended: it would leave a
// wrong checksum.
//
// On any error, error().word() is the word that may not be written. The range must end at or before SiiReader::kNone.
using ReasonToEnd = Errc (*)(void* user, Time now);
[[nodiscard]] Task<Result<>> sii_write(Station station, std::uint32_t word, Bytes data, ReasonToEnd reason = nullptr,
                                       void* user = nullptr);

// Assigns the SII interface to the master, or offers it to the slave's PDI (which needs it for INIT to PREOP).
[[nodiscard]] Task<Result<>> sii_assign(Station station, bool to_pdi);

}  // namespace margay
