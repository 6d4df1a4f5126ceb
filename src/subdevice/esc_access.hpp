// The interface between the slave stack and the ESC: the memory that the PDI shows. On hardware an SPI or bus driver
// implements it, in the simulation the PDI side of a simulated ESC.
//
// To port: derive a class and implement read(), write() and now(). Accesses must execute in the order of the calls and
// must not wait for the master. An access may be split into several transfers, in ascending order of addresses: a
// SyncManager opens a buffer at its first octet and hands it over at its last octet. A register of up to eight octets
// should be transferred at once, because its value may change in between. Addresses are ESC addresses (registers below
// 0x1000, process memory from 0x1000).
//
// A device whose interrupt handlers call Device::interrupt(), sync0() or sync1() also implements lock() and unlock().
#pragma once

#include "util/bytes.hpp"

#include <margay/time.hpp>

#include <cstdint>

namespace margay::subdevice {

class EscAccess {
  public:
    virtual void read(std::uint16_t address, MutableBytes into) noexcept = 0;
    virtual void write(std::uint16_t address, Bytes data) noexcept = 0;

    // A monotonic clock. Its resolution limits the resolution of the stack's timeouts.
    [[nodiscard]] virtual Time now() noexcept = 0;

    // A critical section: between lock() and unlock(), no other context (interrupt handler, thread) executes
    // Device::step(), interrupt(), sync0(), sync1() or process() of the same device. Sections nest: lock() returns the
    // state from before, and unlock() gets that state back. On a microcontroller lock() returns PRIMASK (or BASEPRI)
    // and masks the interrupts of the ESC; unlock() restores the register. With threads both use a recursive mutex.
    // The stack holds the lock for one access of at most kMostLockedBytes octets, for the copy of one value of an
    // object (with complete access, too: each value by itself), and for one update of the process data. So the longest
    // value of the tables, and the process data, determine the longest time. device.hpp names the functions of an
    // author that execute with the lock held.
    [[nodiscard]] virtual std::uint32_t lock() noexcept { return 0; }
    virtual void unlock(std::uint32_t before) noexcept { (void)before; }

    static constexpr std::size_t kMostLockedBytes = 64;

  protected:
    ~EscAccess() = default;
};

// Locks in the constructor and unlocks in the destructor. nullptr: there is no lock.
class Guard {
  public:
    explicit Guard(EscAccess& esc) : esc_(&esc), before_(esc.lock()) {}
    explicit Guard(EscAccess* esc) : esc_(esc), before_(esc != nullptr ? esc->lock() : 0) {}
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;
    ~Guard() {
        if (esc_ != nullptr) esc_->unlock(before_);
    }

  private:
    EscAccess* esc_;
    std::uint32_t before_;
};

}  // namespace margay::subdevice
