#include "oshw/lan9118/lan9118.hpp"

#include <algorithm>
#include <cstring>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Registers on the bus (data sheet, table 5.1).
constexpr std::size_t kRxDataFifo = 0x00;
constexpr std::size_t kTxDataFifo = 0x20;
constexpr std::size_t kRxStatusFifo = 0x40;
constexpr std::size_t kTxStatusFifo = 0x48;
constexpr std::size_t kIrqCfg = 0x54;
constexpr std::size_t kIntSts = 0x58;
constexpr std::size_t kIntEn = 0x5C;
constexpr std::size_t kByteTest = 0x64;
constexpr std::size_t kFifoInt = 0x68;
constexpr std::size_t kRxCfg = 0x6C;
constexpr std::size_t kTxCfg = 0x70;
constexpr std::size_t kHwCfg = 0x74;
constexpr std::size_t kRxFifoInf = 0x7C;
constexpr std::size_t kTxFifoInf = 0x80;
constexpr std::size_t kPmtCtrl = 0x84;
constexpr std::size_t kRxDrop = 0xA0;
constexpr std::size_t kMacCsrCmd = 0xA4;
constexpr std::size_t kMacCsrData = 0xA8;

constexpr std::uint32_t kByteTestValue = 0x87654321;
constexpr std::uint32_t kPmtReady = 1U << 0;
constexpr std::uint32_t kPmtPhyReset = 1U << 10;
constexpr std::uint32_t kHwSoftReset = 1U << 0;
constexpr std::uint32_t kHwMustBeOne = 1U << 20;
constexpr std::uint32_t kHwTxFifo5KiB = 5U << 16;  // 4608 octets for sent frames, 10560 for received ones
constexpr std::uint32_t kTxOn = 1U << 1;
constexpr std::uint32_t kIrqEnable = 1U << 8;
constexpr std::uint32_t kIrqPushPull = 1U << 0;
constexpr std::uint32_t kIrqActiveHigh = 1U << 4;
constexpr std::uint32_t kRxStatusLevel = 1U << 3;  // interrupt: more frames than the level in FIFO_INT
constexpr std::uint32_t kSoftware = 1U << 31;      // interrupt: its enable bit was written
constexpr std::uint32_t kMacBusy = 1U << 31;
constexpr std::uint32_t kMacRead = 1U << 30;

// Words before a frame in the transmit FIFO (data sheet, section 3.12.2).
constexpr std::uint32_t kFirstSegment = 1U << 13;
constexpr std::uint32_t kLastSegment = 1U << 12;
constexpr std::size_t kCommandBytes = 8;

constexpr std::uint32_t kStatusError = 1U << 15;  // of both status FIFOs
constexpr std::size_t kFcsBytes = 4;
constexpr std::size_t kLeastBytes = 14;
constexpr std::size_t kMostBytes = 1518;
constexpr std::size_t kMostStored = 2560;  // the watchdog of the receiver cuts a longer frame (data sheet, section 5.4)

// Registers of the MAC (data sheet, table 5.6).
constexpr std::uint32_t kMacCr = 1;
constexpr std::uint32_t kAddrHigh = 2;
constexpr std::uint32_t kAddrLow = 3;
constexpr std::uint32_t kMiiAccess = 6;
constexpr std::uint32_t kMiiData = 7;
constexpr std::uint32_t kFullDuplex = 1U << 20;
constexpr std::uint32_t kTransmitter = 1U << 3;
constexpr std::uint32_t kReceiver = 1U << 2;
constexpr std::uint32_t kMiiBusy = 1U << 0;
constexpr std::uint32_t kMiiWrite = 1U << 1;
constexpr std::uint32_t kPhyAddress = 1U << 11;

// Registers of the PHY (IEEE 802.3, clause 22).
constexpr std::uint32_t kPhyControl = 0;
constexpr std::uint32_t kPhyStatus = 1;
constexpr std::uint32_t kPhyAdvertisement = 4;
constexpr std::uint32_t kNegotiateAgain = 1U << 12 | 1U << 9;
constexpr std::uint32_t kOnly100FullDuplex = 1U << 8 | 1U << 0;  // EtherCAT has no other mode
constexpr std::uint32_t kPhyLinkUp = 1U << 2;

