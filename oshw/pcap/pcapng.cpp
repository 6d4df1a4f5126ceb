#include "oshw/pcap/pcapng.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

namespace margay {
namespace {

// Block types, option codes and the meaning of epb_flags: draft-ietf-opsawg-pcapng, sections 3 and 4.
constexpr std::uint32_t kSectionHeader = 0x0A0D0D0A;
constexpr std::uint32_t kInterface = 1;
constexpr std::uint32_t kObsoletePacket = 2;  // libpcap reads it, too
constexpr std::uint32_t kSimplePacket = 3;
constexpr std::uint32_t kStatistics = 5;  // of an interface
constexpr std::uint32_t kEnhancedPacket = 6;
constexpr std::uint32_t kByteOrderMagic = 0x1A2B3C4D;
constexpr std::uint16_t kOptionEnd = 0;
constexpr std::uint16_t kComment = 1;
constexpr std::uint16_t kFlags = 2;          // of a packet
constexpr std::uint16_t kInterfaceName = 2;  // of an interface
constexpr std::uint16_t kTimeResolution = 9;
constexpr std::uint16_t kDroppedByInterface = 5;  // of statistics: packets since the recording began
constexpr std::uint16_t kDroppedBySystem = 7;
constexpr std::uint32_t kReceived = 1;  // of epb_flags
constexpr std::uint32_t kSent = 2;
constexpr std::uint32_t kDirectionBits = 3;
constexpr std::uint16_t kEthernet = 1;  // link type
constexpr std::size_t kEnhancedHead = 28;
constexpr std::size_t kStatisticsHead = 20;
constexpr std::size_t kSmallestBlock = 12;
constexpr std::size_t kLargestBlock = std::size_t{16} << 20;  // larger than any packet of libpcap
constexpr std::string_view kRefusedText = "not accepted by the NIC";

constexpr std::size_t padded(std::size_t octets) { return (octets + 3) / 4 * 4; }
Bytes octets_of(std::string_view text) { return std::as_bytes(std::span(text)); }

// A block: type, length, body, and the length again. The file is little-endian.
class Block {
  public:
    explicit Block(std::uint32_t type) noexcept {
        add(type);
        add(std::uint32_t{0});
    }
    template <class T>
    Block& add(T value) noexcept {
        store_le(bytes_, size_, value);
        size_ += sizeof value;
        return *this;
    }
    Block& add(Bytes octets) noexcept {
        std::ranges::copy(octets, bytes_.begin() + static_cast<std::ptrdiff_t>(size_));
        const std::size_t end = size_ + octets.size();
        size_ = padded(end);
        std::memset(bytes_.data() + end, 0, size_ - end);
        return *this;
    }
    Block& option(std::uint16_t code, Bytes value) noexcept {
        return add(code).add(static_cast<std::uint16_t>(value.size())).add(value);
    }
    void write(std::FILE* file) noexcept {
        add(static_cast<std::uint32_t>(size_ + 4));
        store_le(bytes_, 4, static_cast<std::uint32_t>(size_));
        (void)std::fwrite(bytes_.data(), 1, size_, file);
    }
    static constexpr std::size_t kMost = 2048;  // an Ethernet frame with its options

  private:
    std::array<std::byte, kMost> bytes_;
    std::size_t size_ = 0;
};

class OriginReader {
  public:
    explicit OriginReader(std::FILE* file) : file_(file) {}

    std::vector<PacketOrigin> read() {
        while (next_block()) {
            const std::uint32_t type = word(0);
            if (type == kEnhancedPacket && block_.size() >= kEnhancedHead + 4)
                all_.push_back(enhanced());
            else if (type == kObsoletePacket)
                all_.push_back({.interface = half(8)});
            else if (type == kSimplePacket)
                all_.push_back({});
            else if (type == kStatistics && block_.size() >= kStatisticsHead + 4)
                note_dropped();
        }
        return std::move(all_);
    }
    [[nodiscard]] std::uint64_t dropped() const {
        std::uint64_t sum = 0;
        for (const auto& [interface, count] : dropped_) sum += count;
        return sum;
    }

