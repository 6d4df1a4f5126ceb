// The frame reader with random input: its results are inside the frame, their lengths add up to the length in the
// frame header, and writing them again gives the same frame.
#include "wire/datagram.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

using namespace margay;
using namespace margay::wire;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

void check_rewritten(const DatagramView& datagram) {
    std::array<std::byte, kDatagramHeaderBytes> again{};
    store_datagram_header(again, datagram.header);
    const auto reloaded = load_datagram_header(again);
    require(reloaded.command == datagram.header.command && reloaded.index == datagram.header.index &&
            reloaded.address == datagram.header.address && reloaded.length == datagram.header.length &&
            reloaded.circulating == datagram.header.circulating && reloaded.more == datagram.header.more &&
            reloaded.irq == datagram.header.irq);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto frame = std::as_bytes(std::span(data, size));
    std::array<std::byte, kMaxFrameBytes> buffer{};
    FrameBuilder builder(buffer, {});
    DatagramReader reader(frame);
    std::size_t octets = 0;
    bool more = true;
    while (const auto datagram = reader.next()) {
        require(more);
        more = datagram->header.more;
        require(datagram->offset == kFramePrefixBytes + octets);
        require(datagram->data.data() == frame.data() + datagram->offset + kDatagramHeaderBytes);
        require(datagram->data.size() == datagram->header.length);
        octets += kDatagramOverheadBytes + datagram->data.size();
        require(kFramePrefixBytes + octets <= frame.size());
        require(datagram->wkc == load_le<std::uint16_t>(frame, kFramePrefixBytes + octets - kWorkingCounterBytes));
        check_rewritten(*datagram);
        if (octets <= kMaxDatagramsBytes) {
            const auto copy = builder.append(datagram->header.command, datagram->header.index, datagram->header.address,
                                             datagram->data.size());
            require(copy.size() == datagram->data.size());
            std::copy(datagram->data.begin(), datagram->data.end(), copy.begin());
        }
    }
    require(!reader.next());
    if (reader.fault() != FrameFault::none) return 0;
    require(!more && octets == load_frame_header(frame.subspan(kEthernetHeaderBytes)).length);

    // The rewritten frame is read with the same results.
    if (octets > kMaxDatagramsBytes) return 0;
    DatagramReader original(frame);
    DatagramReader rewritten(builder.finish());
    while (const auto datagram = original.next()) {
        const auto copy = rewritten.next();
        require(copy && copy->header.address == datagram->header.address &&
                copy->header.more == datagram->header.more && std::ranges::equal(copy->data, datagram->data));
    }
    require(!rewritten.next() && rewritten.fault() == FrameFault::none);
    return 0;
}
