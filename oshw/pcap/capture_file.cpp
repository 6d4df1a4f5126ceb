#include "oshw/pcap/capture_file.hpp"

#include "wire/ethernet.hpp"

#include <cstring>
#include <string>

namespace margay {
namespace {

constexpr std::size_t kVlanTagBytes = 4;

bool is_vlan_tag(std::uint16_t ether_type) { return ether_type == 0x8100 || ether_type == 0x88A8; }

}  // namespace

Result<> CaptureFile::fail(const std::string& path, const std::string& what) {
    problem_ = "recording " + path + ": " + what;
    frames_.clear();
    bytes_.clear();
    return Error{.code = Errc::nic, .step = Step::open_nic};
}

Result<> CaptureFile::load(const std::string& path, CutOff cut_off) {
    problem_.clear();
    remark_.clear();
    frames_.clear();
    bytes_.clear();
    skipped_ = 0;
    PacketReader reader;
    if (!reader.open(path)) return fail(path, reader.problem());
    while (const auto packet = reader.next()) {
        const auto problem = add(*packet);
        if (!problem.empty()) return fail(path, "packet " + std::to_string(packet->number) + " " + problem);
    }
    if (!reader.problem().empty()) return fail(path, reader.problem());
    if (!reader.cut_off().empty()) {
        if (cut_off == CutOff::refuse) return fail(path, reader.cut_off());
        remark_ = "recording " + path + ": it ends in the middle of a packet; the " + std::to_string(reader.packets()) +
                  " packets before are used";
    }
    if (const auto left_out = reader.left_out(); !left_out.empty())
        remark_ = (remark_.empty() ? "recording " + path + ": " : remark_ + "; ") +
                  "left out is what is not Ethernet: " + left_out;
    if (frames_.empty())
        return fail(path, "it holds no EtherCAT frame" + (remark_.empty() ? std::string() : " (" + remark_ + ")"));
    return {};
}

// The first frame of each NIC must be a frame that this NIC has sent.
bool CaptureFile::is_of_ring(std::array<MacAddress, 2>& macs) const noexcept {
    std::array<bool, 2> known{};
    for (const auto& frame : frames_) {
        const std::uint32_t at = frame.origin.interface;
        if (at >= known.size()) return false;
        if (known[at] || frame.reply) continue;
        const auto source = bytes(frame).subspan(wire::kSourceMacOffset, macs[at].size());
        std::memcpy(macs[at].data(), source.data(), source.size());
        known[at] = true;
    }
    return known[0] && known[1] && macs[0] != macs[1];
}

std::string CaptureFile::add(const CapturedPacket& captured) {
    const Bytes packet = captured.bytes;
    const std::size_t length_on_wire = captured.length_on_wire;
    if (packet.size() < wire::kEthernetHeaderBytes) {
        ++skipped_;
        return {};
    }
    const auto ether_type = wire::load_ether_type(packet);
    if (is_vlan_tag(ether_type) && packet.size() >= wire::kEthernetHeaderBytes + kVlanTagBytes &&
        wire::load_ether_type(packet.subspan(kVlanTagBytes)) == wire::kEtherTypeEtherCat)
        return "is EtherCAT in a VLAN tag; record on the port of the segment, where there is none";
    if (ether_type != wire::kEtherTypeEtherCat) {
        ++skipped_;
        return {};
    }
    if (packet.size() < length_on_wire)
        return "was recorded cut to " + std::to_string(packet.size()) + " of its " + std::to_string(length_on_wire) +
               " octets; record with full length";
    const bool reply = (packet[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0};
    frames_.push_back({captured.at, reply, captured.number, bytes_.size(), packet.size(), captured.origin});
    bytes_.insert(bytes_.end(), packet.begin(), packet.end());
    return {};
}

}  // namespace margay
