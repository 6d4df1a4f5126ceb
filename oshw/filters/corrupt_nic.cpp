#include "oshw/filters/corrupt_nic.hpp"

#include <algorithm>

namespace margay {

SendStatus CorruptNic::send(std::span<const std::byte> frame) noexcept {
    if (!chance_.happens(options_.sent) || frame.size() > buffer_.size()) return inner().send(frame);
    std::copy(frame.begin(), frame.end(), buffer_.begin());
    const auto length = corrupt(std::span(buffer_).first(frame.size()));
    return inner().send(std::span(buffer_).first(length));
}

std::size_t CorruptNic::receive(std::span<std::byte> into) noexcept {
    const auto length = inner().receive(into);
    if (length == 0 || !chance_.happens(options_.received)) return length;
    return corrupt(into.first(length));
}

// Returns the new length. It is never 0, because 0 means "no frame".
std::size_t CorruptNic::corrupt(std::span<std::byte> frame) noexcept {
    const auto from = options_.from_octet;
    if (frame.size() <= from) return frame.size();
    ++corrupted_;
    if (chance_.happens(options_.cut))
        return std::max<std::size_t>(1, from + static_cast<std::size_t>(chance_.below(frame.size() - from)));
    const auto flips = 1 + chance_.below(options_.max_flips);
    for (std::uint64_t i = 0; i < flips; ++i) {
        const auto octet = from + static_cast<std::size_t>(chance_.below(frame.size() - from));
        frame[octet] ^= std::byte{1} << static_cast<int>(chance_.below(8));
    }
    return frame.size();
}

}  // namespace margay
