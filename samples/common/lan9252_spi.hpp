// The ESC access of the slave stack over the SPI of a LAN9252 (data sheet DS00001909, chapters 9 "SPI/SQI slave" and
// 12 "EtherCAT"). It accesses ESC registers through the CSR command and data registers, and process memory through the
// two FIFOs. An access to a register is split into accesses of at most four octets, because the chip has no larger
// ones. It uses no heap and no exceptions, and only the SPI of the board.
#pragma once

#include "subdevice/esc_access.hpp"

#include <algorithm>
#include <array>

namespace margay::samples {

// The board provides these functions: one full-duplex SPI transfer during which chip select is active, and a clock.
class SpiBus {
  public:
    virtual void transfer(MutableBytes in_and_out) noexcept = 0;
    [[nodiscard]] virtual Time now() noexcept = 0;
    // For a device whose interrupt handlers use this SPI: see EscAccess::lock().
    [[nodiscard]] virtual std::uint32_t lock() noexcept { return 0; }
    virtual void unlock(std::uint32_t before) noexcept { (void)before; }

  protected:
    ~SpiBus() = default;
};

class Lan9252 final : public subdevice::EscAccess {
  public:
    explicit Lan9252(SpiBus& spi) : spi_(spi) {}

    // Call it after a reset: waits until the chip returns its byte order test value and its ready bit. Returns false
    // when this does not happen within `tries` reads.
    [[nodiscard]] bool begin(unsigned tries = 100'000) noexcept {
        for (; tries > 0; --tries)
            if (load(kByteTest) == kByteTestValue && (load(kHardwareConfig) & kReady) != 0) return true;
        return false;
    }
    // Makes the IRQ pin (push-pull, active high) follow the AL event request, masked by the AL event mask (0x0204).
    void enable_interrupt() noexcept {
        store(kInterruptConfig, kIrqEnable | kIrqActiveHigh | kIrqPushPull);
        store(kInterruptEnable, kEtherCatEvent);
    }
    // True when the chip did not complete an access. The data of such a read are zero.
    [[nodiscard]] bool failed() const noexcept { return failed_; }

    void read(std::uint16_t address, MutableBytes into) noexcept override {
        while (!into.empty()) {
            const auto bytes =
                address < kProcessRam ? csr_bytes(address, into.size()) : std::min(into.size(), kBlockBytes);
            const auto part = into.first(bytes);
            if (address < kProcessRam) {
                read_csr(address, part);
            } else {
                read_fifo(address, part);
            }
            address = static_cast<std::uint16_t>(address + bytes);
            into = into.subspan(bytes);
        }
    }
    void write(std::uint16_t address, Bytes data) noexcept override {
        while (!data.empty()) {
            const auto bytes =
                address < kProcessRam ? csr_bytes(address, data.size()) : std::min(data.size(), kBlockBytes);
            const auto part = data.first(bytes);
            if (address < kProcessRam) {
                write_csr(address, part);
            } else {
                write_fifo(address, part);
            }
            address = static_cast<std::uint16_t>(address + bytes);
            data = data.subspan(bytes);
        }
    }
    [[nodiscard]] Time now() noexcept override { return spi_.now(); }
    [[nodiscard]] std::uint32_t lock() noexcept override { return spi_.lock(); }
    void unlock(std::uint32_t before) noexcept override { spi_.unlock(before); }

  private:
    static constexpr std::uint16_t kProcessRam = 0x1000;
    // Addresses of system registers.
    static constexpr std::uint16_t kReadFifo = 0x000;
    static constexpr std::uint16_t kWriteFifo = 0x020;
    static constexpr std::uint16_t kInterruptConfig = 0x054;
    static constexpr std::uint16_t kInterruptEnable = 0x05C;
    static constexpr std::uint16_t kByteTest = 0x064;
    static constexpr std::uint16_t kHardwareConfig = 0x074;
    static constexpr std::uint16_t kCsrData = 0x300;
    static constexpr std::uint16_t kCsrCommand = 0x304;
    static constexpr std::uint16_t kReadAddress = 0x308;
    static constexpr std::uint16_t kReadCommand = 0x30C;
    static constexpr std::uint16_t kWriteAddress = 0x310;
    static constexpr std::uint16_t kWriteCommand = 0x314;
    // Bits of these registers.
    static constexpr std::uint32_t kByteTestValue = 0x87654321;
    static constexpr std::uint32_t kReady = 1u << 27;
    static constexpr std::uint32_t kIrqEnable = 1u << 8;
    static constexpr std::uint32_t kIrqActiveHigh = 1u << 4;
    static constexpr std::uint32_t kIrqPushPull = 1u << 0;
    static constexpr std::uint32_t kEtherCatEvent = 1u << 0;
    static constexpr std::uint32_t kBusy = 1u << 31;  // in all three command registers
    static constexpr std::uint32_t kCsrRead = 1u << 30;
    static constexpr std::uint32_t kAbort = 1u << 30;  // in the FIFO command registers
    // In the FIFO command registers: number of double words that are available, or free.
    static constexpr unsigned kCountShift = 8;
    static constexpr std::uint32_t kCountMask = 0x1F;