  private:
    [[nodiscard]] std::uint32_t word(std::size_t at) const {
        return big_endian_ ? static_cast<std::uint32_t>(swapped(at)) << 16 | swapped(at + 2)
                           : load_le<std::uint32_t>(block_, at);
    }
    [[nodiscard]] std::uint16_t half(std::size_t at) const {
        return big_endian_ ? swapped(at) : load_le<std::uint16_t>(block_, at);
    }
    [[nodiscard]] std::uint16_t swapped(std::size_t at) const {
        const auto value = load_le<std::uint16_t>(block_, at);
        return static_cast<std::uint16_t>(value << 8 | value >> 8);
    }
    bool fill(std::size_t octets) {
        const std::size_t before = block_.size();
        block_.resize(before + octets);
        return std::fread(block_.data() + before, 1, octets, file_) == octets;
    }
    // False at the end, and where the file is damaged.
    bool next_block() {
        block_.clear();
        if (!fill(kSmallestBlock)) return false;
        if (load_le<std::uint32_t>(block_) == kSectionHeader) {  // the same octets in both byte orders
            const auto magic = load_le<std::uint32_t>(block_, 8);
            big_endian_ = magic != kByteOrderMagic;
            in_section_ = true;
            ++section_;
        }
        const std::size_t length = word(4);
        if (!in_section_ || length < kSmallestBlock || length > kLargestBlock || length % 4 != 0) return false;
        return fill(length - kSmallestBlock);
    }
    // Calls take(code, place, length) for each option of the block.
    template <class Take>
    void options(std::size_t at, Take take) const {
        while (at + 4 <= block_.size() - 4 && half(at) != kOptionEnd) {
            const std::size_t length = half(at + 2);
            if (at + 4 + padded(length) > block_.size() - 4) break;
            take(half(at), at + 4, length);
            at += 4 + padded(length);
        }
    }
    PacketOrigin enhanced() const {
        PacketOrigin origin{.interface = word(8)};
        options(kEnhancedHead + padded(word(20)), [&](std::uint16_t code, std::size_t at, std::size_t length) {
            if (code == kFlags && length == 4 && origin.direction != PacketOrigin::Direction::refused) {
                const std::uint32_t direction = word(at) & kDirectionBits;
                if (direction == kReceived) origin.direction = PacketOrigin::Direction::received;
                if (direction == kSent) origin.direction = PacketOrigin::Direction::sent;
            }
            const auto text = octets_of(kRefusedText);
            if (code == kComment && length == text.size() && std::memcmp(block_.data() + at, text.data(), length) == 0)
                origin.direction = PacketOrigin::Direction::refused;
        });
        return origin;
    }
    // The last block of an interface counts, because each one counts from the beginning.
    void note_dropped() {
        std::uint64_t all = 0;
        options(kStatisticsHead, [&](std::uint16_t code, std::size_t at, std::size_t length) {
            if (length != 8 || (code != kDroppedByInterface && code != kDroppedBySystem)) return;
            const std::uint64_t first = word(at);
            const std::uint64_t second = word(at + 4);
            all += big_endian_ ? first << 32 | second : second << 32 | first;
        });
        constexpr std::size_t kMostInterfaces = 4096;
        const std::pair interface(section_, word(8));
        if (dropped_.size() < kMostInterfaces || dropped_.contains(interface)) dropped_[interface] = all;
    }

    std::FILE* file_;
    bool big_endian_ = false;
    bool in_section_ = false;
    std::uint64_t section_ = 0;
    std::map<std::pair<std::uint64_t, std::uint32_t>, std::uint64_t> dropped_;
    std::vector<std::byte> block_;
    std::vector<PacketOrigin> all_;
};

}  // namespace

std::vector<PacketOrigin> read_packet_origins(const std::string& path, std::uint64_t* dropped) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"), &std::fclose);
    if (!file) return {};
    OriginReader reader(file.get());
    auto all = reader.read();
    if (dropped != nullptr) *dropped = reader.dropped();
    return all;
}

Result<> PcapngWriter::fail(const std::string& what) {
    problem_ = "recording to " + path_ + ": " + what;
    return Error{.code = Errc::nic, .step = Step::open_nic};
}

Result<> PcapngWriter::open(const std::string& path, std::span<const std::string_view> interfaces) {
    if (auto closed = close(); !closed) return closed;
    problem_.clear();
    path_ = path;
    file_.reset(std::fopen(path.c_str(), "wbe"));
    if (!file_) return fail(std::string("the file cannot be made (") + std::strerror(errno) + ")");
    Block section(kSectionHeader);
    constexpr std::uint64_t kUnknownLength = ~std::uint64_t{0};
    section.add(kByteOrderMagic).add(std::uint16_t{1}).add(std::uint16_t{0}).add(kUnknownLength).write(file_.get());
    for (const std::string_view name : interfaces) {
        constexpr std::array kNanoseconds{std::byte{9}};
        Block block(kInterface);
        block.add(kEthernet).add(std::uint16_t{0}).add(std::uint32_t{0});
        block.option(kInterfaceName, octets_of(name.substr(0, 64))).option(kTimeResolution, kNanoseconds);
        block.option(kOptionEnd, {}).write(file_.get());
    }
    return {};
}

void PcapngWriter::write(const PacketOrigin& origin, Duration at, std::span<const std::byte> frame) noexcept {
    if (!file_ || frame.size() > Block::kMost - 128) return;
    const auto time = static_cast<std::uint64_t>(at.count());
    const auto size = static_cast<std::uint32_t>(frame.size());
    Block block(kEnhancedPacket);
    block.add(origin.interface).add(static_cast<std::uint32_t>(time >> 32)).add(static_cast<std::uint32_t>(time));
    block.add(size).add(size).add(frame);
    std::array<std::byte, 4> flags{};
    store_le(flags, 0, origin.direction == PacketOrigin::Direction::received ? kReceived : kSent);
    if (origin.direction != PacketOrigin::Direction::unknown) block.option(kFlags, flags);
    if (origin.direction == PacketOrigin::Direction::refused) block.option(kComment, octets_of(kRefusedText));
    block.option(kOptionEnd, {}).write(file_.get());
}

Result<> PcapngWriter::close() {
    if (!file_) return {};
    // A failed write sets the error flag of the stream; the last write is this flush.
    errno = 0;
    const bool whole = std::fflush(file_.get()) == 0 && std::ferror(file_.get()) == 0;
    const int error = errno;
    file_.reset();
    if (whole) return {};
    return fail(std::string("the file is not complete (") + (error != 0 ? std::strerror(error) : "write failed") + ")");
}

}  // namespace margay
