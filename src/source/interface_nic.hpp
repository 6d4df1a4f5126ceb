// Opens the NIC of one interface by the text of the user: eth0, xdp:eth0, try-xdp:eth0. See source.hpp for their
// meaning.
#pragma once

#include "oshw/nic.hpp"

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace margay::hosted {

// One end of a cable as the user has written it.
struct InterfaceText {
    enum class Socket { packet, xdp, xdp_or_packet };
    Socket socket = Socket::packet;
    std::string name{};  // of the interface
};

[[nodiscard]] InterfaceText parse_interface(std::string_view text);
// The names of the interfaces in a SOURCE: one, or two for a ring. A simulated segment and a recording have none.
[[nodiscard]] std::vector<std::string> interfaces_of(std::string_view source);

// The times of frames that a NIC must support (Nic::timing()).
struct WantedTimes {
    enum class Stamps { off, software, hardware };
    Stamps stamps = Stamps::off;  // when frames were sent and received
    bool send_at = false;         // frames can be sent at a given time
    [[nodiscard]] bool any() const { return stamps != Stamps::off || send_at; }
};

struct OpenedInterface {
    std::shared_ptr<Nic> nic{};  // shared_ptr, because the destructor of Nic is not virtual
    std::string error{};         // the reason why there is no NIC; empty: there is a NIC
    int error_number = 0;        // errno of that error; ENODEV: there is no such interface
    // The reason why the NIC is not the first choice of the user; empty: it is the first choice.
    std::string remark{};
};

// Error if the interface does not support the wanted times. AF_XDP does not support them, so "try-xdp" then continues
// with AF_PACKET.
[[nodiscard]] OpenedInterface open_interface_nic(const InterfaceText& wanted, const WantedTimes& times = {});

// Whether the hardware time stamps of both interfaces come from the same clock, for example of two ports of one chip.
[[nodiscard]] bool share_a_clock(const std::string& one, const std::string& other);

}  // namespace margay::hosted
