// An ESC of plain memory with only the behaviour that the tests of the slave stack need: AL events, mailbox handshake,
// SyncManager locks. The tests act as the master through the ecat_… functions. The register-accurate model is in
// margay_sim.
#pragma once

#include "subdevice/esc_access.hpp"
#include "wire/sync_manager.hpp"

#include <margay/al_state.hpp>

#include <initializer_list>
#include <vector>

namespace margay::subdevice::testing {

namespace al_event = wire::al_event;

inline std::vector<std::byte> raw(std::initializer_list<int> values) {
    std::vector<std::byte> out;
    for (const int v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

class PlainEsc final : public EscAccess {
  public:
    static constexpr unsigned kSyncManagers = 8;
    PlainEsc() : memory_(0x4000) {
        ecat_set<std::uint16_t>(0x0400, 0x09C2);
        ecat_set<std::uint16_t>(0x0420, 1000);
        ecat_set<std::uint16_t>(0x0440, 1);
        memory_[0x0005] = std::byte{kSyncManagers};
    }

    // Accesses of the slave.
    void read(std::uint16_t address, MutableBytes into) noexcept override {
        ++accesses;
        for (std::size_t i = 0; i < into.size(); ++i) into[i] = memory_[address + i];
        if (address <= 0x0120 && address + into.size() > 0x0120) clear(al_event::kAlControl);
        if (address <= 0x098E && address + into.size() > 0x098E) clear(al_event::kDcSync0);
        if (address <= 0x098F && address + into.size() > 0x098F) clear(al_event::kDcSync1);
        if (address <= 0x0440 && address + into.size() > 0x0440) clear(al_event::kWatchdog);
        for (unsigned n = 0; n < kSyncManagers; ++n) {
            const auto activate = wire::reg::sync_manager(n).address + 6u;
            if (address <= activate && address + into.size() > activate) clear(al_event::kSmActivation);
            const auto sm = sync_manager(n);
            if (!sm.enabled() || !sm.ecat_writes()) continue;
            if (address == sm.physical_start) opened(n, 1);
            if (hits_last(sm, address, into.size())) set_full(n, false);
        }
    }
    void write(std::uint16_t address, Bytes data) noexcept override {
        ++accesses;
        for (std::size_t i = 0; i < data.size(); ++i) memory_[address + i] = data[i];
        for (unsigned n = 0; n < kSyncManagers; ++n) {
            if (address == wire::reg::sync_manager(n).address + 7u && (get<std::uint8_t>(address) & 1) != 0) {
                set_full(n, false);
            }
            const auto sm = sync_manager(n);
            if (!sm.enabled() || sm.ecat_writes()) continue;
            if (address == sm.physical_start) opened(n, 2);
            if (sm.mailbox() && hits_last(sm, address, data.size())) set_full(n, true);
        }
    }
    [[nodiscard]] Time now() noexcept override { return time; }

    // Accesses of the master. False: the working counter of the datagram would be 0.
    bool ecat_write(std::uint16_t address, Bytes data) {
        for (unsigned n = 0; n < kSyncManagers; ++n) {
            const auto sm = sync_manager(n);
            if (!covers(sm, address)) continue;
            if (locked(n) || !sm.ecat_writes() || (sm.mailbox() && full(n))) return false;
            for (std::size_t i = 0; i < data.size(); ++i) memory_[address + i] = data[i];
            if (hits_last(sm, address, data.size())) {
                if (sm.mailbox()) set_full(n, true);
                handed_over(n, sm, 1);
            }
            return true;
        }
        for (std::size_t i = 0; i < data.size(); ++i) memory_[address + i] = data[i];
        if (address <= 0x0120 && address + data.size() > 0x0120) raise(al_event::kAlControl);
        for (unsigned n = 0; n < kSyncManagers; ++n) {
            const auto activate = wire::reg::sync_manager(n).address + 6u;
            if (address <= activate && address + data.size() > activate) raise(al_event::kSmActivation);
        }
        return true;
    }
    bool ecat_read(std::uint16_t address, MutableBytes into) {
        for (unsigned n = 0; n < kSyncManagers; ++n) {
            const auto sm = sync_manager(n);
            if (!covers(sm, address)) continue;
            if (locked(n) || sm.ecat_writes() || (sm.mailbox() && !full(n))) return false;
            for (std::size_t i = 0; i < into.size(); ++i) into[i] = memory_[address + i];
            if (hits_last(sm, address, into.size())) {
                set_full(n, false);
                handed_over(n, sm, 2);
            }
            return true;
        }
        for (std::size_t i = 0; i < into.size(); ++i) into[i] = memory_[address + i];
        return true;
    }
    template <class T>
    void ecat_set(std::uint16_t address, T value) {
        std::array<std::byte, sizeof(T)> bytes{};
        store_le(MutableBytes(bytes), 0, value);
        (void)ecat_write(address, bytes);
    }
    template <class T>
    [[nodiscard]] T get(std::uint16_t address) const {
        return load_le<T>(Bytes(memory_).subspan(address));
    }
    void configure(unsigned n, const wire::SyncManager& sm) {
        std::array<std::byte, 8> bytes{};
        wire::store_sync_manager(bytes, sm);
        const auto address = wire::reg::sync_manager(n).address;
        bytes[7] = memory_[address + 7u];  // the octet of the PDI
        (void)ecat_write(address, bytes);
    }
    void al_control(std::uint16_t value) { ecat_set(0x0120, value); }
    [[nodiscard]] AlStatus al_status() const {
        const auto word = get<std::uint16_t>(0x0130);
        return {static_cast<AlState>(word & 0x0F), (word & 0x10) != 0, get<std::uint16_t>(0x0134)};
    }
    [[nodiscard]] std::uint32_t events() const { return get<std::uint32_t>(0x0220); }
    void raise(std::uint32_t bits) { store_le(MutableBytes(memory_), 0x0220, events() | bits); }
    [[nodiscard]] bool full(unsigned n) const { return (get<std::uint8_t>(status_of(n)) & 8) != 0; }
    [[nodiscard]] bool locked(unsigned n) const {
        return (get<std::uint8_t>(static_cast<std::uint16_t>(status_of(n) + 2)) & 1) != 0;
    }
    [[nodiscard]] wire::SyncManager sync_manager(unsigned n) const {
        return wire::load_sync_manager(Bytes(memory_).subspan(wire::reg::sync_manager(n).address, 8));
    }

    Time time{};
    std::uint64_t accesses = 0;  // accesses of the slave

  private:
    static std::uint16_t status_of(unsigned n) {
        return static_cast<std::uint16_t>(wire::reg::sync_manager(n).address + 5u);
    }
    static bool covers(const wire::SyncManager& sm, unsigned address) {
        return sm.enabled() && address >= sm.physical_start && address < unsigned{sm.physical_start} + sm.length_bytes;
    }
    static bool hits_last(const wire::SyncManager& sm, unsigned address, std::size_t size) {
        const unsigned last = unsigned{sm.physical_start} + sm.length_bytes - 1u;
        return sm.length_bytes != 0 && address <= last && address + size > last;
    }
    // Status bits 0 (written) and 1 (read) of a SyncManager, and its AL event when the control octet enables it.
    void handed_over(unsigned n, const wire::SyncManager& sm, unsigned bit) {
        if (sm.length_bytes == 1) return;  // not activated: only a watchdog trigger
        memory_[status_of(n)] |= static_cast<std::byte>(bit);
        if ((sm.control & wire::sm_control::kPdiInterrupt) != 0) raise(al_event::sync_manager(n));
    }
    void opened(unsigned n, unsigned bit) {
        memory_[status_of(n)] &= ~static_cast<std::byte>(bit);
        clear(al_event::sync_manager(n));
    }
    void clear(std::uint32_t bits) { store_le(MutableBytes(memory_), 0x0220, events() & ~bits); }
    void set_full(unsigned n, bool full) {
        auto& status = memory_[status_of(n)];
        status = full ? status | std::byte{8} : status & ~std::byte{8};
    }

    std::vector<std::byte> memory_;
};

}  // namespace margay::subdevice::testing
