// One EtherCAT slave controller: its registers, its memory and what happens when the master or the PDI
// touches them. The master's side is driven by Segment, the PDI's side is subdevice::EscAccess.
//
// As on the chip, what a frame writes into registers counts from the end of the frame on, and only if its FCS
// is right ("shadow buffers for register write operations"); process memory is written at once, but its
// SyncManagers hand buffers over at the end of the frame as well.
#pragma once

#include "sim/dc_clock.hpp"
#include "sim/esc_description.hpp"
#include "sim/firmware.hpp"
#include "sim/mii_unit.hpp"
#include "sim/register_file.hpp"
#include "sim/sii_unit.hpp"
#include "sim/sync_managers.hpp"
#include "sim/sync_unit.hpp"
#include "sim/watchdogs.hpp"
#include "subdevice/esc_access.hpp"
#include "wire/datagram.hpp"
#include "wire/fmmu.hpp"

#include <array>
#include <memory>
#include <vector>

namespace margay::sim {

// What an ESC knows of a frame when it has passed.
struct FrameEnd {
    bool good = true;   // FCS and structure
    Time at{};          // the last octet is through
    Time processing{};  // the first bit reached the processing unit
    std::array<Time, kMaxPorts> ports{kNever, kNever, kNever,
                                      kNever};  // the first bit came in at a port; kNever: not there
};

class Esc final : public subdevice::EscAccess {
  public:
    // `sii` is the content of the EEPROM. The device is without power until power_up().
    Esc(const EscDescription& description, std::vector<std::byte> sii);

    // Takes the program that runs behind the PDI; nothing: an ESC without a processor. Before power_up().
    void set_firmware(std::unique_ptr<Firmware> firmware) { firmware_ = std::move(firmware); }
    [[nodiscard]] Firmware* firmware() { return firmware_.get(); }
    // The process data of the firmware; nullptr where there is none, and while the PDI does not work (start_pdi()).
    [[nodiscard]] ProcessDataFirmware* process_data() {
        return firmware_ && pdi_operational_ ? firmware_->process_data() : nullptr;
    }

    void power_up(Time now);
    [[nodiscard]] const EscDescription& description() const { return description_; }

    // --- The master's side. `at`: when the frame begins to pass the processing unit. ---

    // Physical memory, both the register and the process data area. Octets that cannot be read stay as they
    // are in `data`. True when at least one octet could.
    bool ecat_read(std::uint32_t address, MutableBytes data, Time at);
    bool ecat_write(std::uint32_t address, Bytes data, Time at);
    // LRD, LWR, LRW: returns what it adds to the working counter.
    std::uint16_t ecat_logical(bool read, bool write, std::uint32_t address, MutableBytes data, Time at);
    // The end of a frame in which the ESC was touched: takes over what was written, unless the frame was bad.
    void frame_end(const FrameEnd& end);
    // The same, once a frame.
    [[nodiscard]] bool newly_pending() { return !end_expected_ && (end_expected_ = frame_pending()); }
    // Asks the processor's cache for what ecat_logical() will need: the ESC itself, then what it points to.
    void fetch_state() const {
        for (std::size_t line = 0; line < 8; ++line)
            __builtin_prefetch(reinterpret_cast<const std::byte*>(&now_) + 64 * line);
        __builtin_prefetch(&read_mappings_.at[0]);
        __builtin_prefetch(&write_mappings_.at[0]);
        __builtin_prefetch(&watchdogs_);
    }
    void fetch_buffers() const {
        for (const auto* mappings : {&read_mappings_, &write_mappings_})
            if (mappings->count != 0 && mappings->at[0].physical / 8 >= wire::reg::kProcessRam)
                __builtin_prefetch(ram_.data() + (mappings->at[0].physical / 8 - wire::reg::kProcessRam));
    }
    [[nodiscard]] bool register_writes_pending() const { return writes_ != 0; }
    [[nodiscard]] bool frame_pending() const { return writes_ != 0 || effects_ != 0 || sync_managers_.frame_pending(); }