    static constexpr std::byte kSpiRead{0x03};
    static constexpr std::byte kSpiWrite{0x02};
    static constexpr std::size_t kSpiHead = 3;
    // 16 double words, where up to 3 octets of the first one can be unused.
    static constexpr std::size_t kBlockBytes = 64 - 4;
    static constexpr unsigned kPatience = 1000;  // number of reads of a busy bit before an access fails

    // The address stays the same for all double words of a transfer, as the FIFOs require.
    void transfer(std::byte instruction, std::uint16_t address, std::size_t bytes) noexcept {
        buffer_[0] = instruction;
        buffer_[1] = static_cast<std::byte>(address >> 8);
        buffer_[2] = static_cast<std::byte>(address & 0xFF);
        spi_.transfer(MutableBytes(buffer_).first(kSpiHead + bytes));
    }
    [[nodiscard]] std::uint32_t load(std::uint16_t address) noexcept {
        transfer(kSpiRead, address, 4);
        return load_le<std::uint32_t>(buffer_, kSpiHead);
    }
    void store(std::uint16_t address, std::uint32_t value) noexcept {
        store_le<std::uint32_t>(buffer_, kSpiHead, value);
        transfer(kSpiWrite, address, 4);
    }
    // Waits until the busy bit is clear and returns the register. Sets failed() when the bit stays set.
    std::uint32_t settle(std::uint16_t command) noexcept {
        for (unsigned n = 0; n < kPatience; ++n)
            if (const auto value = load(command); (value & kBusy) == 0) return value;
        failed_ = true;
        return 0;
    }
    // Waits until the FIFO count is at least `words` double words.
    bool wait_for(std::uint16_t command, std::size_t words) noexcept {
        for (unsigned n = 0; n < kPatience; ++n)
            if ((load(command) >> kCountShift & kCountMask) >= words) return true;
        failed_ = true;
        return false;
    }

    // A CSR access has 1, 2 or 4 octets, and its address is a multiple of its size.
    static std::size_t csr_bytes(std::uint16_t address, std::size_t left) noexcept {
        if (address % 4 == 0 && left >= 4) return 4;
        return address % 2 == 0 && left >= 2 ? 2 : 1;
    }
    void read_csr(std::uint16_t address, MutableBytes into) noexcept {
        store(kCsrCommand, kBusy | kCsrRead | static_cast<std::uint32_t>(into.size() << 16) | address);
        (void)settle(kCsrCommand);
        const auto value = load(kCsrData);
        for (std::size_t i = 0; i < into.size(); ++i) into[i] = static_cast<std::byte>(value >> (8 * i));
    }
    void write_csr(std::uint16_t address, Bytes data) noexcept {
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < data.size(); ++i) value |= std::to_integer<std::uint32_t>(data[i]) << (8 * i);
        store(kCsrData, value);
        store(kCsrCommand, kBusy | static_cast<std::uint32_t>(data.size() << 16) | address);
        (void)settle(kCsrCommand);
    }

    // The first double word begins at the address rounded down to a multiple of four.
    void read_fifo(std::uint16_t address, MutableBytes into) noexcept {
        const std::size_t skipped = address % 4;
        const auto words = (skipped + into.size() + 3) / 4;
        store(kReadCommand, kAbort);
        (void)settle(kReadCommand);
        store(kReadAddress, static_cast<std::uint32_t>(into.size() << 16) | address);
        store(kReadCommand, kBusy);
        if (!wait_for(kReadCommand, words)) {
            std::fill(into.begin(), into.end(), std::byte{0});
            return;
        }
        transfer(kSpiRead, kReadFifo, 4 * words);
        std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(kSpiHead + skipped), into.size(), into.begin());
        (void)settle(kReadCommand);
    }
    void write_fifo(std::uint16_t address, Bytes data) noexcept {
        const std::size_t skipped = address % 4;
        const auto words = (skipped + data.size() + 3) / 4;
        store(kWriteCommand, kAbort);
        (void)settle(kWriteCommand);
        store(kWriteAddress, static_cast<std::uint32_t>(data.size() << 16) | address);
        store(kWriteCommand, kBusy);
        if (!wait_for(kWriteCommand, words)) return;
        std::copy(data.begin(), data.end(), buffer_.begin() + static_cast<std::ptrdiff_t>(kSpiHead + skipped));
        transfer(kSpiWrite, kWriteFifo, 4 * words);
        (void)settle(kWriteCommand);
    }

    SpiBus& spi_;
    bool failed_ = false;
    std::array<std::byte, kSpiHead + 64> buffer_{};
};

}  // namespace margay::samples
