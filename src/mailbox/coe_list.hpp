// Lists in an object dictionary: PDO assignments and mappings, SyncManager types.
#pragma once

#include "mailbox/coe_sdo.hpp"
#include "util/bytes.hpp"

#include <algorithm>
#include <array>

namespace margay {

// Whether the slave has answered that it does not have the object. This is not a failure.
[[nodiscard]] bool is_refusal(const Error& error);

// A list in the object dictionary: subindex 0 is the count, all other subindices have the same size: 1, 2 or 4 octets.
// Short lists are read by complete access if the slave supports it, other lists element by element.
class SdoList {
  public:
    SdoList(MailboxChannel& channel, std::uint16_t index, std::size_t element_bytes, const MailPatience& patience)
        : channel_(channel), patience_(patience), index_(index), element_bytes_(element_bytes) {}
    [[nodiscard]] Arena& arena() { return channel_.arena(); }

    // Returns the number of elements. Error sdo_abort: the slave has no such list.
    Task<Result<std::uint8_t>> open();

    // Returns element n; 1 is the first.
    Task<Result<std::uint32_t>> element(unsigned n);

  private:
    [[nodiscard]] Error too_short(unsigned n, std::size_t expected, std::size_t actual) const;
    [[nodiscard]] bool is_list(std::size_t bytes) const;

    static constexpr std::size_t kHead = 2;
    static constexpr std::size_t kMostKept = 32;
    static constexpr std::size_t kMostElementBytes = 4;
    MailboxChannel& channel_;
    MailPatience patience_;
    std::uint16_t index_;
    std::size_t element_bytes_;
    std::uint8_t kept_ = 0;
    std::array<std::byte, kHead + kMostKept * kMostElementBytes> cache_{};
};

}  // namespace margay