    [[nodiscard]] std::uint16_t station() const {
        return registers_.get<std::uint16_t>(wire::reg::kStationAddress.address);
    }
    [[nodiscard]] std::uint16_t alias() const {
        return registers_.get<std::uint16_t>(wire::reg::kStationAlias.address);
    }
    [[nodiscard]] std::uint16_t read_write_offset() const {
        return registers_.get<std::uint16_t>(wire::reg::kPhysicalReadWriteOffset.address);
    }
    [[nodiscard]] bool alias_enabled() const { return alias_enabled_; }
    // What it ORs into the IRQ field of every datagram.
    [[nodiscard]] std::uint16_t irq() const { return irq_; }
    // First and last logical address of all FMMUs; first > last: none.
    [[nodiscard]] std::uint32_t logical_first() const { return logical_first_; }
    [[nodiscard]] std::uint32_t logical_last() const { return logical_last_; }
    // Counts up whenever one of the five above may have changed.
    [[nodiscard]] std::uint32_t configuration() const { return configuration_; }

    // --- Ports, seen by the segment ---
    void set_dl_status(std::uint16_t link_bits);
    void set_link(unsigned port, bool link) { mii_.set_link(port, link); }
    // Counts up whenever loops are to be set anew: written, with the same value too, or reset.
    [[nodiscard]] std::uint32_t loops_written() const { return loops_written_; }
    [[nodiscard]] std::uint32_t dl_control() const {
        return registers_.get<std::uint32_t>(wire::reg::kDlControl.address);
    }

    // Error counters, which stop at 255. Forwarded: somebody before has seen the error already.
    void count_rx_error(unsigned port, bool forwarded);
    void count_lost_link(unsigned port);
    void count_processing_error();

    // --- Time ---
    // When advance() has something to do.
    [[nodiscard]] Time next_event() const { return next_event_; }
    void advance(Time now);
    // How many events advance() has worked off since the ESC was made. Whatever a master writes, this grows by less
    // than 1.3 million for each second of simulated time: pulses come in bundles of 10 µs, and a program steps once a
    // microsecond at most.
    [[nodiscard]] std::uint64_t work() const { return work_; }

    // --- The PDI's side ---
    void read(std::uint16_t address, MutableBytes into) noexcept override;
    void write(std::uint16_t address, Bytes data) noexcept override;
    [[nodiscard]] Time now() noexcept override { return now_; }

    // --- The world outside ---
    // An edge at a latch input.
    void latch(unsigned input, bool rising, Time at);
    // The firmware hangs, until the next power-up.
    void halt_firmware(Time now);
    // From now on the clock runs at another rate.
    void set_drift(std::int32_t ppb, Time now);
    [[nodiscard]] const DcClock& clock() const { return clock_; }
    [[nodiscard]] const SyncUnit& sync() const { return sync_; }

    // --- For tests and faults ---
    [[nodiscard]] SiiUnit& sii() { return sii_; }
    [[nodiscard]] const SyncManagers& sync_managers() const { return sync_managers_; }
    [[nodiscard]] RegisterFile& registers() { return registers_; }
    [[nodiscard]] const RegisterFile& registers() const { return registers_; }
    // Octets as they stand in registers and RAM, without any effect.
    [[nodiscard]] std::vector<std::byte> peek(std::uint16_t address, std::size_t count) const;
    [[nodiscard]] std::span<std::byte> ram() { return ram_; }

  private:
    struct Write {
        std::uint16_t address = 0;
        std::uint16_t length = 0;
        std::uint16_t offset = 0;
    };
    struct Mapping {  // what an active FMMU maps in one direction, in bits
        std::uint64_t logical = 0;
        std::uint64_t logical_end = 0;
        std::uint64_t physical = 0;
        bool octets = false;       // whole octets on both sides
        std::int8_t channel = -1;  // the SyncManager whose buffer it maps, the whole of it and nothing else
    };
    // Of one direction, without overlaps: n FMMUs make 2n − 1 parts at most.
    struct Mappings {
        unsigned count = 0;
        std::array<Mapping, 2 * kMaxFmmus> at{};
        void add(Mapping mapping);
    };

