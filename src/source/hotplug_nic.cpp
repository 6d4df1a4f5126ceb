#include "source/hotplug_nic.hpp"

#include "oshw/linux/interface.hpp"

#include <net/if.h>

#include <cerrno>

namespace margay::hosted {

HotplugNic::HotplugNic(InterfaceText wanted, unsigned end) : wanted_(std::move(wanted)), mac_(Nic::source_mac()) {
    mac_.back() = static_cast<std::uint8_t>(mac_.back() + end);
    look();
    if (nic_ != nullptr) mac_ = nic_->source_mac();
}

void HotplugNic::look() {
    const unsigned index = ::if_nametoindex(wanted_.name.c_str());
    if (nic_ != nullptr && index == index_) return;
    nic_.reset();
    if (index != 0 && index != switched_on_) {
        switched_on_ = index;
        Interface interface;
        // Without permission the interface stays off, and open() reports this.
        if (interface.open(wanted_.name)) (void)interface.switch_on();
    }
    index_ = index;
    open();
}

void HotplugNic::open() {
    auto opened = open_interface_nic(wanted_);
    nic_ = std::move(opened.nic);
    problem_ = std::move(opened.error);
    remark_ = std::move(opened.remark);
    may_come_ = nic_ != nullptr || opened.error_number == ENODEV || opened.error_number == ENXIO ||
                opened.error_number == ENETDOWN;
}

SendStatus HotplugNic::send(std::span<const std::byte> frame) noexcept {
    return nic_ == nullptr ? SendStatus::failed : nic_->send(frame);
}

std::size_t HotplugNic::receive(std::span<std::byte> into) noexcept {
    return nic_ == nullptr ? 0 : nic_->receive(into);
}

LinkState HotplugNic::link_state() noexcept { return nic_ == nullptr ? LinkState::down : nic_->link_state(); }

int HotplugNic::last_error() const noexcept { return nic_ == nullptr ? ENODEV : nic_->last_error(); }

}  // namespace margay::hosted
