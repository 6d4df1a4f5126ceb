// A TAP device (a network interface of the kernel without hardware) as a NIC: receive() returns the frames that the
// kernel sends by this interface, and the kernel receives the frames of send().
#pragma once

#include "oshw/nic.hpp"

#include <string>

namespace margay::samples {

class TapNic final : public Nic {
  public:
    TapNic() = default;
    ~TapNic();
    TapNic(const TapNic&) = delete;
    TapNic& operator=(const TapNic&) = delete;

    // Creates the device and switches its interface on. The destructor removes the device. Returns a sentence that
    // describes the error; empty when there is no error.
    [[nodiscard]] std::string open(const std::string& name);
    // Whether open() has failed because an interface with this name exists.
    [[nodiscard]] bool name_taken() const noexcept { return name_taken_; }

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    [[nodiscard]] int wait_handle() const noexcept override { return device_; }
    [[nodiscard]] int last_error() const noexcept override { return last_error_; }
    // Whether the interface was deleted, so that receive() has failed.
    [[nodiscard]] bool gone() const noexcept { return gone_; }

  private:
    int device_ = -1;
    int last_error_ = 0;
    bool gone_ = false;
    bool name_taken_ = false;
};

}  // namespace margay::samples
