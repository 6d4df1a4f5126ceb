#include "station/sii_access.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace control = wire::sii_control;
namespace reg = wire::reg;

constexpr Duration kReadTimeout = std::chrono::milliseconds(100);  // for one block: while busy or not acknowledged
constexpr Duration kNackPause = std::chrono::microseconds(500);    // after a command that was not acknowledged
constexpr int kNackTries = 3;                                      // at least, whatever time passes between two polls
constexpr int kBusyTries =
    10;  // at least: frames may take longer than the EEPROM, and a repeated frame orders its block a second time

constexpr std::array<std::byte, 6> command(std::uint16_t what, std::uint32_t word) {
    std::array<std::byte, 6> bytes{};
    store_le<std::uint16_t>(bytes, 0, what);
    store_le<std::uint32_t>(bytes, 2, word);
    return bytes;
}

}  // namespace

// One visit: reads control, address and data in one datagram ("look"), or orders a block, or both in this order. `word`
// is the word for errors.
class SiiReader::VisitAwaiter {
  public:
    VisitAwaiter(const Station& station, bool look, std::uint32_t order, std::uint32_t word)
        : station_(station),
          word_(word),
          order_bytes_(command(control::kCommandRead, order)),
          look_(station.engine.link(), wire::Command::FPRD, {station.address, reg::kSiiControl.address},
                MutableBytes(bytes_)),
          order_(station.engine.link(), wire::Command::FPWR, {station.address, reg::kSiiControl.address},
                 Bytes(order_bytes_)),
          looks_(look),
          orders_(order != kNone) {}
    bool await_ready() const noexcept { return false; }
    void await_suspend(std::coroutine_handle<> h) noexcept {
        waiter_.handle = h;
        if (looks_) look_.submit(waiter_);
        if (orders_) order_.submit(waiter_);
    }
    Result<Visit> await_resume() const noexcept {
        Error error = looks_ ? error_of(look_) : Error{};
        if (error.code == Errc::none && orders_) error = error_of(order_);
        if (error.code != Errc::none) return error;
        Visit visit;
        visit.status = load_le<std::uint16_t>(bytes_, 0);
        visit.word = load_le<std::uint32_t>(bytes_, 2);
        std::copy(bytes_.begin() + 6, bytes_.end(), visit.data.begin());
        return visit;
    }

  private:
    [[nodiscard]] Error error_of(const Datagram& datagram) const {
        Error error = error_of_reply(station_, datagram.reply(), Step::read_sii, 0);
        if (error.code != Errc::none) error.set_word(word_);
        return error;
    }

    const Station& station_;
    std::uint32_t word_;
    std::array<std::byte, 14> bytes_{};
    std::array<std::byte, 6> order_bytes_;
    Datagram look_;
    Datagram order_;
    Waiter waiter_;
    bool looks_;
    bool orders_;
};

// Returns the block to order behind the one at `word`: the next one of the range, or the block that the caller reads
// next.
std::uint32_t SiiReader::block_after(std::uint32_t word, std::uint32_t end, std::uint32_t then) const {
    const std::uint32_t next = word + block_words_;
    if (end - word > block_words_) return next;
    return then >= word && then - word < block_words_ ? next : then;
}

// Notes that a visit was too early. The next visit orders no block, because the ESC ignores a command while the
// interface is busy. While the reading time of the EEPROM is unknown, the wait grows.
void SiiReader::note_busy(Time sent) {
    known_busy_ = std::max(known_busy_, sent - ordered_at_);
    sure_ = false;
    wait_ = known_ready_ == Duration::max() ? known_busy_ * 7 / 4 : between();
}

// Notes that a visit was late enough. known_busy_ decreases slowly, so that one slow answer does not delay all other
// visits.
void SiiReader::note_ready(Time sent) {
    constexpr int kFading = 512;
    known_ready_ = std::min(known_ready_, sent - ordered_at_);
    known_busy_ = std::min(known_busy_ - known_busy_ / kFading, known_ready_);
    wait_ = known_busy_ == Duration{0} ? Duration{0} : between();
    sure_ = true;
}

