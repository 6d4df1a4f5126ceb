#include "wire/eoe_assembly.hpp"

#include <algorithm>

namespace margay::wire::eoe {

Assembly::Took Assembly::add(const Header& header, Bytes data) {
    time_stamp_.reset();
    if (header.fragment == 0) {
        bytes_ = 0;
        blocks_ = header.blocks;
        port_ = header.port;
        frame_number_ = header.frame_number;
    } else if (!is_part(header) || header.fragment != next_ || header.blocks * kBlockBytes != bytes_) {
        drop();
        return Took::out_of_order;
    }
    drop();
    const bool stamped = header.last && header.time_appended;
    if (stamped && data.size() < kTimeStampBytes) return Took::malformed;
    const Bytes octets = data.first(data.size() - (stamped ? kTimeStampBytes : 0));
    const Took took = check(header, octets.size());
    if (took != Took::more && took != Took::whole) return took;
    std::ranges::copy(octets, memory_.begin() + static_cast<std::ptrdiff_t>(bytes_));
    bytes_ += octets.size();
    if (stamped) time_stamp_ = load_le<std::uint32_t>(data, octets.size());
    if (took == Took::more) next_ = static_cast<std::uint8_t>(header.fragment + 1);
    return took;
}

// The last fragment must end in the block that fragment 0 has announced. A slave may have counted the time stamp, too.
Assembly::Took Assembly::check(const Header& header, std::size_t bytes) {
    const std::size_t end = bytes_ + bytes;
    const std::size_t counted = header.time_appended ? end + kTimeStampBytes : end;
    if (end > memory_.size() || blocks_ > blocks_of(memory_.size())) return Took::too_long;
    if (!header.last) {
        // The last fragment may consist of a time stamp alone.
        const bool goes_on = bytes != 0 && bytes % kBlockBytes == 0 && end <= blocks_ * kBlockBytes;
        return goes_on && header.fragment < 0x3F ? Took::more : Took::malformed;
    }
    const bool right = blocks_of(end) == blocks_ || blocks_of(counted) == blocks_;
    return right && end >= kLeastFrameBytes ? Took::whole : Took::malformed;
}

}  // namespace margay::wire::eoe
