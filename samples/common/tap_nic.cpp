#include "common/tap_nic.hpp"

#include "oshw/linux/interface.hpp"

#include <fmt/format.h>

#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <cerrno>
#include <cstring>

namespace margay::samples {

TapNic::~TapNic() {
    if (device_ >= 0) ::close(device_);
}

std::string TapNic::open(const std::string& name) {
    if (name.empty() || name.size() >= IFNAMSIZ)
        return fmt::format("'{}' is not a valid interface name (1 to 15 characters)", name);
    device_ = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (device_ < 0) return fmt::format("cannot open /dev/net/tun: {}", std::strerror(errno));
    ifreq request{};
    request.ifr_flags = IFF_TAP | IFF_NO_PI;
    std::memcpy(request.ifr_name, name.c_str(), name.size() + 1);
    Interface interface;
    if (::ioctl(device_, TUNSETIFF, &request) < 0) {
        const int error = errno;
        // The name belongs to a TAP device of another program, or to an interface of another kind.
        name_taken_ = (error == EBUSY || error == EINVAL) && interface.open(name);
        if (name_taken_) return fmt::format("the system has an interface {} already", name);
        return fmt::format("cannot create the TAP device {}: {}{}", name, std::strerror(error),
                           error == EPERM ? "; the program needs the capability CAP_NET_ADMIN" : "");
    }
    if (!interface.open(name) || !interface.switch_on())
        return fmt::format("cannot switch on the interface {}: {}", name, std::strerror(errno));
    return {};
}

SendStatus TapNic::send(std::span<const std::byte> frame) noexcept {
    if (::write(device_, frame.data(), frame.size()) >= 0) return SendStatus::sent;
    last_error_ = errno;
    return errno == EAGAIN ? SendStatus::busy : SendStatus::failed;
}

std::size_t TapNic::receive(std::span<std::byte> into) noexcept {
    const auto size = ::read(device_, into.data(), into.size());
    gone_ |= size < 0 && errno != EAGAIN && errno != EINTR;
    return size < 0 ? 0 : static_cast<std::size_t>(size);
}

}  // namespace margay::samples