    bool access(Side side, bool write, std::uint32_t address, std::byte* data, std::size_t length, Time at);
    bool access_plain(Side side, bool write, std::uint32_t address, std::byte* data, std::size_t length, Time at);
    bool access_ram(bool write, std::uint32_t address, std::byte* data, std::size_t length);
    bool read_registers(Side side, std::uint32_t address, std::byte* data, std::size_t length, Time at);
    bool write_registers(std::uint32_t address, const std::byte* data, std::size_t length);
    bool write_registers_pdi(std::uint32_t address, const std::byte* data, std::size_t length, Time at);
    [[nodiscard]] bool writable(std::uint32_t address) const;
    bool map(const Mapping& mapping, bool write, std::uint32_t address, MutableBytes data, Time at);
    bool map_bits(const Mapping& mapping, bool write, std::uint64_t first, std::uint64_t end, std::uint32_t address,
                  MutableBytes data, Time at);
    void before_write(std::uint32_t address, MutableBytes into) const;
    std::uint16_t ecat_exchange(std::uint32_t address, MutableBytes data, Time at);
    void link_mappings();
    bool map_buffer(const Mapping& mapping, bool write, std::byte* data, Time at);
    bool map_all(const Mappings& mappings, bool write, std::uint32_t address, MutableBytes data, Time at);

    void refresh(std::uint32_t address, std::size_t length, Side side, Time at);
    void take_over(const Write& write, const FrameEnd& end);
    void written(std::uint32_t address, std::size_t length, bool from_pdi, Time at);
    void was_read(std::uint32_t address, std::size_t length, Side side);
    void al_control_written();
    void temporary_loops(Time at);
    void end_temporary_loops();
    [[nodiscard]] bool sync_registers_are_pdis(std::uint32_t address) const;
    void reload_mappings();
    void handle(const SyncManagers::Events& events, Time at) {
        if (events.any()) carry_out(events, at);
    }
    void carry_out(const SyncManagers::Events& events, Time at);
    void set_al_events(std::uint32_t bits, Time at);
    void wake_firmware(Time at);
    void clear_al_events(std::uint32_t bits);
    void change_ecat_events(std::uint16_t set, std::uint16_t clear);
    void count(std::uint32_t address);
    void power_up_registers();
    void start_pdi(Time now);
    [[nodiscard]] bool dc_on() const { return dc_on_; }
    void settle_sii(Time at);
    void written_dc(std::uint32_t address, std::size_t length, Time at);
    void written_watchdog(std::uint32_t address, std::size_t length, Time at);
    void latches_read(unsigned edges);
    void latch_receive_times(const FrameEnd& end);
    void reset_written(bool from_pdi, Time at);
    void update_dl_status();
    void lay_out();
    void schedule();

    // What every frame looks at comes first: a thousand ESCs do not fit into a cache with all they have.
    Time now_{};
    Time firmware_due_ = kNever;
    Time next_event_ = kNever;
    std::unique_ptr<Firmware> firmware_;
    std::uint32_t logical_first_ = 1;
    std::uint32_t logical_last_ = 0;
    std::uint32_t configuration_ = 0;
    std::uint32_t loops_written_ = 0;
    std::uint32_t al_events_ = 0;  // AL event request, 0x0220
    std::size_t writes_ = 0;
    std::size_t write_bytes_used_ = 0;
    std::uint16_t effects_ = 0;  // bits of Effect: registers read that do something at the end of the frame
    std::uint16_t irq_ = 0;
    bool alias_enabled_ = false;
    bool al_control_unread_ = false;
    bool register_writes_enabled_ = false;  // by 0x0020 in this frame
    bool esc_writes_enabled_ = false;       // by 0x0030 in this frame
    bool protected_ = false;                // 0x0021 or 0x0031
    bool halted_ = false;
    bool pdi_operational_ = false;
    bool dc_on_ = false;
    bool end_expected_ = false;  // of the frame now passing
    bool exchanges_ = false;     // a logical octet is read and written
    std::vector<std::byte> ram_;
    SyncManagers sync_managers_;
    Mappings read_mappings_;
    Mappings write_mappings_;
    Watchdogs watchdogs_;
    EscDescription description_;
    RegisterFile registers_;
    SiiUnit sii_;
    MiiUnit mii_;
    DcClock clock_;
    SyncUnit sync_;

    // What the frame now passing has written into registers, and read with an effect.
    static constexpr std::size_t kMaxWrites = 128;
    std::array<Write, kMaxWrites> write_list_{};
    std::array<std::byte, 1536> write_bytes_{};
    std::array<std::uint8_t, 2> reset_step_{};  // of the magic word in 0x0040 and 0x0041
    bool reset_wanted_ = false;
    std::uint8_t lasting_loops_ = 0;
    std::uint16_t link_bits_ = 0;
    std::uint32_t compare_with_ = 0;  // low half of what was written to the system time
    std::uint64_t work_ = 0;
    Time loops_end_ = kNever;  // of temporary loop settings
};

}  // namespace margay::sim
