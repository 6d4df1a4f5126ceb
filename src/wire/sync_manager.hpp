// A SyncManager channel, 8 octets from 0x0800 (ETG.1000.4 table "Sync manager channel").
#pragma once

#include "util/bytes.hpp"
#include "wire/esc.hpp"

#include <array>
#include <cstddef>

namespace margay::wire {

struct SyncManagerLayout {
    using physical_start = Field<std::uint16_t, 0>;
    using length = Field<std::uint16_t, 2>;
    using control = Field<std::uint8_t, 4>;
    using status = Field<std::uint8_t, 5>;  // read only
    using activate = Field<std::uint8_t, 6>;
    using pdi_control = Field<std::uint8_t, 7>;  // read only from ECAT
};

// Control octet.
namespace sm_control {
inline constexpr std::uint8_t kModeMask = 0x03;
inline constexpr std::uint8_t kModeBuffered = 0x00;  // three buffers
inline constexpr std::uint8_t kModeMailbox = 0x02;   // one buffer with handshake
inline constexpr std::uint8_t kDirectionMask = 0x0C;
inline constexpr std::uint8_t kEcatReads = 0x00;   // inputs, slave to master
inline constexpr std::uint8_t kEcatWrites = 0x04;  // outputs, master to slave
inline constexpr std::uint8_t kEcatInterrupt = 0x10;
inline constexpr std::uint8_t kPdiInterrupt = 0x20;
inline constexpr std::uint8_t kWatchdogTrigger = 0x40;
}  // namespace sm_control

// Status octet.
namespace sm_status {
inline constexpr std::uint8_t kInterruptWrite = 0x01;
inline constexpr std::uint8_t kInterruptRead = 0x02;
inline constexpr std::uint8_t kMailboxFull = 0x08;
inline constexpr std::uint8_t kLastBufferMask = 0x30;  // three-buffer mode: last written buffer, 3 = none
inline constexpr std::uint8_t kReadBufferInUse = 0x40;
inline constexpr std::uint8_t kWriteBufferInUse = 0x80;
}  // namespace sm_status

// Activate octet.
namespace sm_activate {
inline constexpr std::uint8_t kEnable = 0x01;
inline constexpr std::uint8_t kRepeatRequest = 0x02;
inline constexpr std::uint8_t kLatchEventEcat = 0x40;
inline constexpr std::uint8_t kLatchEventPdi = 0x80;
}  // namespace sm_activate

// PDI control octet.
namespace sm_pdi_control {
inline constexpr std::uint8_t kDeactivate = 0x01;
inline constexpr std::uint8_t kRepeatAcknowledge = 0x02;
}  // namespace sm_pdi_control

// The part of the channel that the master writes.
struct SyncManager {
    std::uint16_t physical_start = 0;
    std::uint16_t length_bytes = 0;
    std::uint8_t control = 0;
    std::uint8_t activate = 0;

    [[nodiscard]] constexpr bool mailbox() const {
        return (control & sm_control::kModeMask) == sm_control::kModeMailbox;
    }
    [[nodiscard]] constexpr bool ecat_writes() const {
        return (control & sm_control::kDirectionMask) == sm_control::kEcatWrites;
    }
    [[nodiscard]] constexpr bool enabled() const { return (activate & sm_activate::kEnable) != 0; }
    // The first octet behind its memory: three buffers follow each other (ESC data sheets, "SyncManager"). A channel of
    // one octet has no buffers.
    [[nodiscard]] constexpr std::uint32_t end() const {
        const std::uint32_t buffers = mailbox() || length_bytes < 2 ? 1 : 3;
        return physical_start + buffers * length_bytes;
    }
    friend constexpr bool operator==(const SyncManager&, const SyncManager&) = default;
};

// `at` must have reg::kSyncManagerStride octets.
[[nodiscard]] constexpr SyncManager load_sync_manager(Bytes at) {
    using L = SyncManagerLayout;
    return {L::physical_start::load(at), L::length::load(at), L::control::load(at), L::activate::load(at)};
}

constexpr void store_sync_manager(MutableBytes at, const SyncManager& s) {
    using L = SyncManagerLayout;
    L::physical_start::store(at, s.physical_start);
    L::length::store(at, s.length_bytes);
    L::control::store(at, s.control);
    L::status::store(at, 0);
    L::activate::store(at, s.activate);
    L::pdi_control::store(at, 0);
}

// Whether the memory of a SyncManager is valid, outside of the process RAM, or overlaps another SyncManager.
enum class SyncManagerPlace : std::uint8_t { free, outside, taken };

// The memory of at most `N` SyncManagers, for the check that each has its own, in the process RAM.
template <std::size_t N>
class SyncManagerPlaces {
  public:
    // `ram_end`: the first octet behind the process RAM of the ESC.
    explicit constexpr SyncManagerPlaces(std::uint32_t ram_end = 0x10000) : ram_end_(ram_end) {}

    // The channel is added if its memory is free.
    [[nodiscard]] constexpr SyncManagerPlace add(const SyncManager& sm) {
        if (sm.physical_start < reg::kProcessRam || sm.end() > ram_end_) return SyncManagerPlace::outside;
        for (std::size_t n = 0; n < count_; ++n)
            if (sm.physical_start < used_[n].end && used_[n].begin < sm.end()) return SyncManagerPlace::taken;
        if (count_ < N) used_[count_++] = {sm.physical_start, sm.end()};
        return SyncManagerPlace::free;
    }

  private:
    struct Range {
        std::uint32_t begin = 0;
        std::uint32_t end = 0;
    };
    std::uint32_t ram_end_;
    std::size_t count_ = 0;
    std::array<Range, N> used_{};
};

}  // namespace margay::wire
