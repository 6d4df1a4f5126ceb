// A user's port, compiled with the conformance suite from outside the tree. The port has its own Osal and its own NIC.
#include "port/suite/port_suite.hpp"

#include <margay/parts/osal/osal.hpp>
#include <margay/parts/oshw/nic.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <span>
#include <string_view>
#include <thread>

namespace {

class OwnOsal final : public margay::Osal {
  public:
    margay::Time now() noexcept override { return margay::Time(std::chrono::steady_clock::now().time_since_epoch()); }
    void wait(margay::Time until, margay::WaitHandles) noexcept override {
        const auto left = until - now();
        std::this_thread::sleep_for(std::min<margay::Duration>(left, std::chrono::milliseconds(1)));
    }
};

// Nothing is connected to this NIC.
class OwnNic final : public margay::Nic {
  public:
    margay::SendStatus send(std::span<const std::byte>) noexcept override { return margay::SendStatus::failed; }
    std::size_t receive(std::span<std::byte>) noexcept override { return 0; }
};

}  // namespace

int main() {
    OwnOsal osal;
    OwnNic nic;
    margay::port::Port port;
    port.osal = &osal;
    port.print = [](void*, std::string_view line) { std::printf("%.*s\n", int(line.size()), line.data()); };
    port.watched = {};
    const bool good = margay::port::check_port(port).failed == 0;
    port.nic = &nic;
    port.reply = std::chrono::milliseconds(1);
    const bool found = margay::port::check_port(port).failed != 0;
    return good && found ? 0 : 1;
}
