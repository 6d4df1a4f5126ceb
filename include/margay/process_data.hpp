// Where the process data of each slave is located in the image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

// The octets of a slave in the image. An access beyond the end is safe: a read returns zero, and a write has no effect.
// So the application can access slaves without data in this direction, slaves that are not mapped, and slave(0) in the
// same way as other slaves. A span of this object does not have this check.
class ImageBytes {
  public:
    constexpr ImageBytes() = default;
    constexpr ImageBytes(std::span<std::byte> octets)
        : data_(octets.data()), size_(static_cast<std::uint32_t>(octets.size())) {}

    [[nodiscard]] std::byte& operator[](std::size_t index) const {
        if (index < size_) [[likely]]
            return data_[index];
        nowhere_ = std::byte{0};
        return nowhere_;
    }
    [[nodiscard]] constexpr std::byte* data() const { return data_; }
    [[nodiscard]] constexpr std::size_t size() const { return size_; }
    [[nodiscard]] constexpr bool empty() const { return size_ == 0; }
    [[nodiscard]] constexpr std::byte* begin() const { return data_; }
    [[nodiscard]] constexpr std::byte* end() const { return data_ + size_; }
    [[nodiscard]] constexpr std::span<std::byte> span() const { return {data_, size_}; }

  private:
    std::byte* data_ = nullptr;
    std::uint32_t size_ = 0;
    mutable std::byte nowhere_{0};
};

}  // namespace margay

// The octets belong to the image, not to the ImageBytes: so a temporary ImageBytes converts to a span, like a temporary
// span does.
template <>
inline constexpr bool std::ranges::enable_borrowed_range<margay::ImageBytes> = true;

namespace margay {

// The data of one slave in one direction.
struct ImagePart {
    std::uint32_t offset_bits = 0;  // from the start of the group's image
    std::uint32_t bits = 0;         // up to the end of its last SyncManager, gaps included
    ImageBytes bytes;  // the octets of the data; the first bit of the data is bit offset_bits % 8 of the first octet
};

// The part of one slave in the image of its group.
struct SlaveImage {
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    ImagePart outputs;
    ImagePart inputs;
    // The number of the bit in the image that is set while the slave's mailbox has a message to read.
    std::uint32_t mailbox_status_bit = kNone;
    // The group whose image this is; kNoGroup: the slave is not part of an image.
    static constexpr std::uint16_t kNoGroup = 0xFFFF;
    std::uint16_t group = kNoGroup;

  private:
    friend struct SlaveImageAccess;
    // A check value of SlaveConfiguration::sms and of the lists of PDOs as they were mapped.
    std::uint16_t mapped_check_ = 0;
};

}  // namespace margay
