#include "analyse/manners.hpp"

#include "wire/esc.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace margay::analyse {

using wire::Command;
namespace reg = wire::reg;

namespace {

using Address = std::array<std::uint8_t, 6>;

constexpr Address kSoem{0x01, 0x01, 0x01, 0x01, 0x01, 0x01};
constexpr Address kEthercrab{0x10, 0x10, 0x10, 0x10, 0x10, 0x10};
constexpr Address kKickCat{0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF};
constexpr Address kLibethercat{0x00, 0x30, 0x64, 0x0F, 0x83, 0x35};
// "\0MARGY": the source address on an interface without an address of its own, for example a simulated segment.
constexpr Address kMargay{0x00, 0x4D, 0x41, 0x52, 0x47, 0x59};
constexpr std::uint8_t kSoemIndices = 16;

Address without_mark(Address address) {
    address[0] = static_cast<std::uint8_t>(address[0] & ~std::to_integer<unsigned>(wire::kPassedEscBit));
    return address;
}

// Whether the frame contains the broadcast writes by which the scan of Margay resets the slaves: all FMMUs, all
// SyncManagers, SYNC, the EEPROM twice, the alias.
bool has_margay_reset(Bytes frame) {
    struct Write {
        std::uint16_t ado, length;
    };
    constexpr std::array<Write, 6> kReset{Write{reg::fmmu(0).address, 16 * reg::kFmmuStride},
                                          {reg::sync_manager(0).address, 16 * reg::kSyncManagerStride},
                                          {reg::kSyncActivation.address, 1},
                                          {reg::kSiiConfig.address, 1},
                                          {reg::kSiiConfig.address, 1},
                                          {reg::kAliasEnable.address, 1}};
    wire::DatagramReader reader(frame);
    std::size_t matched = 0;
    while (const auto d = reader.next()) {
        const auto matches = [&](const Write& w) {
            return d->header.command == Command::BWR && d->header.address.ado() == w.ado &&
                   d->header.length == w.length;
        };
        matched = matches(kReset[matched]) ? matched + 1 : matches(kReset[0]) ? 1 : 0;
        if (matched == kReset.size()) return true;
    }
    return false;
}

std::string text_of(const Address& a) {
    std::array<char, 20> text{};
    (void)std::snprintf(text.data(), text.size(), "%02x:%02x:%02x:%02x:%02x:%02x", a[0], a[1], a[2], a[3], a[4], a[5]);
    return text.data();
}

}  // namespace

void Manners::frame(Bytes request) {
    constexpr std::size_t kMost = 8;
    Address address{};
    for (std::size_t i = 0; i < address.size(); ++i)
        address[i] = std::to_integer<std::uint8_t>(request[wire::kSourceMacOffset + i]);
    if (addresses_.size() < kMost) addresses_.insert(address);
    margay_reset_ = margay_reset_ || has_margay_reset(request);
}

void Manners::datagram(const Exchanged& e) {
    const auto& h = e.header;
    greatest_index_ = std::max(greatest_index_, h.index);
    const auto is = [&](Command command, std::uint16_t ado, std::uint16_t length) {
        return h.command == command && h.address.ado() == ado && h.length == length;
    };
    if (is(Command::APWR, reg::kStationAddress.address, 2) && e.sent.size() == 2 && !first_station_)
        first_station_ = load_le<std::uint16_t>(e.sent);
    if (is(Command::FPRD, reg::kDlStatus.address + 1, 1)) ++link_looks_;
    if (is(Command::FPRD, reg::kAlStatus.address, 6)) ++status_looks_;
    if (is(Command::FPRD, reg::kSiiControl.address, 10)) ++sii_triples_;
    if (is(Command::FPWR, reg::kSiiControl.address, 4)) ++sii_commands_;
}

void Manners::finish() {
    auto& guess = analysis_.master;
    const bool replies = analysis_.directions == Directions::replies_only;
    if (replies) {
        std::set<Address> unmarked;
        for (const auto& address : addresses_) unmarked.insert(without_mark(address));
        addresses_ = std::move(unmarked);
    }
    for (const auto& address : addresses_) guess.addresses.push_back(text_of(address));
    const auto from = [&](const Address& address) {
        return addresses_.count(replies ? without_mark(address) : address) != 0;
    };
    const auto say = [&](std::string name, std::vector<std::string> reasons) {
        guess.name = std::move(name);
        guess.reasons = std::move(reasons);
    };
    if (margay_reset_)
        return say("Margay",
                   {"resets FMMUs, SyncManagers, SYNC, EEPROM and alias of all slaves by six broadcast writes "
                    "in one frame"});
    if (from(kMargay)) return say("Margay", {"source address 00:4d:41:52:47:59"});
    if (from(kSoem) && greatest_index_ < kSoemIndices)
        return say("SOEM", {"source address 01:01:01:01:01:01", "no index above 15"});
    if (from(kEthercrab)) return say("ethercrab", {"source address 10:10:10:10:10:10"});
    if (from(kKickCat)) return say("KickCAT", {"source address ca:de:ca:de:de:ff"});
    if (from(kLibethercat)) return say("libethercat", {"source address 00:30:64:0f:83:35"});
    if (link_looks_ != 0 && status_looks_ != 0 && sii_triples_ == 0)
        return say("TwinCAT", {"reads the octet 0x0111 of single slaves for their links",
                               "reads 6 octets from 0x0130 of single slaves"});
    if (sii_triples_ != 0 && sii_commands_ != 0 && first_station_.value_or(1) == 1)
        return say("IgH EtherCAT Master", {"reads the SII by 4 octets written to 0x0502 and 10 octets read from there",
                                           "station addresses begin with 1"});
}

}  // namespace margay::analyse
