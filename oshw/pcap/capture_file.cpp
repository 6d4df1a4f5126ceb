#include "oshw/pcap/capture_file.hpp"

#include "wire/ethernet.hpp"

#include <pcap/pcap.h>

#include <memory>
#include <string_view>

namespace margay {
namespace {

struct PcapCloser {
    void operator()(pcap_t* pcap) const { pcap_close(pcap); }
};

constexpr std::size_t kVlanTagBytes = 4;
constexpr std::int64_t kLongestSeconds = 10LL * 366 * 86'400;  // far below the maximum of a Duration

bool is_vlan_tag(std::uint16_t ether_type) { return ether_type == 0x8100 || ether_type == 0x88A8; }

// Translates an error text of libpcap for a file that cannot be opened, where this text is not clear.
std::string open_problem(std::string_view said) {
    if (said.find("unknown file format") != said.npos || said.find("bad dump file format") != said.npos)
        return "it is neither pcap nor pcapng";
    if (said.find("truncated") != said.npos) return "it is too short for a recording (" + std::string(said) + ")";
    return "it cannot be read (" + std::string(said) + ")";
}

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
    char said[PCAP_ERRBUF_SIZE] = {};
    const std::unique_ptr<pcap_t, PcapCloser> file(
        pcap_open_offline_with_tstamp_precision(path.c_str(), PCAP_TSTAMP_PRECISION_NANO, said));
    if (!file) return fail(path, open_problem(said));
    if (const int type = pcap_datalink(file.get()); type != DLT_EN10MB) {
        const char* name = pcap_datalink_val_to_description(type);
        return fail(path, "its link type is " + (name != nullptr ? std::string(name) : std::to_string(type)) +
                              ", not Ethernet; record on the interface itself, not on \"any\"");
    }
    pcap_pkthdr* header = nullptr;
    const u_char* data = nullptr;
    std::uint64_t number = 0;
    pcap_pkthdr first{};
    int got = 0;
    while ((got = pcap_next_ex(file.get(), &header, &data)) == 1) {
        if (++number == 1) first = *header;
        // Unsigned arithmetic, because a damaged time stamp may have any value.
        const auto seconds = static_cast<std::int64_t>(static_cast<std::uint64_t>(header->ts.tv_sec) -
                                                       static_cast<std::uint64_t>(first.ts.tv_sec));
        if (seconds < -kLongestSeconds || seconds > kLongestSeconds)
            return fail(path,
                        "packet " + std::to_string(number) + " is years away from the first; its time is damaged");
        // With nanosecond precision, the field tv_usec counts nanoseconds.
        const Duration at = std::chrono::seconds(seconds) + Duration(header->ts.tv_usec - first.ts.tv_usec);
        const auto problem = add(at, number, std::as_bytes(std::span(data, header->caplen)), header->len);
        if (!problem.empty()) return fail(path, "packet " + std::to_string(number) + " " + problem);
    }
    if (got == PCAP_ERROR) {
        const std::string why = pcap_geterr(file.get());
        const bool cut = why.find("truncated") != why.npos;
        if (!cut || cut_off == CutOff::refuse)
            return fail(path, "it breaks off or is damaged behind packet " + std::to_string(number) + " (" + why + ")");
        remark_ = "recording " + path + ": it ends in the middle of a packet; the " + std::to_string(number) +
                  " packets before are used";
    }
    if (frames_.empty()) return fail(path, "it holds no EtherCAT frame");
    return {};
}

std::string CaptureFile::add(Duration at, std::uint64_t number, Bytes packet, std::size_t length_on_wire) {
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
    frames_.push_back({at, reply, number, bytes_.size(), packet.size()});
    bytes_.insert(bytes_.end(), packet.begin(), packet.end());
    return {};
}

}  // namespace margay
