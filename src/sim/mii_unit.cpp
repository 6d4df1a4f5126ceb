#include "sim/mii_unit.hpp"

namespace margay::sim {

namespace {

namespace reg = wire::reg;

// 0x0510
constexpr std::uint16_t kWriteEnable = 0x0001;
constexpr std::uint16_t kLinkDetection = 0x0004;
constexpr std::uint16_t kCommandMask = 0x0300;
constexpr std::uint16_t kCommandRead = 0x0100;
constexpr std::uint16_t kCommandWrite = 0x0200;
constexpr std::uint16_t kReadError = 0x2000;
constexpr std::uint16_t kCommandError = 0x4000;
constexpr std::uint16_t kBusy = 0x8000;

constexpr Duration kAccessTime = std::chrono::microseconds(26);  // 64 bits at 2.5 MHz

}  // namespace

void MiiUnit::power_up(RegisterFile& registers, const EscDescription& chip) {
    registers_ = &registers;
    done_ = kNever;
    command_ = 0;
    link_ = {};
    written_ = {};
    for (unsigned p = 0; p < kMaxPorts; ++p)
        present_[p] = chip.mii_management && chip.ports[p].kind == wire::PortKind::mii;
    if (chip.mii_management) show(0);
}

void MiiUnit::set_link(unsigned port, bool link) {
    link_[port] = link;
    if (!present_[port]) return;
    const auto at = static_cast<std::uint16_t>(reg::kMiiPortStatus.address + port);
    registers_->set<std::uint8_t>(at, link ? 0x03 : 0x00);  // link of the PHY, link detected by the ESC
}

void MiiUnit::show(std::uint16_t status) {
    registers_->set(reg::kMiiControl.address, static_cast<std::uint16_t>(status | kLinkDetection));
}

void MiiUnit::written(std::uint32_t address, std::size_t length, bool from_pdi, Time at) {
    const auto covers = [&](std::uint32_t a) { return address <= a && a < address + length; };
    if (!covers(reg::kMiiControl.address) && !covers(reg::kMiiControl.address + 1u)) return;
    const auto value = registers_->get<std::uint16_t>(reg::kMiiControl.address);
    if (done_ != kNever && done_ <= at) settle(at);
    if (done_ != kNever) return show(static_cast<std::uint16_t>(kBusy | command_));
    const bool with_pdi = (registers_->get<std::uint8_t>(reg::kMiiPdiAccess.address) & 1) != 0;
    if (with_pdi != from_pdi) return show(0);
    command_ = value & kCommandMask;
    if (command_ == 0) return show(value & kWriteEnable);
    const bool write = command_ == kCommandWrite;
    if ((write && (value & kWriteEnable) == 0) || (command_ != kCommandRead && !write)) {
        command_ = 0;
        return show(kCommandError);
    }
    done_ = at + kAccessTime;
    show(static_cast<std::uint16_t>(kBusy | command_));
}

void MiiUnit::settle(Time now) {
    if (done_ > now) return;
    done_ = kNever;
    finish();
}

void MiiUnit::finish() {
    const unsigned port = registers_->get<std::uint8_t>(reg::kMiiPhyAddress.address) & 0x1F;
    const unsigned number = registers_->get<std::uint8_t>(reg::kMiiPhyRegister.address) & 0x1F;
    const auto command = command_;
    command_ = 0;
    if (port >= kMaxPorts || !present_[port]) return show(kReadError);
    if (command == kCommandRead)
        registers_->set(reg::kMiiPhyData.address, phy_register(port, number));
    else
        written_[port][number] = registers_->get<std::uint16_t>(reg::kMiiPhyData.address);
    show(0);
}

std::uint16_t MiiUnit::phy_register(unsigned port, unsigned number) const {
    switch (number) {
        case 0: return 0x3100;  // 100 Mbit/s, full duplex, negotiated
        case 1: return static_cast<std::uint16_t>(0x7809 | (link_[port] ? 0x0024 : 0));  // link, negotiation complete
        case 2: return 0x4D47;                                                           // own PHY identifiers
        case 3: return 0x0010;
        case 4: return 0x0101;
        case 5: return link_[port] ? 0x4101 : 0x0000;
        default: return written_[port][number];
    }
}

}  // namespace margay::sim
