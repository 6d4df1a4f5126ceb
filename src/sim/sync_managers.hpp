// The SyncManager channels of an ESC: who may touch a buffer now, which of the three buffers is meant, and
// what happens when one is handed over (ETG.1000.4 "Sync manager"; ESC data sheets, section "SyncManager").
#pragma once

#include "sim/register_file.hpp"

#include <array>
#include <cstdint>
#include <optional>

namespace margay::sim {

enum class Side : std::uint8_t { ecat, pdi };

class SyncManagers {
  public:
    struct Events {
        std::uint32_t al_set = 0;  // bits of 0x0220
        std::uint32_t al_clear = 0;
        std::uint16_t ecat_set = 0;  // bits of 0x0210
        std::uint16_t ecat_clear = 0;
        bool watchdog = false;  // process data came in on a channel that feeds the watchdog
        bool arrived = false;   // the master has handed a buffer over, with an event or without
        [[nodiscard]] bool any() const {
            return (al_set | al_clear | ecat_set | ecat_clear) != 0 || watchdog || arrived;
        }
    };

    void power_up(RegisterFile& registers, unsigned count, std::uint32_t ram_bytes);

    // Brings the status octets in the registers up to date.
    void settle() const;

    // Channel n's registers have been written: takes them over.
    void reconfigure(unsigned n);
    // May its first five octets be written? Only while it is off.
    [[nodiscard]] bool locked(unsigned n) const { return (channels_[n].activate & 1) != 0; }

    // The part of [address, end) that one owner has: from `address` up to `stop`. `channel` is −1 where no
    // channel is in charge and the memory is plain.
    struct Part {
        int channel = -1;
        std::uint32_t stop = 0;
    };
    [[nodiscard]] Part part_at(std::uint32_t address, std::uint32_t end) const;
    [[nodiscard]] bool any_enabled() const { return enabled_ != 0; }

    // `side` wants to read or write [address, stop) of channel n. Nothing when it may not; otherwise how far
    // behind its own address the buffer's memory lies.
    [[nodiscard]] std::optional<std::uint32_t> open(unsigned n, Side side, bool write, std::uint32_t address,
                                                    std::uint32_t stop, Events& events);
    // The access has taken place. From ECAT the hand-over waits for the end of the frame.
    void touched(unsigned n, Side side, std::uint32_t stop, Events& events);

    // The channel whose buffer is exactly [start, stop), as ECAT reaches it in the process RAM; −1: none.
    [[nodiscard]] int exactly_at(std::uint32_t start, std::uint32_t stop) const;

    // Whether one that the master writes feeds the watchdog.
    [[nodiscard]] bool feeds_watchdog() const;

    // A frame has ended; with a wrong FCS nothing is handed over.
    [[nodiscard]] bool frame_pending() const { return closing_ != 0; }
    void frame_end(bool good, Events& events);

    // Where ECAT's write to `address` would land in RAM.
    [[nodiscard]] std::uint32_t write_address(std::uint32_t address) const;

    // For the firmware that stands in where there is none, and for looking in.
    [[nodiscard]] bool enabled(unsigned n) const { return channels_[n].enabled; }
    [[nodiscard]] bool mailbox_full(unsigned n) const { return channels_[n].full; }
    [[nodiscard]] unsigned count() const { return count_; }
    // Where the writer's last complete buffer is, in RAM addresses; nothing when none is.
    [[nodiscard]] std::optional<std::uint32_t> last_written(unsigned n) const;

  private:
    struct Channel {
        std::uint32_t start = 0;
        std::uint32_t length = 0;
        std::uint8_t control = 0;
        std::uint8_t activate = 0;
        bool enabled = false;    // on by both sides, and of a length
        bool reachable = false;  // its memory exists
        bool locked_by_pdi = false;
        bool three = false;               // three buffers in RAM
        bool opened[2] = {false, false};  // by Side
        bool full = false;                // mailbox
        bool fresh = false;               // `latest` has not been read yet
        bool written = false;             // something was handed over since it was enabled
        std::uint8_t interrupts = 0;      // of the status octet
        std::uint8_t write_buffer = 0;
        std::uint8_t read_buffer = 1;
        std::uint8_t latest = 2;  // the free one, or the last one handed over

        [[nodiscard]] bool mailbox() const { return (control & 0x03) == 0x02; }
        [[nodiscard]] bool ecat_writes() const { return (control & 0x0C) == 0x04; }
        [[nodiscard]] std::uint32_t stop() const { return start + length; }
        [[nodiscard]] bool writer_is(Side side) const { return (side == Side::ecat) == ecat_writes(); }
        void reset();
    };

    void hand_over(unsigned n, Side side, Events& events);
    void show(unsigned n) { stale_ |= 1u << n; }
    [[nodiscard]] std::uint8_t status(unsigned n) const;

    RegisterFile* registers_ = nullptr;
    std::uint32_t ram_end_ = 0;
    unsigned count_ = 0;
    std::uint32_t enabled_ = 0;        // channels in charge of their memory, the locked ones too
    std::uint32_t closing_ = 0;        // last octet touched in this frame
    mutable std::uint32_t stale_ = 0;  // status octets that do not show yet what has happened
    std::array<Channel, kMaxSyncManagers> channels_{};
};

}  // namespace margay::sim
