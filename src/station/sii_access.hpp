// The SII EEPROM of one slave, through ESC registers 0x0500–0x050F (ETG.1000.4, "Slave information
// interface").
#pragma once

#include "station/register_access.hpp"
#include "util/task.hpp"

#include <array>

namespace margay {

// Reads ranges of the EEPROM with as few visits to the slave as can be: while one block is fetched from a
// visit, the next one is asked for in the same frame; and how long the EEPROM takes is learned, so that a
// slow one is not asked in vain.
class SiiReader {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    explicit SiiReader(const Station& station) : station_(station) {}
    SiiReader(const SiiReader&) = delete;
    SiiReader& operator=(const SiiReader&) = delete;

    // Reads from `word` on. `into` holds a whole number of words. `then` is the word that will be asked for
    // next, if that is known: it is ordered ahead. The reader and `into` outlive the task.
    // An EEPROM that stores a word acknowledges nothing meanwhile: a read that is not acknowledged is repeated every
    // 0.5 ms until 100 ms are over, and three times at least. error().index is the word that could not be read.
    [[nodiscard]] Task<Result<>> read(std::uint32_t word, MutableBytes into, std::uint32_t then = kNone);

    [[nodiscard]] Arena& arena() { return station_.arena(); }
    [[nodiscard]] const Station& station() const { return station_; }

  private:
    // What one visit found.
    struct Visit {
        std::uint16_t status = 0;
        std::uint32_t word = 0;
        std::array<std::byte, 8> data{};
    };
    class VisitAwaiter;

    [[nodiscard]] bool cached(std::uint32_t word) const {
        return block_word_ != kNone && word >= block_word_ && word < block_word_ + block_words_;
    }
    [[nodiscard]] std::uint32_t block_after(std::uint32_t word, std::uint32_t end, std::uint32_t then) const;
    [[nodiscard]] bool accept(const Visit& visit, std::uint32_t ordered_ahead, Time sent);
    void note_busy(Time sent);
    void note_ready(Time sent);
    [[nodiscard]] Duration between() const;
    [[nodiscard]] Error failure(Errc code, std::uint32_t word) const {
        return station_.error(code, Step::read_sii, static_cast<std::uint16_t>(word));
    }

    Station station_;
    std::uint32_t block_word_ = kNone;  // the block that is cached
    std::uint32_t block_words_ = 4;     // what the ESC reads at a time: 4 words or 2
    std::array<std::byte, 8> block_{};
    std::uint32_t ordered_ = kNone;           // the read command that the ESC is carrying out
    Time ordered_at_ = Time::min();           // when the visit that ordered it was sent
    Duration known_busy_{0};                  // a visit so long after the order was too early
    Duration known_ready_ = Duration::max();  // and one so long after it was not
    Duration wait_{0};                        // from an order to the next visit
    bool idle_ = false;                       // no command is under way, surely
    bool sure_ = false;                       // the next visit will find the block: another one may be ordered along
    std::uint8_t nacks_ = 0;
};

// Writes words, each one waited for and read back. What is not acknowledged is repeated every 0.5 ms, up to 100 ms a
// word and three times at least: slow parts take 10 ms for a word, and some leave "busy" long before the word is
// stored.
//
// The order of the words protects the slave against an end at any word. Words 0x08 and up go first, in rising order.
// The configuration area (words 0x00–0x07, which the ESC loads at power-up) goes last: only the words that differ, and
// in an order in which no mixture of old and new words has a right checksum (wire/sii_area.hpp). When a word of the
// area fails, the words of the area that are written already, and the failed one, get their old values again. Only an
// end of power or of the connection between the first and the last changed word of the area leaves a wrong checksum:
// the ESC tells it (0x0502 bit 11) and does not load the area. No order of words avoids this: the write of a single
// word to a right area makes its checksum wrong, unless the change has a checksum of zero.
//
// On an error, error().index is the word that is not sure to be written, whatever the cause.
[[nodiscard]] Task<Result<>> sii_write(Station station, std::uint32_t word, Bytes data);

// Takes the SII interface for the master, or offers it to the slave's PDI (which needs it for INIT to PREOP).
[[nodiscard]] Task<Result<>> sii_assign(Station station, bool to_pdi);

}  // namespace margay
