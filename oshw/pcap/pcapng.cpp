#include "oshw/pcap/pcapng.hpp"

#include "oshw/pcap/pcapng_format.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace margay {
namespace {

using namespace pcapng;

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

}  // namespace

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