// The MAC answers within a few accesses of the bus, the PHY within 64 clocks of 2.5 MHz.
constexpr unsigned kMostLooks = 100'000;

}  // namespace

Lan9118::Lan9118(volatile std::uint32_t* registers, const MacAddress& mac) noexcept : registers_(registers), mac_(mac) {
    mac_[0] &= 0xFC;
}

Result<> Lan9118::fail(std::string_view what) noexcept {
    problem_ = what;
    return Error{.code = Errc::nic, .step = Step::open_nic, .actual = read(kByteTest)};
}

bool Lan9118::wait_for(Osal& osal, std::size_t offset, std::uint32_t mask, std::uint32_t value) noexcept {
    const Time until = osal.now() + 100ms;
    while ((read(offset) & mask) != value) {
        if (osal.now() > until) return false;
        osal.wait(osal.now() + 1ms, -1);
    }
    return true;
}

Result<> Lan9118::open(Osal& osal) noexcept {
    problem_ = {};
    if (!wait_for(osal, kPmtCtrl, kPmtReady, kPmtReady)) return fail("the controller does not become ready");
    if (read(kByteTest) != kByteTestValue)
        return fail("BYTE_TEST is wrong: another chip, or a bus with another order of octets");
    write(kHwCfg, kHwSoftReset);
    if (!wait_for(osal, kHwCfg, kHwSoftReset, 0)) return fail("the reset of the controller does not end");
    write(kPmtCtrl, kPmtPhyReset);
    if (!wait_for(osal, kPmtCtrl, kPmtPhyReset, 0)) return fail("the reset of the PHY does not end");
    start();
    if (read_mac(kAddrHigh) != (mac_[4] | std::uint32_t{mac_[5]} << 8))
        return fail("the MAC does not keep its address");
    return {};
}

void Lan9118::start() noexcept {
    write(kHwCfg, kHwMustBeOne | kHwTxFifo5KiB);
    write(kIntEn, 0);
    write(kIntSts, ~0U);
    write(kFifoInt, 0);
    write(kIrqCfg, kIrqEnable | kIrqActiveHigh | kIrqPushPull);
    write(kRxCfg, 0);
    write_phy(kPhyAdvertisement, kOnly100FullDuplex);
    write_phy(kPhyControl, kNegotiateAgain);
    write_mac(kAddrHigh, mac_[4] | std::uint32_t{mac_[5]} << 8);
    write_mac(kAddrLow,
              mac_[0] | std::uint32_t{mac_[1]} << 8 | std::uint32_t{mac_[2]} << 16 | std::uint32_t{mac_[3]} << 24);
    write_mac(kMacCr, kFullDuplex | kTransmitter | kReceiver);
    write(kTxCfg, kTxOn);
    write(kIntEn, kRxStatusLevel);
}

bool Lan9118::mac_ready() noexcept {
    for (unsigned n = 0; n < kMostLooks; ++n)
        if ((read(kMacCsrCmd) & kMacBusy) == 0) return true;
    return false;
}

std::uint32_t Lan9118::read_mac(std::uint32_t index) noexcept {
    if (!mac_ready()) return 0;
    write(kMacCsrCmd, kMacBusy | kMacRead | index);
    return mac_ready() ? read(kMacCsrData) : 0;
}

void Lan9118::write_mac(std::uint32_t index, std::uint32_t value) noexcept {
    if (!mac_ready()) return;
    write(kMacCsrData, value);
    write(kMacCsrCmd, kMacBusy | index);
    (void)mac_ready();
}

bool Lan9118::phy_ready() noexcept {
    for (unsigned n = 0; n < kMostLooks; ++n)
        if ((read_mac(kMiiAccess) & kMiiBusy) == 0) return true;
    return false;
}

std::uint32_t Lan9118::read_phy(std::uint32_t index) noexcept {
    if (!phy_ready()) return 0;
    write_mac(kMiiAccess, kPhyAddress | index << 6 | kMiiBusy);
    return phy_ready() ? read_mac(kMiiData) : 0;
}

