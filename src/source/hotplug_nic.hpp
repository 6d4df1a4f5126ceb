// The NIC of an interface that may be missing, for a program that starts before its interfaces are present, or
// continues without them: an adapter at USB, a driver that is loaded later, an interface that was moved to another
// network namespace.
#pragma once

#include "oshw/nic.hpp"
#include "source/interface_nic.hpp"

#include <memory>
#include <string>

namespace margay::hosted {

class HotplugNic final : public Nic {
  public:
    // `end`: 0 or 1, the end of a ring, so that both ends have different source addresses.
    HotplugNic(InterfaceText wanted, unsigned end);

    // Opens the interface if it is there, and closes it if it was removed. An interface that is switched off is
    // switched on when it appears, and not again later. For the thread that uses the NIC. The function makes a few
    // system calls.
    void look();
    // Why the interface is not open; empty: it is open.
    [[nodiscard]] const std::string& problem() const { return problem_; }
    // Whether waiting can end the problem: the interface is missing or switched off.
    [[nodiscard]] bool may_come() const { return may_come_; }
    // See OpenedInterface::remark.
    [[nodiscard]] const std::string& remark() const { return remark_; }

    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    [[nodiscard]] LinkState link_state() noexcept override;
    [[nodiscard]] bool hides_own_frames() const noexcept override {
        return nic_ == nullptr || nic_->hides_own_frames();
    }
    // The address is constant for the life of the object, because the context reads it once.
    [[nodiscard]] MacAddress source_mac() const noexcept override { return mac_; }
    [[nodiscard]] int wait_handle() const noexcept override { return nic_ == nullptr ? -1 : nic_->wait_handle(); }
    [[nodiscard]] int last_error() const noexcept override;

  private:
    void open();

    InterfaceText wanted_;
    std::shared_ptr<Nic> nic_;
    unsigned index_ = 0;        // of the open interface
    unsigned switched_on_ = 0;  // the interface that look() has switched on
    MacAddress mac_{};
    std::string problem_{};
    std::string remark_{};
    bool may_come_ = true;
};

}  // namespace margay::hosted
