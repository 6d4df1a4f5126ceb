// Lists in an object dictionary: PDO assignments and mappings, SyncManager types.
#pragma once

#include "mailbox/coe_sdo.hpp"
#include "util/bytes.hpp"

#include <algorithm>
#include <array>

namespace margay {

// The slave has answered that it does not have it: no failure.
[[nodiscard]] inline bool is_refusal(const Error& error) {
    return error.code == Errc::sdo_abort || error.code == Errc::mailbox_error;
}

// A list of the dictionary: subindex 0 says how many, the others are alike. Read whole where the slave can and it is
// not long, else one by one.
template <class T>
class SdoList {
  public:
    SdoList(MailboxChannel& channel, std::uint16_t index, const MailPatience& patience)
        : channel_(channel), patience_(patience), index_(index) {}
    [[nodiscard]] Arena& arena() { return channel_.arena(); }

    // The number of elements. Error sdo_abort: there is no such list.
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

    // The n-th, from 1.
    Task<Result<T>> element(unsigned n) {
        if (n <= kept_) co_return load_le<T>(cache_, kHead + (n - 1) * sizeof(T));
        std::array<std::byte, std::max<std::size_t>(4, sizeof(T))> value{};  // some give elements more octets
        auto read = co_await sdo_upload_once(channel_, {.index = index_, .subindex = static_cast<std::uint8_t>(n)},
                                             value, patience_);
        if (!read) co_return read.error();
        co_return load_le<T>(value);
    }

  private:
    // Subindex 0 takes two octets there. Some slaves give it one: what they say is read singly.
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