void Lan9118::write_phy(std::uint32_t index, std::uint32_t value) noexcept {
    if (!phy_ready()) return;
    write_mac(kMiiData, value);
    write_mac(kMiiAccess, kPhyAddress | index << 6 | kMiiWrite | kMiiBusy);
    (void)phy_ready();
}

void Lan9118::on_interrupt() noexcept { write(kIntEn, 0); }

// The status FIFO must not fill up, because the transmitter stops then.
void Lan9118::read_sent_states() noexcept {
    for (auto n = read(kTxFifoInf) >> 16 & 0xFF; n != 0; --n)
        if (const auto status = read(kTxStatusFifo); (status & kStatusError) != 0)
            last_error_ = static_cast<int>(status & 0xFFFF);
}

SendStatus Lan9118::send(std::span<const std::byte> frame) noexcept {
    if (frame.size() < kLeastBytes || frame.size() > kMostBytes) return SendStatus::failed;
    read_sent_states();
    const auto size = static_cast<std::uint32_t>(frame.size());
    const auto words = (frame.size() + 3) / 4;
    if ((read(kTxFifoInf) & 0xFFFF) < words * 4 + kCommandBytes) return SendStatus::busy;
    write(kTxDataFifo, kFirstSegment | kLastSegment | size);
    write(kTxDataFifo, size);
    // memcpy() because a frame may begin at any address.
    const std::byte* at = frame.data();
    std::uint32_t word = 0;
    for (std::size_t n = 0; n < frame.size() / 4; ++n, at += 4) {
        std::memcpy(&word, at, 4);
        write(kTxDataFifo, word);
    }
    if (const auto rest = frame.size() % 4; rest != 0) {
        word = 0;
        std::memcpy(&word, at, rest);
        write(kTxDataFifo, word);
    }
    return SendStatus::sent;
}

std::uint32_t Lan9118::stored_frames() const noexcept { return read(kRxFifoInf) >> 16 & 0xFF; }

// A wait() must end at once while frames are in the FIFO. The controller reports only the arrival of a frame, so its
// software interrupt is used for frames that are there already. A frame that arrives after the first line causes an
// interrupt of its own.
void Lan9118::allow_interrupt() noexcept {
    write(kIntSts, kRxStatusLevel | kSoftware);
    write(kIntEn, stored_frames() != 0 ? kRxStatusLevel | kSoftware : kRxStatusLevel);
}

// The number of frames is read once: a controller without supply reads as all ones, so it would always have another
// frame.
std::size_t Lan9118::receive(std::span<std::byte> into) noexcept {
    std::size_t length = 0;
    for (auto frames = stored_frames(); length == 0 && frames != 0; --frames) length = read_frame(into);
    allow_interrupt();
    return length;
}

// Reads the oldest frame from the FIFO. Returns 0 for a damaged frame.
std::size_t Lan9118::read_frame(std::span<std::byte> into) noexcept {
    const auto status = read(kRxStatusFifo);
    std::size_t length = status >> 16 & 0x3FFF;  // with FCS
    if (length > kMostStored) length = 0;        // this is no frame: the bus does not answer
    const bool good = (status & kStatusError) == 0 && length >= kLeastBytes + kFcsBytes;
    const auto wanted = good ? std::min(length - kFcsBytes, into.size()) : 0;
    auto* at = into.data();
    for (std::size_t octet = 0; octet < length; octet += 4) {
        const auto word = read(kRxDataFifo);
        if (octet >= wanted) continue;  // the FCS, or octets that do not fit
        const auto some = std::min<std::size_t>(4, wanted - octet);
        std::memcpy(at, &word, some);
        at += some;
    }
    if (!good) ++damaged_;
    return wanted;
}

LinkState Lan9118::link_state() noexcept {
    // The bit keeps a loss of the link until it is read.
    (void)read_phy(kPhyStatus);
    return (read_phy(kPhyStatus) & kPhyLinkUp) != 0 ? LinkState::up : LinkState::down;
}

std::uint32_t Lan9118::overruns() noexcept {
    overruns_ += read(kRxDrop);  // reading clears the counter
    return overruns_;
}

}  // namespace margay
