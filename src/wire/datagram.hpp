// EtherCAT datagrams: a header of 10 octets, the data, and the working counter of 2 octets (ETG.1000.4, "EtherCAT PDU
// structure").
#pragma once

#include "util/bytes.hpp"
#include "wire/ethernet.hpp"

#include <margay/address.hpp>

#include <array>

#include <cstddef>
#include <cstdint>
#include <optional>

namespace margay::wire {

enum class Command : std::uint8_t {
    NOP = 0,
    APRD = 1,
    APWR = 2,
    APRW = 3,
    FPRD = 4,
    FPWR = 5,
    FPRW = 6,
    BRD = 7,
    BWR = 8,
    BRW = 9,
    LRD = 10,
    LWR = 11,
    LRW = 12,
    ARMW = 13,
    FRMW = 14,
};
inline constexpr std::uint8_t kLastCommand = 14;

[[nodiscard]] constexpr bool is_logical(Command c) { return c >= Command::LRD && c <= Command::LRW; }
// Commands for which every slave increments ADP: position and broadcast addressing.
[[nodiscard]] constexpr bool counts_position(Command c) {
    return (c >= Command::APRD && c <= Command::APRW) || (c >= Command::BRD && c <= Command::BRW) || c == Command::ARMW;
}

// The 32 address bits: ADP and ADO, or a logical address. ADP is the low half of the value.
struct DatagramAddress {
    std::uint32_t value = 0;

    constexpr DatagramAddress() = default;
    constexpr explicit DatagramAddress(std::uint32_t bits) : value(bits) {}
    constexpr DatagramAddress(std::uint16_t adp, std::uint16_t ado) : value((std::uint32_t{ado} << 16) | adp) {}
    constexpr DatagramAddress(StationAddress station, std::uint16_t ado) : DatagramAddress(station.value, ado) {}
    constexpr DatagramAddress(RingPosition position, std::uint16_t ado) : DatagramAddress(position.on_wire(), ado) {}
    constexpr DatagramAddress(LogicalAddress logical) : value(logical.value) {}

    [[nodiscard]] constexpr std::uint16_t adp() const { return static_cast<std::uint16_t>(value); }
    [[nodiscard]] constexpr std::uint16_t ado() const { return static_cast<std::uint16_t>(value >> 16); }
    friend constexpr bool operator==(DatagramAddress, DatagramAddress) = default;
};

inline constexpr std::size_t kDatagramHeaderBytes = 10;
inline constexpr std::size_t kWorkingCounterBytes = 2;
inline constexpr std::size_t kDatagramOverheadBytes = kDatagramHeaderBytes + kWorkingCounterBytes;
inline constexpr std::size_t kMaxDatagramData = kMaxDatagramsBytes - kDatagramOverheadBytes;  // 1486

struct DatagramHeader {
    Command command = Command::NOP;
    std::uint8_t index = 0;
    DatagramAddress address;
    std::uint16_t length = 0;  // 11 bits
    bool circulating = false;  // bit 14 of the length word: the frame has already circulated once in a closed ring
    bool more = false;         // bit 15: another datagram follows
    std::uint16_t irq = 0;     // ECAT event requests of all slaves, masked by their ECAT event masks and combined by OR
};

struct DatagramLayout {
    using command = Field<Command, 0>;
    using index = Field<std::uint8_t, 1>;
    using address = Field<std::uint32_t, 2>;
    using length_and_flags = Field<std::uint16_t, 6>;
    using irq = Field<std::uint16_t, 8>;
    static_assert(irq::end == kDatagramHeaderBytes);
};

[[nodiscard]] constexpr DatagramHeader load_datagram_header(Bytes at) {
    using L = DatagramLayout;
    const auto word = L::length_and_flags::load(at);
    return {L::command::load(at),
            L::index::load(at),
            DatagramAddress(L::address::load(at)),
            static_cast<std::uint16_t>(word & 0x07FF),
            (word & 0x4000) != 0,
            (word & 0x8000) != 0,
            L::irq::load(at)};
}

constexpr void store_datagram_header(MutableBytes at, const DatagramHeader& h) {
    using L = DatagramLayout;
    L::command::store(at, h.command);
    L::index::store(at, h.index);
    L::address::store(at, h.address.value);
    L::length_and_flags::store(
        at, static_cast<std::uint16_t>((h.length & 0x07FF) | (h.circulating ? 0x4000 : 0) | (h.more ? 0x8000 : 0)));
    L::irq::store(at, h.irq);
}

// One datagram of a received frame: its header, data and working counter.
struct DatagramView {
    DatagramHeader header;
    std::size_t offset = 0;  // of the header, from the start of the Ethernet frame
    Bytes data;
    std::uint16_t wkc = 0;
};

enum class FrameFault : std::uint8_t {
    none,
    too_short,  // shorter than the headers
    foreign,    // not EtherType 0x88A4, or not EtherCAT frame type 1
    truncated,  // a length exceeds the frame
    trailing,   // the last datagram does not end where the frame header says
};

// Iterates over the datagrams of a frame. Padding after the length of the frame header is ignored.
//
//     DatagramReader reader(frame);
//     while (auto datagram = reader.next()) …;
//     if (reader.fault() != FrameFault::none) …;
class DatagramReader {
  public:
    explicit constexpr DatagramReader(Bytes frame) : frame_(frame) {
        if (frame.size() < kFramePrefixBytes) {
            fault_ = FrameFault::too_short;
            return;
        }
        const auto header = load_frame_header(frame.subspan(kEthernetHeaderBytes));
        if (load_ether_type(frame) != kEtherTypeEtherCat || header.type != kFrameTypeDatagrams) {
            fault_ = FrameFault::foreign;
            return;
        }
        end_ = kFramePrefixBytes + header.length;
        if (end_ > frame.size()) fault_ = FrameFault::truncated;
        offset_ = kFramePrefixBytes;
        more_ = true;
    }

