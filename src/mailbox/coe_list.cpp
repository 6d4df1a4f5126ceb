#include "mailbox/coe_list.hpp"

namespace margay {

bool is_refusal(const Error& error) { return error.code == Errc::sdo_abort || error.code == Errc::mailbox_error; }

// The error of an answer with too few octets. Zeros in place of the missing octets would mean an empty list, or another
// element.
Error SdoList::too_short(unsigned n, std::size_t expected, std::size_t actual) const {
    Error error = channel_.station().error(Errc::wrong_size, Step::sdo_upload, index_);
    error.subindex = static_cast<std::uint8_t>(n);
    error.expected = static_cast<std::uint32_t>(expected);
    error.actual = static_cast<std::uint32_t>(actual);
    return error;
}

Task<Result<std::uint8_t>> SdoList::open() {
    kept_ = 0;
    const bool whole = channel_.whole_objects() && (channel_.slave().coe_details & coe_detail::kCompleteAccess) != 0;
    if (whole) {
        const MutableBytes room = MutableBytes(cache_).first(kHead + kMostKept * element_bytes_);
        auto read = co_await sdo_upload_once(channel_, {.index = index_, .complete = true}, room, patience_);
        if (read && is_list(*read)) {
            kept_ = static_cast<std::uint8_t>((*read - kHead) / element_bytes_);
            co_return std::to_integer<std::uint8_t>(cache_[0]);
        }
        if (read || is_complete_access_refused(read.error())) channel_.no_complete_access = true;
    }
    std::array<std::byte, 4> count{};
    const auto read = co_await required(sdo_upload_once(channel_, {.index = index_}, count, patience_));
    if (read == 0) co_return too_short(0, 1, read);
    co_return std::to_integer<std::uint8_t>(count[0]);
}

Task<Result<std::uint32_t>> SdoList::element(unsigned n) {
    std::array<std::byte, kMostElementBytes> value{};
    if (n <= kept_) {
        std::copy_n(cache_.begin() + static_cast<std::ptrdiff_t>(kHead + (n - 1) * element_bytes_), element_bytes_,
                    value.begin());
        co_return load_le<std::uint32_t>(value);
    }
    // Some slaves send more octets than the element has.
    const auto read = co_await required(
        sdo_upload_once(channel_, {.index = index_, .subindex = static_cast<std::uint8_t>(n)}, value, patience_));
    if (read < element_bytes_) co_return too_short(n, element_bytes_, read);
    std::fill(value.begin() + static_cast<std::ptrdiff_t>(element_bytes_), value.end(), std::byte{0});
    co_return load_le<std::uint32_t>(value);
}

// In a complete access subindex 0 has two octets. Some slaves send one: their lists are read element by element.
bool SdoList::is_list(std::size_t bytes) const {
    const std::size_t count = std::to_integer<std::size_t>(cache_[0]);
    return bytes >= kHead + std::min(count, kMostKept) * element_bytes_ && (bytes - kHead) % element_bytes_ == 0;
}

}  // namespace margay
