// A datagram in flight. A protocol sequence creates it, owns it and awaits it:
//
//     Datagram read(link, Command::FPRD, address, into);
//     auto reply = co_await read;
//
// Nothing is allocated: the datagram and its data are in the frame of the coroutine that awaits it. When a datagram is
// destroyed in flight, the link forgets it and drops its reply.
#pragma once

#include <margay/detail/list.hpp>
#include "wire/datagram.hpp"

#include <margay/error.hpp>
#include <margay/time.hpp>

#include <array>
#include <coroutine>
#include <cstdint>
#include <span>

namespace margay {

class Link;

// A coroutine that waits for one or more datagrams, or for a point of time.
struct Waiter : ListNode {
    std::coroutine_handle<> handle;
    std::uint16_t pending = 0;
    bool settles = false;  // a DatagramWait that chooses the coroutine that continues

    Waiter() = default;
    ~Waiter();  // out of line, because each sequence would contain it for each datagram
};

// The result of a datagram. errc is none (only then wkc is valid), no_frame, nic, nic_busy, datagram_size, or canceled.
struct Reply {
    Errc errc = Errc::none;
    std::uint16_t wkc = 0;
    bool unmarked = false;  // with no_frame: the frame came back without the mark of the first ESC
    [[nodiscard]] bool ok() const { return errc == Errc::none; }
    // The value for Error::detail.
    [[nodiscard]] std::uint32_t detail() const { return unmarked ? Error::kUnmarked : 0; }
};

// Whether the link sends a datagram again when its frame is lost. The link does not repeat a datagram that has an
// effect beyond its data (a mailbox write or read): the protocol sequence that owns it decides.
enum class Repeat : std::uint8_t { yes, no };

class Datagram;

// Base of all awaitables of datagrams: submits the datagrams, and continues the coroutine when the last of them has
// ended.
class DatagramWait : protected Waiter {
  public:
    // The wait is over. Returns the coroutine that continues.
    [[nodiscard]] static std::coroutine_handle<> next(Waiter& waiter) noexcept {
        return waiter.settles ? static_cast<DatagramWait&>(waiter).settle_(waiter) : waiter.handle;
    }
    [[nodiscard]] bool await_ready() const noexcept { return false; }

  protected:
    // For await_suspend(). False: the link has refused all datagrams, and the coroutine continues at once.
    [[nodiscard]] bool submit(std::coroutine_handle<> waiting, std::span<Datagram* const> datagrams) noexcept;
    [[nodiscard]] bool submit(std::coroutine_handle<> waiting, Datagram& datagram) noexcept;
    // `settle` chooses the coroutine that continues in place of the waiting one.
    void settle_by(std::coroutine_handle<> (*settle)(Waiter& waiter) noexcept) {
        settles = true;
        settle_ = settle;
    }

  private:
    std::coroutine_handle<> (*settle_)(Waiter& waiter) noexcept = nullptr;
};

class Datagram : public ListNode {
  public:
    // Reads into `data`, or exchanges `data`. `data` outlives the datagram and has at most kMaxDatagramData octets.
    Datagram(Link& link, wire::Command command, wire::DatagramAddress address, MutableBytes data,
             Repeat repeat = Repeat::yes);
    // Writes `data`, which outlives the datagram.
    Datagram(Link& link, wire::Command command, wire::DatagramAddress address, Bytes data, Repeat repeat = Repeat::yes);
    ~Datagram();

    // Appends the datagram to the queue of the link. `waiter` is resumed when the last datagram that it waits for has
    // ended. False: the datagram has more data than a frame can carry (Errc::datagram_size), and `waiter` does not wait
    // for it.
    bool submit(Waiter& waiter);
    // The datagram is sent in a frame of its own. Call it before submit().
    void send_alone() { alone_ = true; }
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
    friend class TimedDatagram;

    Link& link_;
    Bytes sent_data_;
    MutableBytes reply_data_;  // empty: the data of the reply is not copied
    Waiter* waiter_ = nullptr;
    wire::DatagramAddress address_;
    wire::Command command_;
    Repeat repeat_;
    Errc errc_ = Errc::canceled;
    std::uint8_t sendings_ = 0;
    bool unmarked_ = false;
    bool alone_ = false;
    bool timed_ = false;  // a TimedDatagram
    std::uint16_t wkc_ = 0;
    std::uint16_t offset_ = 0;  // offset of the header in its frame
};

// A datagram that knows when it was sent last.
class TimedDatagram : public Datagram {
  public:
    TimedDatagram(Link& link, wire::Command command, wire::DatagramAddress address, MutableBytes data,
                  Repeat repeat = Repeat::yes);
    [[nodiscard]] Time sent_at() const { return sent_at_; }

  private:
    friend class Link;

    Time sent_at_{};
};

// Awaits several datagrams, which are sent in this order, in one frame if they fit. Afterwards reply() of each datagram
// returns its result.
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
