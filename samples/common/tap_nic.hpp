// A TAP device as a NIC: receive() returns the frames that the kernel sends to the TAP interface.
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

    // Creates the device and sets its interface up. The destructor removes the device. Returns one sentence about an
    // error; empty when there is none.
    [[nodiscard]] std::string open(const std::string& name);

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    [[nodiscard]] int wait_handle() const noexcept override { return device_; }
    [[nodiscard]] int last_error() const noexcept override { return last_error_; }

  private:
    int device_ = -1;
    int last_error_ = 0;
};

}  // namespace margay::samples
