// Lists in an object dictionary: PDO assignments and mappings, SyncManager types.
#pragma once

#include "mailbox/coe_sdo.hpp"
#include "util/bytes.hpp"

#include <algorithm>
#include <array>

namespace margay {

// Whether the slave has answered that it does not have the object. This is not a failure.
[[nodiscard]] inline bool is_refusal(const Error& error) {
    return error.code == Errc::sdo_abort || error.code == Errc::mailbox_error;
}

// A list in the object dictionary: subindex 0 is the count, all other subindices have the same type. Short lists are
// read by complete access if the slave supports it, other lists element by element.
template <class T>
class SdoList {
  public:
    SdoList(MailboxChannel& channel, std::uint16_t index, const MailPatience& patience)
        : channel_(channel), patience_(patience), index_(index) {}
    [[nodiscard]] Arena& arena() { return channel_.arena(); }

    // Returns the number of elements. Error sdo_abort: the slave has no such list.
    Task<Result<std::uint8_t>> open() {
        kept_ = 0;
        const bool whole =
            channel_.whole_objects() && (channel_.slave().coe_details & coe_detail::kCompleteAccess) != 0;
        if (whole) {
            auto read = co_await sdo_upload_once(channel_, {.index = index_, .complete = true}, cache_, patience_);
            if (read && is_list(*read)) {
                kept_ = static_cast<std::uint8_t>((*read - kHead) / sizeof(T));
                co_return std::to_integer<std::uint8_t>(cache_[0]);
            }
            if (read || is_complete_access_refused(read.error())) channel_.no_complete_access = true;
        }
        std::array<std::byte, 4> count{};
        auto read = co_await sdo_upload_once(channel_, {.index = index_}, count, patience_);
        if (!read) co_return read.error();
        co_return std::to_integer<std::uint8_t>(count[0]);
    }

    // Returns element n; 1 is the first.
    Task<Result<T>> element(unsigned n) {
        if (n <= kept_) co_return load_le<T>(cache_, kHead + (n - 1) * sizeof(T));
        std::array<std::byte, std::max<std::size_t>(4, sizeof(T))>
            value{};  // some slaves send more octets for an element
        auto read = co_await sdo_upload_once(channel_, {.index = index_, .subindex = static_cast<std::uint8_t>(n)},
                                             value, patience_);
        if (!read) co_return read.error();
        co_return load_le<T>(value);
    }

  private:
    // In a complete access subindex 0 has two octets. Some slaves send one: their lists are read element by element.
    [[nodiscard]] bool is_list(std::size_t bytes) const {
        const std::size_t count = std::to_integer<std::size_t>(cache_[0]);
        return bytes >= kHead + std::min(count, kMostKept) * sizeof(T) && (bytes - kHead) % sizeof(T) == 0;
    }

    static constexpr std::size_t kHead = 2;
    static constexpr std::size_t kMostKept = 32;
    MailboxChannel& channel_;
    MailPatience patience_;
    std::uint16_t index_;
    std::uint8_t kept_ = 0;
    std::array<std::byte, kHead + kMostKept * sizeof(T)> cache_{};
};

}  // namespace margay
