// One datagram on its way: made by a protocol sequence, awaited by it, owned by it.
//
//     Datagram read(link, Command::FPRD, address, into);
//     auto reply = co_await read;
//
// Nothing is allocated: the datagram and the bytes it carries live in the coroutine that awaits it. A datagram that is
// destroyed in flight is forgotten; its reply is dropped when it comes.
#pragma once

#include "util/list.hpp"
#include "wire/datagram.hpp"

#include <margay/error.hpp>
#include <margay/time.hpp>

#include <array>
#include <coroutine>
#include <cstdint>
#include <span>

namespace margay {

class Link;

// A coroutine that waits for one or more datagrams, or for a time.
struct Waiter : ListNode {
    std::coroutine_handle<> handle;
    unsigned pending = 0;
};

// What came of a datagram: errc is none (then wkc counts), no_frame, nic, nic_busy, datagram_size, or canceled.
struct Reply {
    Errc errc = Errc::none;
    std::uint16_t wkc = 0;
    bool unmarked = false;  // no_frame: it came back, but without the mark of the first ESC
    [[nodiscard]] bool ok() const { return errc == Errc::none; }
    // What goes into Error::detail.
    [[nodiscard]] std::uint32_t detail() const { return unmarked ? Error::kUnmarked : 0; }
};

// Whether the link sends a datagram again when its frame is lost. What has an effect beyond its data (a mailbox write
// or read) is not repeated by the link: its owner knows better.
enum class Repeat : std::uint8_t { yes, no };

class Datagram;

// What awaitables of datagrams share: the datagrams are submitted, and the coroutine goes on when the last of them is
// done.
class DatagramWait {
  public:
    [[nodiscard]] bool await_ready() const noexcept { return false; }

  protected:
    // For await_suspend(). False: the link has refused them all, and the coroutine goes on at once.
    [[nodiscard]] bool submit(std::coroutine_handle<> waiting, std::span<Datagram* const> datagrams) noexcept;
    [[nodiscard]] bool submit(std::coroutine_handle<> waiting, Datagram& datagram) noexcept;

  private:
    Waiter waiter_;
};

class Datagram : public ListNode {
  public:
    // Reads into, or exchanges with, `data`, which lives as long as the datagram and has at most kMaxDatagramData
    // octets.
    Datagram(Link& link, wire::Command command, wire::DatagramAddress address, MutableBytes data,
             Repeat repeat = Repeat::yes)
        : link_(link), sent_data_(data), reply_data_(data), address_(address), command_(command), repeat_(repeat) {}
    // Writes `data`, which lives as long as the datagram.
    Datagram(Link& link, wire::Command command, wire::DatagramAddress address, Bytes data, Repeat repeat = Repeat::yes)
        : link_(link), sent_data_(data), address_(address), command_(command), repeat_(repeat) {}

    // Hands it to the link; `waiter` is resumed when the last of the datagrams it waits for is done. False: it has more
    // data than a frame can carry (Errc::datagram_size), and the waiter does not wait for it.
    bool submit(Waiter& waiter);
    [[nodiscard]] Reply reply() const { return {errc_, wkc_, unmarked_}; }

    class Awaiter : public DatagramWait {
      public:
        explicit Awaiter(Datagram& datagram) : datagram_(datagram) {}
        bool await_suspend(std::coroutine_handle<> h) noexcept { return submit(h, datagram_); }
        Reply await_resume() const noexcept { return datagram_.reply(); }

      private:
        Datagram& datagram_;
    };
    Awaiter operator co_await() & { return Awaiter(*this); }

  private:
    friend class Link;

    Link& link_;
    Bytes sent_data_;
    MutableBytes reply_data_;  // empty: the reply's data is not wanted
    Waiter* waiter_ = nullptr;
    wire::DatagramAddress address_;
    wire::Command command_;
    Repeat repeat_;
    Errc errc_ = Errc::canceled;
    std::uint8_t sendings_ = 0;
    bool unmarked_ = false;
    std::uint16_t wkc_ = 0;
    std::uint16_t offset_ = 0;  // in its frame
};

// Awaits several datagrams, sent in this order and in one frame where they fit. Their replies are asked of each
// afterwards.
template <std::size_t N>
class Together : public DatagramWait {
  public:
    explicit Together(const std::array<Datagram*, N>& datagrams) : datagrams_(datagrams) {}
    bool await_suspend(std::coroutine_handle<> h) noexcept { return submit(h, datagrams_); }
    void await_resume() const noexcept {}

  private:
    std::array<Datagram*, N> datagrams_;
};
template <class... D>
[[nodiscard]] Together<sizeof...(D)> together(D&... datagrams) {
    return Together<sizeof...(D)>({static_cast<Datagram*>(&datagrams)...});
}

}  // namespace margay
