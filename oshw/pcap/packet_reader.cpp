#include "oshw/pcap/packet_reader.hpp"

#include <pcap/pcap.h>

#include <string_view>
#include <utility>

namespace margay {
namespace {

constexpr std::int64_t kLongestSeconds = 10LL * 366 * 86'400;  // far below the maximum of a Duration

// Translates an error text of libpcap for a file that cannot be opened, where this text is not clear.
std::string open_problem(std::string_view said) {
    if (said.find("unknown file format") != said.npos || said.find("bad dump file format") != said.npos)
        return "it is neither pcap nor pcapng";
    if (said.find("truncated") != said.npos) return "it is too short for a recording (" + std::string(said) + ")";
    return "it cannot be read (" + std::string(said) + ")";
}

}  // namespace

void PacketReader::Closer::operator()(pcap* file) const { pcap_close(file); }

PacketReader::PacketReader() noexcept = default;
PacketReader::~PacketReader() = default;

Result<> PacketReader::fail(std::string what) {
    problem_ = std::move(what);
    file_.reset();
    return Error{.code = Errc::nic, .step = Step::open_nic};
}

Result<> PacketReader::open(const std::string& path) {
    problem_.clear();
    cut_off_.clear();
    number_ = 0;
    char said[PCAP_ERRBUF_SIZE] = {};
    file_.reset(pcap_open_offline_with_tstamp_precision(path.c_str(), PCAP_TSTAMP_PRECISION_NANO, said));
    if (!file_) return fail(open_problem(said));
    if (const int type = pcap_datalink(file_.get()); type != DLT_EN10MB) {
        const char* name = pcap_datalink_val_to_description(type);
        return fail("its link type is " + (name != nullptr ? std::string(name) : std::to_string(type)) +
                    ", not Ethernet; record on the interface itself, not on \"any\"");
    }
    return {};
}

std::optional<CapturedPacket> PacketReader::next() {
    if (!file_) return std::nullopt;
    pcap_pkthdr* header = nullptr;
    const u_char* data = nullptr;
    const int got = pcap_next_ex(file_.get(), &header, &data);
    if (got == 1) {
        if (++number_ == 1) {
            first_seconds_ = header->ts.tv_sec;
            first_nanoseconds_ = header->ts.tv_usec;  // with nanosecond precision, the field counts nanoseconds
        }
        // Unsigned arithmetic, because a damaged time stamp may have any value.
        const auto seconds = static_cast<std::int64_t>(static_cast<std::uint64_t>(header->ts.tv_sec) -
                                                       static_cast<std::uint64_t>(first_seconds_));
        if (seconds < -kLongestSeconds || seconds > kLongestSeconds) {
            (void)fail("packet " + std::to_string(number_) + " is years away from the first; its time is damaged");
            return std::nullopt;
        }
        const Duration at = std::chrono::seconds(seconds) + Duration(header->ts.tv_usec - first_nanoseconds_);
        return CapturedPacket{at, number_, std::as_bytes(std::span(data, header->caplen)), header->len};
    }
    if (got == PCAP_ERROR) {
        const std::string why = pcap_geterr(file_.get());
        const auto text = "it breaks off or is damaged behind packet " + std::to_string(number_) + " (" + why + ")";
        if (why.find("truncated") != why.npos)
            cut_off_ = text;
        else if (why.find("different from the type of the first interface") != why.npos)
            (void)fail(
                "its interfaces have different link types; record on Ethernet interfaces only, not on \"any\" "
                "beside them (" +
                why + ")");
        else
            (void)fail(text);
    }
    file_.reset();
    return std::nullopt;
}

}  // namespace margay
