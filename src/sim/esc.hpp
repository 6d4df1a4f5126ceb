// One EtherCAT slave controller: its registers, its memory, and the effects of accesses by the master or the PDI.
// Segment calls the functions of the master's side; the PDI side is subdevice::EscAccess.
//
// As on the chip, register writes take effect at the end of the frame, and only if the FCS is correct ("shadow buffers
// for register write operations"). Process memory is written at once, but SyncManagers exchange their buffers at the
// end of the frame as well.
#pragma once

#include "sim/dc_clock.hpp"
#include "sim/esc_description.hpp"
#include "sim/fetch.hpp"
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
#include <cstddef>
#include <memory>
#include <vector>

namespace margay::sim {

// Information about a frame after it has passed the ESC.
struct FrameEnd {
    bool good = true;   // FCS and structure are correct
    Time at{};          // the last octet has passed
    Time processing{};  // the first bit reached the processing unit
    // Arrival of the first bit at each port; kNever: the frame did not arrive at this port.
    std::array<Time, kMaxPorts> ports{kNever, kNever, kNever, kNever};
};

class Esc final : public subdevice::EscAccess {
  public:
    // `sii` is the content of the EEPROM. The device has no power until power_up().
    Esc(const EscDescription& description, std::vector<std::byte> sii);

    // Sets the program behind the PDI; nullptr: an ESC without a processor. Call it before power_up().
    void set_firmware(std::unique_ptr<Firmware> firmware) {
        firmware_ = std::move(firmware);
        firmware_polls_ = firmware_ && firmware_->polls();
        accesses_feed_ = firmware_ && !firmware_->feeds_pdi_watchdog();
    }
    [[nodiscard]] Firmware* firmware() { return firmware_.get(); }
    // The process data of the firmware; nullptr if there is none, or while the PDI does not work (start_pdi()).
    [[nodiscard]] ProcessDataFirmware* process_data() {
        return firmware_ && pdi_operational_ ? firmware_->process_data() : nullptr;
    }

    // The Ethernet port of the firmware; nullptr if there is none.
    [[nodiscard]] EthernetPort* ethernet() { return firmware_ ? firmware_->ethernet() : nullptr; }
    // The half of a bridge between two segments; nullptr if the device is none.
    [[nodiscard]] BridgeHalf* bridge() { return firmware_ ? firmware_->bridge() : nullptr; }
    // An interrupt of the firmware that does not come from the ESC, for example from its Ethernet port.
    void interrupt(Time now);

    void power_up(Time now);
    [[nodiscard]] const EscDescription& description() const { return description_; }

    // --- The master's side. `at`: the time when the frame reaches the processing unit. ---

