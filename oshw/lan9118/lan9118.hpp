// The Ethernet controller LAN9118 of SMSC (now Microchip) and its relatives LAN9115, LAN9116, LAN9117, LAN9215 to
// LAN9221, on a memory bus of 32 bits. The processor copies the frames to and from the FIFOs of the controller.
//
// Registers and FIFOs: LAN9118 data sheet, chapters 3 (operation) and 5 (registers).
#pragma once

#include "osal/osal.hpp"
#include "oshw/nic.hpp"

#include <margay/result.hpp>

#include <atomic>
#include <string_view>

namespace margay {

class Lan9118 final : public Nic {
  public:
    // `registers`: the address of the controller on the bus. `mac`: the address of this station; bits 0 and 1 of the
    // first octet are cleared.
    Lan9118(volatile std::uint32_t* registers, const MacAddress& mac) noexcept;

    // Resets the controller and its PHY, and starts both. `osal` gives the time for this only. Waits up to 300 ms, not
    // for a link. On failure, problem() has the reason. Error: nic.
    [[nodiscard]] Result<> open(Osal& osal) noexcept;
    // One sentence about the last failed open(); empty after success.
    [[nodiscard]] std::string_view problem() const noexcept { return problem_; }

    // To be called by the interrupt of the controller. Blocks the interrupt in the controller until the next
    // receive(); the interrupt then calls wake() of the osal. A program without this interrupt polls.
    void on_interrupt() noexcept;

    // Copies the frame into the FIFO of the controller; busy if it has no room for the whole frame.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    // Frames with a wrong FCS or of an illegal length are dropped and counted.
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    // Reads two registers of the PHY, which takes about 100 µs; do not call it in every cycle.
    [[nodiscard]] LinkState link_state() noexcept override;
    // In full duplex the controller never receives its own frames.
    [[nodiscard]] bool hides_own_frames() const noexcept override { return true; }
    [[nodiscard]] MacAddress source_mac() const noexcept override { return mac_; }
    // The last transmit status with an error, or 0.
    [[nodiscard]] int last_error() const noexcept override { return last_error_; }

    // Received frames that were damaged, and frames that the controller dropped because its FIFO was full.
    [[nodiscard]] std::uint32_t damaged() const noexcept { return damaged_; }
    [[nodiscard]] std::uint32_t overruns() noexcept;

  private:
    [[nodiscard]] std::uint32_t read(std::size_t offset) const noexcept { return registers_[offset / 4]; }
    void write(std::size_t offset, std::uint32_t value) noexcept { registers_[offset / 4] = value; }
    [[nodiscard]] bool wait_for(Osal& osal, std::size_t offset, std::uint32_t mask, std::uint32_t value) noexcept;
    [[nodiscard]] bool mac_ready() noexcept;
    [[nodiscard]] std::uint32_t read_mac(std::uint32_t index) noexcept;
    void write_mac(std::uint32_t index, std::uint32_t value) noexcept;
    [[nodiscard]] bool phy_ready() noexcept;
    [[nodiscard]] std::uint32_t read_phy(std::uint32_t index) noexcept;
    void write_phy(std::uint32_t index, std::uint32_t value) noexcept;
    Result<> fail(std::string_view what) noexcept;
    void start() noexcept;
    void read_sent_states() noexcept;
    [[nodiscard]] std::uint32_t stored_frames() const noexcept;
    [[nodiscard]] std::size_t read_frame(std::span<std::byte> into) noexcept;
    void allow_interrupt() noexcept;

    volatile std::uint32_t* registers_;
    MacAddress mac_;
    std::string_view problem_;
    int last_error_ = 0;
    std::uint32_t damaged_ = 0;
    std::uint32_t overruns_ = 0;
};

}  // namespace margay
