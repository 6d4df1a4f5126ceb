#include "oshw/pcap/packet_reader.hpp"

#include <pcap/pcap.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

namespace margay {
namespace {

constexpr std::int64_t kLongestSeconds = 10LL * 366 * 86'400;  // far below the maximum of a Duration
constexpr std::string_view kRecordElsewhere = "record on the interface itself, not on \"any\"";

// Replaces an error text of libpcap for a file that cannot be opened, if this text is not clear.
std::string open_problem(std::string_view said) {
    if (said.find("unknown file format") != said.npos || said.find("bad dump file format") != said.npos)
        return "it is neither pcap nor pcapng";
    if (said.find("truncated") != said.npos) return "it is too short for a recording (" + std::string(said) + ")";
    return "it cannot be read (" + std::string(said) + ")";
}

std::string name_of_link_type(int type) {
    const char* name = pcap_datalink_val_to_description(type);
    return name != nullptr ? std::string(name) : std::to_string(type);
}

// Except for a few types, the number of the link type is the number of libpcap. The other types have no name here.
std::string words_of(const LeftOutInterface& interface) {
    std::string name;
    constexpr std::size_t kMostName = 64;
    for (const char c : interface.name.substr(0, kMostName)) name += c < ' ' || c >= 0x7F ? '?' : c;
    return "interface " + std::to_string(interface.number) + " (" + (name.empty() ? "" : name + ", ") + "link type " +
           name_of_link_type(interface.link_type) + ", " + std::to_string(interface.packets) +
           (interface.packets == 1 ? " packet)" : " packets)");
}

// Whether the file begins as pcapng. Its octets are still to be read afterwards.
bool is_pcapng(std::FILE* file) {
    std::array<unsigned char, 4> begin{};
    const std::size_t got = std::fread(begin.data(), 1, begin.size(), file);
    for (std::size_t n = got; n != 0; --n) (void)std::ungetc(begin[n - 1], file);
    return got == begin.size() && load_le<std::uint32_t>(std::as_bytes(std::span(begin))) == pcapng::kSectionHeader;
}

}  // namespace

void PacketReader::Closer::operator()(pcap* file) const { pcap_close(file); }

PacketReader::PacketReader() noexcept = default;
PacketReader::~PacketReader() = default;

Result<> PacketReader::fail(std::string what) {
    problem_ = std::move(what);
    at_end_ = true;
    return Error{.code = Errc::nic, .step = Step::open_nic};
}

Result<> PacketReader::open(const std::string& path) {
    file_.reset();
    blocks_.reset();
    at_end_ = false;
    problem_.clear();
    cut_off_.clear();
    number_ = untimed_ = 0;
    first_.reset();
    first_is_left_out_ = false;
    last_ = Duration();
    PcapngReader::File from(path == "-" ? ::fdopen(::dup(STDIN_FILENO), "rb") : std::fopen(path.c_str(), "rbe"),
                            &std::fclose);
    if (!from) return fail("it cannot be read (" + path + ": " + std::strerror(errno) + ")");
    if (!is_pcapng(from.get())) return open_pcap(std::move(from));
    blocks_.emplace(std::move(from));
    return {};
}

Result<> PacketReader::open_pcap(PcapngReader::File from) {
    std::array<char, PCAP_ERRBUF_SIZE> said{};
    file_.reset(pcap_fopen_offline_with_tstamp_precision(from.get(), PCAP_TSTAMP_PRECISION_NANO, said.data()));
    if (!file_) return fail(open_problem(said.data()));
    (void)from.release();  // file_ closes it
    if (const int type = pcap_datalink(file_.get()); type != DLT_EN10MB)
        return fail("its link type is " + name_of_link_type(type) + ", not Ethernet; " + std::string(kRecordElsewhere));
    return {};
}

std::optional<CapturedPacket> PacketReader::next() {
    if (at_end_) return std::nullopt;
    return blocks_ ? next_of_pcapng() : next_of_pcap();
}

std::optional<Duration> PacketReader::time_of(std::uint64_t seconds, std::int64_t nanoseconds, bool is_ethernet) {
    constexpr std::uint64_t kLongest = kLongestSeconds;
    // An interface that is left out may have another clock. So the times begin with the first Ethernet packet.
    if (first_ && first_is_left_out_ && is_ethernet && seconds - first_->seconds + kLongest > 2 * kLongest)
        first_.reset();
    if (!first_) first_ = Time{seconds, nanoseconds};
    first_is_left_out_ = !is_ethernet;
    // Unsigned arithmetic, because a damaged time stamp may have any value.
    const auto since = static_cast<std::int64_t>(seconds - first_->seconds);
    if (since < -kLongestSeconds || since > kLongestSeconds) {
        (void)fail("packet " + std::to_string(number_) + " is years away from the first; its time is damaged");
        return std::nullopt;
    }
    last_ = std::chrono::seconds(since) + Duration(nanoseconds - first_->nanoseconds);
    return last_;
}

void PacketReader::end(const std::string& why, bool is_cut_off) {
    const auto text = "it breaks off or is damaged behind packet " + std::to_string(number_) + " (" + why + ")";
    at_end_ = true;
    (is_cut_off ? cut_off_ : problem_) = text;
}

std::optional<CapturedPacket> PacketReader::next_of_pcap() {
    pcap_pkthdr* header = nullptr;
    const u_char* data = nullptr;
    const int got = pcap_next_ex(file_.get(), &header, &data);
    if (got == 1) {
        ++number_;
        // With nanosecond precision, the field of microseconds counts nanoseconds.
        const auto at = time_of(static_cast<std::uint64_t>(header->ts.tv_sec), header->ts.tv_usec, true);
        if (!at) return std::nullopt;
        return CapturedPacket{*at, number_, std::as_bytes(std::span(data, header->caplen)), header->len, {}};
    }
    at_end_ = true;
    if (got == PCAP_ERROR) {
        const std::string why = pcap_geterr(file_.get());
        end(why, why.find("truncated") != why.npos);
    }
    return std::nullopt;
}

std::optional<CapturedPacket> PacketReader::next_of_pcapng() {
    while (const auto packet = blocks_->next()) {
        ++number_;
        if (!packet->timed)
            untimed_ += packet->ethernet ? 1 : 0;
        else if ((packet->ethernet || !first_) && !time_of(packet->seconds, packet->nanoseconds, packet->ethernet))
            return std::nullopt;
        if (packet->ethernet)
            return CapturedPacket{last_, number_, packet->bytes, packet->length_on_wire, packet->origin};
    }
    at_end_ = true;
    if (!blocks_->problem().empty())
        end(blocks_->problem(), false);
    else if (!blocks_->cut_off().empty())
        end(blocks_->cut_off(), true);
    const auto& all = blocks_->left_out();
    if (!problem_.empty() || !blocks_->numbers().empty() || all.empty()) return std::nullopt;
    problem_ = all.size() == 1 ? "its link type is " + name_of_link_type(all[0].link_type) + ", not Ethernet; "
                               : "it has no Ethernet interface: " + left_out() + "; ";
    problem_ += kRecordElsewhere;
    return std::nullopt;
}

std::string PacketReader::left_out() const {
    if (!blocks_) return {};
    constexpr std::size_t kNamed = 8;
    const auto& all = blocks_->left_out();
    std::string text;
    for (std::size_t n = 0; n < std::min(all.size(), kNamed); ++n) text += (n == 0 ? "" : ", ") + words_of(all[n]);
    if (all.size() > kNamed) text += " and " + std::to_string(all.size() - kNamed) + " more";
    return text;
}

}  // namespace margay