    constexpr std::optional<DatagramView> next() {
        if (fault_ != FrameFault::none || !more_) return std::nullopt;
        if (offset_ + kDatagramOverheadBytes > end_) {
            fault_ = FrameFault::truncated;
            return std::nullopt;
        }
        const auto header = load_datagram_header(frame_.subspan(offset_));
        const std::size_t data_at = offset_ + kDatagramHeaderBytes;
        if (data_at + header.length + kWorkingCounterBytes > end_) {
            fault_ = FrameFault::truncated;
            return std::nullopt;
        }
        DatagramView view{header, offset_, frame_.subspan(data_at, header.length),
                          load_le<std::uint16_t>(frame_, data_at + header.length)};
        offset_ = data_at + header.length + kWorkingCounterBytes;
        more_ = header.more;
        if (!more_ && offset_ != end_) fault_ = FrameFault::trailing;
        return view;
    }

    // Valid after next() has returned nullopt.
    [[nodiscard]] constexpr FrameFault fault() const { return fault_; }
    // End of the datagrams according to the frame header, as offset in the frame.
    [[nodiscard]] constexpr std::size_t end() const { return end_; }

  private:
    Bytes frame_;
    std::size_t offset_ = 0;
    std::size_t end_ = 0;
    bool more_ = false;
    FrameFault fault_ = FrameFault::none;
};

// Appends datagrams to a frame of up to kMaxFrameBytes.
class FrameBuilder {
  public:
    // The caller owns `buffer`, which must outlive the builder and have at least kFramePrefixBytes octets.
    constexpr FrameBuilder(MutableBytes buffer, const std::array<std::uint8_t, 6>& source) : buffer_(buffer) {
        for (std::size_t i = 0; i < 6; ++i) buffer_[i] = std::byte{0xFF};
        for (std::size_t i = 0; i < 6; ++i) buffer_[kSourceMacOffset + i] = std::byte{source[i]};
        buffer_[12] = std::byte{kEtherTypeEtherCat >> 8};
        buffer_[13] = std::byte{kEtherTypeEtherCat & 0xFF};
    }

    // Continues a frame that already contains datagrams: `size` is its present size in octets, `last` the offset of its
    // last datagram header.
    constexpr FrameBuilder(MutableBytes buffer, std::size_t size, std::size_t last)
        : buffer_(buffer), size_(size), last_(last) {}

    [[nodiscard]] constexpr bool fits(std::size_t data_bytes) const {
        return size_ + kDatagramOverheadBytes + data_bytes <= buffer_.size();
    }
    [[nodiscard]] constexpr bool empty() const { return last_ == 0; }

    // Appends a datagram and returns its zeroed data area for the caller to fill. Precondition: fits() returned true.
    constexpr MutableBytes append(Command command, std::uint8_t index, DatagramAddress address,
                                  std::size_t data_bytes) {
        if (last_ != 0) buffer_[last_ + 7] |= std::byte{0x80};  // "more" bit of the previous datagram
        last_ = size_;
        store_datagram_header(
            buffer_.subspan(size_),
            {.command = command, .index = index, .address = address, .length = static_cast<std::uint16_t>(data_bytes)});
        const auto data = buffer_.subspan(size_ + kDatagramHeaderBytes, data_bytes);
        for (auto& octet : buffer_.subspan(size_ + kDatagramHeaderBytes, data_bytes + kWorkingCounterBytes))
            octet = std::byte{0};
        size_ += kDatagramOverheadBytes + data_bytes;
        return data;
    }

    // Completes the frame: writes its header and returns its octets (without padding).
    constexpr Bytes finish() {
        store_frame_header(buffer_.subspan(kEthernetHeaderBytes),
                           {.length = static_cast<std::uint16_t>(size_ - kFramePrefixBytes)});
        return buffer_.first(size_);
    }
    [[nodiscard]] constexpr std::size_t size() const { return size_; }
    // Offset of the last datagram header; 0 when there is none.
    [[nodiscard]] constexpr std::size_t last() const { return last_; }

  private:
    MutableBytes buffer_;
    std::size_t size_ = kFramePrefixBytes;
    std::size_t last_ = 0;
};

}  // namespace margay::wire
