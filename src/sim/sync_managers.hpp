// The SyncManager channels of an ESC: which side may access a buffer, which of the three buffers is used, and the
// events when a buffer is handed over (ETG.1000.4 "Sync manager"; ESC data sheets, section "SyncManager").
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
        bool watchdog = false;    // process data arrived on a channel that triggers the watchdog
        bool arrived = false;     // the master has handed over a buffer, with or without an event
        bool pdi_start = false;   // the PDI has opened a buffer
        bool pdi_change = false;  // the PDI has handed over a buffer
        [[nodiscard]] bool any() const {
            return (al_set | al_clear | ecat_set | ecat_clear) != 0 || watchdog || arrived || pdi_start || pdi_change;
        }
    };

    void power_up(RegisterFile& registers, unsigned count, std::uint32_t ram_bytes);

    // Updates the status octets in the registers.
    void settle() const;

    // Call it after the registers of channel n were written: reads the new configuration. A channel that begins below
    // the digital outputs (0x0F00) would overlap the registers of the ESC: it has no effect, and shows the status of a
    // channel that is off. (Buffers are in the process RAM; the digital outputs are the only registers that terminals
    // give to a SyncManager. No recording shows one over other registers.)
    // True: the channel was switched on or off, so that it begins anew. Its interrupt bits are clear then, and with
    // them its bits in 0x0210 and 0x0220, which show the interrupt bits (DS II, register 0x0220).
    bool reconfigure(unsigned n);
    // Whether the first five octets of channel n are write protected. They can be written only while the channel is
    // off.
    [[nodiscard]] bool locked(unsigned n) const { return (channels_[n].activate & 1) != 0; }

    // The first part of [address, end) with one owner: from `address` to `stop`. `channel` is −1 when no channel owns
    // the memory.
    struct Part {
        int channel = -1;
        std::uint32_t stop = 0;
    };
    [[nodiscard]] Part part_at(std::uint32_t address, std::uint32_t end) const;
    [[nodiscard]] bool any_enabled() const { return enabled_ != 0; }

    // `side` wants to read or write [address, stop) of channel n. Returns nullopt when the access is refused; otherwise
    // the distance from the address to the memory of the buffer.
    [[nodiscard]] std::optional<std::uint32_t> open(unsigned n, Side side, bool write, std::uint32_t address,
                                                    std::uint32_t stop, Events& events);
    // Call it after the access. From ECAT, the buffer is handed over at the end of the frame.
    void touched(unsigned n, Side side, std::uint32_t stop, Events& events);

    // ESC data sheets, register 0x0802: "shall be greater 1, otherwise the SyncManager is not activated. If set to 1,
    // only the watchdog trigger is generated if configured." So the memory of such a channel is plain memory without
    // handshake, events and status. (Terminals of one octet at 0x0F00 or 0x1000 use it, recorded on an EL2828, EL2889
    // and EL1004. No recording shows the status of such a channel, so the model follows the data sheet.)
    [[nodiscard]] bool any_single() const { return singles_ != 0; }
    // The master has written [address, end): call it for memory that no channel owns.
    void wrote_singles(std::uint32_t address, std::uint32_t end);

    // The channel whose buffer is exactly [start, stop) in the process RAM, as ECAT addresses it; −1: none.
    [[nodiscard]] int exactly_at(std::uint32_t start, std::uint32_t stop) const;

    // Whether a channel that the master writes triggers the watchdog.
    [[nodiscard]] bool feeds_watchdog() const;

    // The end of a frame. With a wrong FCS no buffer is handed over.
    [[nodiscard]] bool frame_pending() const { return (closing_ | triggered_) != 0; }
    void frame_end(bool good, Events& events);

    // The RAM address for a write from ECAT to `address`.
    [[nodiscard]] std::uint32_t write_address(std::uint32_t address) const;

    // State of the channels, for devices without firmware and for tests.
    [[nodiscard]] bool enabled(unsigned n) const { return channels_[n].enabled; }
    [[nodiscard]] bool mailbox_full(unsigned n) const { return channels_[n].full; }
    [[nodiscard]] unsigned count() const { return count_; }
    // RAM address of the last complete buffer of the writer; nullopt when there is none.
    [[nodiscard]] std::optional<std::uint32_t> last_written(unsigned n) const;

  private:
    struct Channel {
        std::uint32_t start = 0;
        std::uint32_t length = 0;
        std::uint8_t control = 0;
        std::uint8_t activate = 0;
        bool enabled = false;    // activated by both sides, and the length is above 1
        bool reachable = false;  // its memory exists
        bool locked_by_pdi = false;
        bool three = false;               // three buffers in RAM
        bool opened[2] = {false, false};  // by Side
        bool full = false;                // mailbox only
        bool fresh = false;               // `latest` has not been read yet
        bool written = false;             // a buffer was handed over since activation
        std::uint8_t interrupts = 0;      // interrupt bits of the status octet
        std::uint8_t write_buffer = 0;
        std::uint8_t read_buffer = 1;
        std::uint8_t latest = 2;  // the free buffer, or the buffer handed over last

        [[nodiscard]] bool mailbox() const { return (control & 0x03) == 0x02; }
        [[nodiscard]] bool ecat_writes() const { return (control & 0x0C) == 0x04; }
        [[nodiscard]] std::uint32_t stop() const { return start + length; }
        [[nodiscard]] bool writer_is(Side side) const { return (side == Side::ecat) == ecat_writes(); }
        void reset();
    };

    void finish_access(unsigned n, Side side, Events& events);
    void show(unsigned n) { stale_ |= 1u << n; }
    [[nodiscard]] std::uint8_t status(unsigned n) const;

    RegisterFile* registers_ = nullptr;
    std::uint32_t ram_end_ = 0;
    unsigned count_ = 0;
    std::uint32_t enabled_ = 0;        // channels that own their memory, including locked channels
    std::uint32_t singles_ = 0;        // active channels of one octet
    std::uint32_t triggered_ = 0;      // channels that were written in this frame
    std::uint32_t closing_ = 0;        // channels whose last octet was accessed in this frame
    mutable std::uint32_t stale_ = 0;  // channels whose status octets are not up to date
    std::array<Channel, kMaxSyncManagers> channels_{};
};

}  // namespace margay::sim