    // Access to physical memory: registers and process memory. Octets of `data` that cannot be read stay unchanged.
    // Returns true when at least one octet was accessed.
    bool ecat_read(std::uint32_t address, MutableBytes data, Time at);
    bool ecat_write(std::uint32_t address, Bytes data, Time at);
    // LRD, LWR, LRW: returns the increment of the working counter.
    std::uint16_t ecat_logical(bool read, bool write, std::uint32_t address, MutableBytes data, Time at);
    // The end of a frame that accessed the ESC: executes the pending register writes, or discards them when the frame
    // is bad.
    void frame_end(const FrameEnd& end);
    // The same as frame_pending(), but true only once per frame.
    [[nodiscard]] bool newly_pending() { return !end_expected_ && (end_expected_ = frame_pending()); }
    // Prefetch the data that ecat_logical() needs into the processor's cache: fetch_state() the ESC itself,
    // fetch_buffers() the memory that it points to.
    void fetch_state() const {
        fetch(&now_, 512);
        fetch(&read_mappings_, kMappingBytes);
        fetch(&write_mappings_, kMappingBytes);
        fetch(&watchdogs_, 1);
    }
    // Prefetch the data that advance() needs, in this order: the ESC, its firmware, and what the firmware needs.
    void fetch_events() const { fetch(&now_, 512); }
    void fetch_firmware() const { fetch(firmware_.get(), 1); }
    void fetch_step() const {
        if (firmware_) firmware_->fetch();
        fetch_buffers();
    }
    void fetch_buffers() const {
        for (const auto offset : mapped_ram_) fetch(ram_.data() + offset, 1);
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
    // The bits that this ESC ORs into the IRQ field of every datagram.
    [[nodiscard]] std::uint16_t irq() const { return irq_; }
    // First and last logical address of all FMMUs; first > last: no active FMMU.
    [[nodiscard]] std::uint32_t logical_first() const { return logical_first_; }
    [[nodiscard]] std::uint32_t logical_last() const { return logical_last_; }
    // Incremented when station(), alias(), alias_enabled(), irq() or the logical range may have changed.
    [[nodiscard]] std::uint32_t configuration() const { return configuration_; }

    // --- Ports, used by the segment ---
    void set_dl_status(std::uint16_t link_bits);
    void set_link(unsigned port, bool link) { mii_.set_link(port, link); }
    // Incremented when the loop control was written (also with the same value) or reset.
    [[nodiscard]] std::uint32_t loops_written() const { return loops_written_; }
    [[nodiscard]] std::uint32_t dl_control() const {
        return registers_.get<std::uint32_t>(wire::reg::kDlControl.address);
    }

    // Error counters, which stop at 255. `forwarded`: an earlier slave has already detected the error.
    void count_rx_error(unsigned port, bool forwarded);
    void count_lost_link(unsigned port);
    void count_processing_error();

    // --- Time ---
    // The next time at which advance() has work to do.
    [[nodiscard]] Time next_event() const { return *next_event_; }
    // From now on next_event() is kept in `place`, so that a segment finds the ESCs that have work without access to
    // all of them. nullptr: in the ESC. The place must outlive the ESC or the next call.
    void keep_next_event_in(Time* place);
    void advance(Time now);
    // Number of events that advance() has processed since construction. Whatever a master writes, this number grows by
    // less than 1.3 million per second of simulated time, because pulses are processed in groups of 10 µs and a program
    // steps at most once per microsecond.
    [[nodiscard]] std::uint64_t work() const { return work_; }

    // --- The PDI side ---
    void read(std::uint16_t address, MutableBytes into) noexcept override;
    void write(std::uint16_t address, Bytes data) noexcept override;
    [[nodiscard]] Time now() noexcept override { return now_; }

    // --- External signals and faults ---
    // An edge at a latch input.
    void latch(unsigned input, bool rising, Time at);
    // The firmware stops until the next power-up.
    void halt_firmware(Time now);
    // Changes the drift of the clock from now on.
    void set_drift(std::int32_t ppb, Time now);
    [[nodiscard]] const DcClock& clock() const { return clock_; }
    [[nodiscard]] const SyncUnit& sync() const { return sync_; }

    // --- For tests and fault injection ---
    [[nodiscard]] SiiUnit& sii() { return sii_; }
    [[nodiscard]] const SyncManagers& sync_managers() const { return sync_managers_; }
    [[nodiscard]] RegisterFile& registers() { return registers_; }
    [[nodiscard]] const RegisterFile& registers() const { return registers_; }
    // Reads octets from registers and RAM without side effects.
    [[nodiscard]] std::vector<std::byte> peek(std::uint16_t address, std::size_t count) const;
    [[nodiscard]] std::span<std::byte> ram() { return ram_; }

  private:
    struct Write {
        std::uint16_t address = 0;
        std::uint16_t length = 0;
        std::uint16_t offset = 0;
    };
    struct Mapping {  // the mapping of an active FMMU for one direction, in bits
        std::uint64_t logical = 0;
        std::uint64_t logical_end = 0;
        std::uint64_t physical = 0;
        bool octets = false;       // both sides start and end at octet boundaries
        std::int8_t channel = -1;  // the SyncManager whose whole buffer is mapped, and nothing else; -1: none
    };
    // The mappings of one direction, without overlaps: n FMMUs result in at most 2n − 1 parts.
    struct Mappings {
        unsigned count = 0;
        std::array<Mapping, 2 * kMaxFmmus> at{};
        void add(Mapping mapping);
    };
    static constexpr std::size_t kMappingBytes = offsetof(Mappings, at) + sizeof(Mapping);  // up to the first one

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
    void apply_write(const Write& write, const FrameEnd& end);
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
    void set_sync_events(std::uint32_t pulses, Time at);
    void end_sync_pulses();
    void wake_firmware(Time at);
    void feed_pdi_watchdog();
    // The PDI interrupt is active.
    [[nodiscard]] bool interrupt_active() const { return (al_events_ & al_mask_) != 0; }
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
    void advance_units();

    // Members that every frame accesses are first, because a thousand complete ESCs do not fit into a cache.
    Time now_{};
    Time* next_event_ = &own_next_event_;
    Time firmware_due_ = kNever;
    Time others_due_ = kNever;  // everything but the firmware: not later than its next event
    std::unique_ptr<Firmware> firmware_;
    Duration firmware_latency_;
    std::uint64_t work_ = 0;
    // Times of the last buffer events: change by the master, start and change by the PDI; kNever: none.
    std::array<Time, 3> buffer_times_{kNever, kNever, kNever};
    std::uint32_t logical_first_ = 1;
    std::uint32_t logical_last_ = 0;
    std::uint32_t configuration_ = 0;
    std::uint32_t loops_written_ = 0;
    std::uint32_t al_events_ = 0;  // AL event request, 0x0220
    std::uint32_t al_mask_ = 0;    // AL event mask, 0x0204
    bool firmware_polls_ = false;
    bool accesses_feed_ = false;  // only accesses of the firmware trigger the PDI watchdog
    std::size_t writes_ = 0;
    std::size_t write_bytes_used_ = 0;
    std::uint16_t effects_ = 0;  // bits of Effect: registers that were read and act at the end of the frame
    std::uint16_t irq_ = 0;
    bool alias_enabled_ = false;
    bool al_control_unread_ = false;
    bool register_writes_enabled_ = false;  // enabled by a write to 0x0020 in this frame
    bool esc_writes_enabled_ = false;       // enabled by a write to 0x0030 in this frame
    bool protected_ = false;                // write protection by 0x0021 or 0x0031
    bool halted_ = false;
    bool pdi_operational_ = false;
    bool dc_on_ = false;
    bool end_expected_ = false;  // for the current frame
    bool exchanges_ = false;     // some logical octets are both read and written
    bool reset_wanted_ = false;
    std::array<std::uint32_t, 2> mapped_ram_{};  // where the first mapping of each direction begins, in ram_
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

    // Register writes of the current frame, and registers read with an effect.
    static constexpr std::size_t kMaxWrites = 128;
    std::array<Write, kMaxWrites> write_list_{};
    std::array<std::byte, 1536> write_bytes_{};
    std::array<std::uint8_t, 2> reset_step_{};  // progress in the reset sequence of 0x0040 and 0x0041
    std::uint8_t lasting_loops_ = 0;
    std::uint16_t link_bits_ = 0;
    std::uint32_t compare_with_ = 0;  // low 32 bits of the value written to the system time
    std::uint32_t activations_ = 0;   // SyncManagers whose activation has changed since the PDI read it
    // Ends of the pulses of SYNC0 and SYNC1 that are visible in the AL event request.
    std::array<Time, 2> pulse_ends_{kNever, kNever};
    Time own_next_event_ = kNever;
    Time loops_end_ = kNever;  // end of temporary loop settings
};

}  // namespace margay::sim
