// Process data: where each slave's lies in the image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

// The data of one slave in one direction.
struct ImagePart {
    std::uint32_t offset_bits = 0;  // from the start of the group's image
    std::uint32_t bits = 0;         // to the end of its last SyncManager, gaps included
    std::span<std::byte> bytes;     // the octets that hold it; its first bit is bit offset_bits % 8 of the first
};

struct SlaveImage {
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    ImagePart outputs;
    ImagePart inputs;
    // The bit of the image that is set while the slave's mailbox has something to read.
    std::uint32_t mailbox_status_bit = kNone;
};

}  // namespace margay
