#include "far_end.hpp"

namespace margay::port {
namespace {

using namespace std::chrono_literals;

// Positions in a frame.
constexpr std::size_t kSource = 6;
constexpr std::size_t kEtherType = 12;
constexpr std::size_t kHeader = 14;
constexpr std::size_t kEventField = 24;
constexpr std::size_t kData = 26;
constexpr std::size_t kWorkingCounterBytes = 2;
constexpr std::size_t kShortestOnTheWire = 60;
constexpr std::size_t kLongestWithoutTag = 1514;
constexpr std::byte kMark{2};  // the first slave sets this bit of the source address

void put16(std::span<std::byte> at, std::size_t value) {
    at[0] = static_cast<std::byte>(value);
    at[1] = static_cast<std::byte>(value >> 8);
}

}  // namespace

bool FarEnd::fault(std::string_view what, std::uint64_t number, std::string_view unit) {
    what_ = what;
    number_ = number;
    unit_ = unit;
    return false;
}

void FarEnd::fill_address(std::span<std::byte> frame) const {
    std::fill(frame.begin(), frame.end(), std::byte{0});
    std::fill_n(frame.begin(), kSource, std::byte{0xFF});
    const auto mac = nic_.source_mac();
    for (std::size_t n = 0; n < mac.size(); ++n) frame[kSource + n] = static_cast<std::byte>(mac[n]);
}

void FarEnd::fill(std::span<std::byte> frame, std::uint32_t number) const {
    fill_address(frame);
    frame[kEtherType] = std::byte{0x88};
    frame[kEtherType + 1] = std::byte{0xA4};
    put16(frame.subspan(kHeader), (frame.size() - kHeader - 2) | 0x1000);  // datagrams follow
    const auto data = frame.subspan(kData, frame.size() - kData - kWorkingCounterBytes);
    put16(frame.subspan(kEventField - 2), data.size());
    std::uint32_t noise = number * 2654435761U + static_cast<std::uint32_t>(frame.size());
    for (std::size_t n = 0; n < data.size(); ++n) {
        noise = noise * 1664525U + 1013904223U;
        data[n] = static_cast<std::byte>(n < 4 ? number >> 8 * n : noise >> 24);
    }
    // In frames without room for the number, the index of the datagram carries a part of it.
    frame[kHeader + 3] = static_cast<std::byte>(number);
}

SendStatus FarEnd::send(std::size_t size, std::size_t alignment) {
    const auto frame = std::span(sent_).subspan(alignment, size);
    fill(frame, next_sent_);
    std::copy_n(frame.begin(), sent_head_.size(), sent_head_.begin());
    reply_head_ = sent_head_;
    reply_head_[kSource] |= kMark;
    const auto status = nic_.send(frame);
    // After send() the memory belongs to the caller again, so it may change.
    std::fill(frame.begin(), frame.end(), std::byte{0xEE});
    if (status == SendStatus::sent) sizes_[next_sent_++ % kRemembered] = static_cast<std::uint16_t>(size);
    return status;
}

SendStatus FarEnd::send_raw(std::size_t size) {
    std::fill(sent_.begin(), sent_.end(), std::byte{0xFF});
    return nic_.send(std::span(sent_).first(size));
}

SendStatus FarEnd::send_other(std::size_t size) {
    const auto frame = std::span(sent_).first(size);
    fill_address(frame);
    const bool tagged = size > kLongestWithoutTag;
    frame[kEtherType] = tagged ? std::byte{0x81} : std::byte{0x88};
    frame[kEtherType + 1] = tagged ? std::byte{0x00} : std::byte{0xB5};  // without a tag: for local experiments
    return nic_.send(frame);
}

bool FarEnd::send_patiently(std::size_t size, std::size_t alignment) {
    const Time until = run_.osal.now() + 10 * run_.port.reply;
    auto status = send(size, alignment);
    // No event reports that a place in the queue is free.
    for (Time now = run_.osal.now(); status == SendStatus::busy; now = run_.osal.now()) {
        if (now > until || !run_.wait_until(now + 100us)) return fault("send() stays busy; size ", size);
        status = send(size, alignment);
    }
    return status == SendStatus::sent || fault("send() returned failed; size ", size);
}

void FarEnd::discard() {
    constexpr unsigned kMostStored = 10'000;  // frames
    unsigned count = 0;
    while (nic_.receive(memory()) != 0)
        if (++count == kMostStored) return run_.fail("receive() returns frames without an end");
}

void FarEnd::drain() {
    discard();
    // A reply that is still on the way.
    (void)run_.wait_for(run_.osal.now() + run_.port.reply / 10, [&] {
        discard();
        return run_.failed();
    });
}

FarEnd::Got FarEnd::fetch(std::size_t room) {
    std::fill(received_.begin(), received_.end(), kGuardValue);
    const Time start = run_.osal.now();
    const auto length = nic_.receive(memory().first(room));
    if (length == 0) return Got::nothing;
    receive_took_ = run_.osal.now() - start;
    const auto touched = [](std::byte octet) { return octet != kGuardValue; };
    if (std::any_of(received_.begin(), received_.begin() + kGuard, touched) ||
        std::any_of(received_.begin() + static_cast<std::ptrdiff_t>(kGuard + room), received_.end(), touched)) {
        fault("receive() wrote outside the memory");
        return Got::fault;
    }
    if (length > room) {
        fault("receive() returned more than the memory: ", length, " octets");
        return Got::fault;
    }
    return match(length, room);
}

FarEnd::Got FarEnd::match(std::size_t length, std::size_t room) {
    const auto frame = memory();
    if (length <= kEtherType + 1 || frame[kEtherType] != std::byte{0x88} || frame[kEtherType + 1] != std::byte{0xA4})
        return Got::nothing;  // a frame of another station
    if ((frame[kSource] & kMark) == std::byte{0}) {
        if (!nic_.hides_own_frames()) {
            ++echoes_;
            return Got::nothing;
        }
        fault("hides_own_frames() is true, but receive() returned an own frame");
        return Got::fault;
    }
    for (std::uint32_t number = next_received_; number != next_sent_; ++number) {
        const auto got = compare(number, length, room);
        if (got != Got::reply && !losses_) return got;
        if (got != Got::reply) continue;
        next_received_ = number + 1;
        return Got::reply;
    }
    fault("an unexpected frame of ", length, " octets: changed, doubled, out of order, or sent although it was busy");
    return Got::fault;
}

// Compares the received frame with the reply to frame `number`.
FarEnd::Got FarEnd::compare(std::uint32_t number, std::size_t length, std::size_t room) {
    const std::size_t size = sizes_[number % kRemembered];
    const auto least = std::min(size, room);
    const auto most = std::min(std::max(size, kShortestOnTheWire), room);
    if (length != least && length != most) {
        fault("a frame came back with another length: ", length, " octets");
        return Got::fault;
    }
    const auto expected = std::span(expected_).first(size);
    fill(expected, number);
    auto frame = memory();
    frame[kSource] &= ~kMark;
    for (std::size_t n = 0; n < least; ++n) {
        if (n == kEventField || n == kEventField + 1 || frame[n] == expected[n]) continue;
        fault("a frame came back changed at octet ", n, ", or lost, or out of order");
        return Got::fault;
    }
    return Got::reply;
}

bool FarEnd::await_reply(std::size_t room) {
    auto got = Got::nothing;
    const Time until = run_.osal.now() + 10 * run_.port.reply;
    (void)run_.wait_for(until, [&] { return (got = fetch(room)) != Got::nothing; });
    lost_ = got == Got::nothing;
    if (lost_) return fault("a frame did not come back; size ", sizes_[next_received_ % kRemembered]);
    return got == Got::reply;
}

bool FarEnd::collect(std::size_t count) {
    for (std::size_t n = 0; n < count; ++n)
        if (!await_reply(kMost)) return false;
    return true;
}

bool FarEnd::collect_rest() {
    auto got = Got::nothing;
    do {
        got = Got::nothing;
        (void)run_.wait_for(run_.osal.now() + run_.port.reply, [&] { return (got = fetch(kMost)) != Got::nothing; });
    } while (got == Got::reply);
    next_received_ = next_sent_;
    losses_ = false;
    return got == Got::nothing;
}

bool FarEnd::collect_ready() {
    auto got = Got::reply;
    while (got == Got::reply) got = fetch(kMost);
    return got == Got::nothing;
}

bool FarEnd::receive_cut(std::size_t bytes) { return await_reply(bytes); }

bool FarEnd::rest_is_gone(std::size_t bytes) {
    const std::uint32_t number = next_received_ - 1;
    const auto whole = std::span(expected_).first(sizes_[number % kRemembered]);
    fill(whole, number);
    const auto rest = whole.subspan(bytes);
    bool came = false;
    (void)run_.wait_for(run_.osal.now() + run_.port.reply, [&] {
        const auto length = nic_.receive(memory());
        // The last two octets are the working counter, and behind them there may be padding.
        came = length >= rest.size() && std::equal(rest.begin(), rest.end(), memory().begin());
        return came;
    });
    return !came || fault("the rest of a frame that was cut came as a frame of its own: ", rest.size(), " octets");
}

}  // namespace margay::port
