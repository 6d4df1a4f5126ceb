// A network interface of Linux by its name: checks before a NIC uses it, its address, its carrier, and a sentence about
// its faults.
#pragma once

#include <margay/mac_address.hpp>
#include <margay/result.hpp>

#include "oshw/nic.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>

struct ifreq;

namespace margay {

class Interface {
  public:
    Interface() noexcept = default;
    ~Interface();
    Interface(const Interface&) = delete;
    Interface& operator=(const Interface&) = delete;

    // Finds the interface in the network namespace of the calling thread. Errors: nic (there is none with this name).
    [[nodiscard]] Result<> open(std::string_view name) noexcept;
    void close() noexcept;
    // Checks that the interface is an Ethernet interface, is switched on, and carries frames of full size; reads its
    // address.
    [[nodiscard]] Result<> check() noexcept;

    [[nodiscard]] const char* name() const noexcept { return name_.data(); }
    [[nodiscard]] int index() const noexcept { return index_; }
    [[nodiscard]] const MacAddress& address() const noexcept { return address_; }
    // The carrier of the driver. One system call, which waits while another program changes an interface.
    [[nodiscard]] LinkState link_state() const noexcept;
    // The driver has refused a frame (ENOBUFS): whether it has no carrier. Otherwise its queue is full. The answer "no
    // carrier" is kept until a frame is sent, so the driver is asked once for each unplugged cable. While a queue is
    // full, the driver is asked after 16 refused frames again. Several threads may call both functions.
    [[nodiscard]] bool lacks_carrier() noexcept;
    void note_sent() noexcept {
        if (refused_.load(std::memory_order_relaxed) != 0) refused_.store(0, std::memory_order_relaxed);
    }
    // Switches the interface on (IFF_UP), which needs CAP_NET_ADMIN. False: errno says why.
    [[nodiscard]] bool switch_on() const noexcept;
    // Executes a request of ioctl() with the name of the interface. False: errno says why.
    [[nodiscard]] bool request(unsigned long what, ifreq& request) const noexcept;

    // One sentence about the last failure; empty when there was none.
    [[nodiscard]] std::string_view problem() const noexcept { return {problem_.data(), problem_size_}; }
    void forget_problem() noexcept { problem_size_ = 0; }
    // Keeps the sentence "interface NAME: WHAT; ADVICE" and returns the error. Without advice, the sentence contains
    // the text of the error number instead.
    Result<> fail(int error, std::string_view what, std::string_view advice = {}) noexcept;
    // The same: the program needs these capabilities, in the syntax of setcap.
    Result<> fail_no_permission(std::string_view what, std::string_view capabilities) noexcept;

  private:
    Result<> fail_no_interface(std::string_view asked) noexcept;

    static constexpr unsigned kNoCarrier = 1U << 31;

    int control_ = -1;                  // a socket for ioctl()
    std::atomic<unsigned> refused_{0};  // frames since the last frame that was sent; with kNoCarrier: no carrier
    int index_ = 0;
    MacAddress address_{};
    std::array<char, 16> name_{};  // IFNAMSIZ
    std::array<char, 768> problem_{};
    std::size_t problem_size_ = 0;
};

}  // namespace margay