// When the gap between "too early" and "late enough" is wide, the next wait is the middle of it. This finds the reading
// time of the EEPROM in a few steps.
Duration SiiReader::between() const {
    constexpr int kNarrow = 5;
    const Duration gap = known_ready_ - known_busy_;
    return gap * kNarrow > known_ready_ ? known_busy_ + gap / 2 : known_ready_;
}

// Copies the data of a visit that found the interface ready. False when it is not the block that was ordered: a frame
// that is sent again, because its reply was late, reads the interface after the order that it carries. Then the next
// visit only looks.
bool SiiReader::accept(const Visit& visit, std::uint32_t ordered_ahead, Time sent) {
    const bool right = visit.word == ordered_;
    if (right) {
        block_word_ = ordered_;
        block_ = visit.data;
        nacks_ = 0;
        note_ready(sent);
    } else {
        sure_ = false;
    }
    ordered_ = ordered_ahead;
    ordered_at_ = sent;
    idle_ = ordered_ahead == kNone;
    return right;
}

Task<Result<>> SiiReader::read(std::uint32_t word, MutableBytes into, std::uint32_t then) {
    Engine& engine = station_.engine;
    const std::uint32_t end = word + static_cast<std::uint32_t>(into.size() / 2);
    Time give_up = engine.now() + kReadTimeout;
    nacks_ = 0;
    int busy = 0;  // looks that have found the EEPROM busy, or the block of another reader. If frames are lost, few
                   // looks are possible before the timeout
    for (std::uint32_t at = word; at < end;) {
        if (cached(at)) {
            const auto count = std::min(end - at, block_words_ - (at - block_word_));
            std::copy_n(block_.begin() + (at - block_word_) * 2, count * 2, into.begin() + (at - word) * 2);
            at += count;
            give_up = engine.now() + kReadTimeout;
            busy = 0;
            continue;
        }
        const bool waiting = ordered_ == at;
        if (waiting) co_await engine.sleep_until(ordered_at_ + wait_);
        const std::uint32_t order = !waiting ? at : sure_ ? block_after(at, end, then) : kNone;
        const Time sent =
            engine.now();  // a look sent before the timeout does not end the reading: the program may have paused
        const bool look = waiting || !idle_;
        idle_ = false;
        auto visit = co_await VisitAwaiter(station_, look, order, at);
        if (!visit) co_return visit.error();
        if (!look) {
            ordered_ = at;
            ordered_at_ = sent;
            continue;
        }
        block_words_ = (visit->status & control::kReads8Bytes) != 0 ? 4 : 2;
        if ((visit->status & control::kBusy) != 0) {
            if (waiting) note_busy(sent);
            if (!waiting) {  // the order was ignored, or its frame was sent twice: the next visit only looks
                ordered_ = at;
                ordered_at_ = sent;
                sure_ = false;
            }
            busy = std::min(busy + 1, kBusyTries);
            if (busy == kBusyTries && sent >= give_up) co_return failure(Errc::sii_busy, at);
        } else if (waiting && (visit->status & control::kMissingAcknowledge) != 0) {
            nacks_ = nacks_ < kNackTries ? static_cast<std::uint8_t>(nacks_ + 1) : nacks_;
            if (nacks_ == kNackTries && sent >= give_up) co_return failure(Errc::sii_nack, at);
            ordered_ = kNone;
            co_await engine.sleep_for(kNackPause);
        } else if (waiting) {
            if (accept(*visit, order, sent)) continue;
            busy = std::min(busy + 1, kBusyTries);
            if (busy == kBusyTries && sent >= give_up) co_return failure(Errc::sii_busy, at);
        } else {
            ordered_ = at;
            ordered_at_ = sent;
        }
    }
    co_return Nothing{};
}

Task<Result<>> sii_assign(Station station, bool to_pdi) {
    if (!to_pdi) {  // the first write takes the interface from a PDI that does not release it
        co_await required(write<std::uint8_t>(station, reg::kSiiConfig, wire::sii_config::kForceEcat, Step::read_sii));
    }
    co_await required(write<std::uint8_t>(station, reg::kSiiConfig,
                                          to_pdi ? wire::sii_config::kOfferedToPdi : std::uint8_t{0}, Step::read_sii));
    co_return Nothing{};
}

}  // namespace margay
