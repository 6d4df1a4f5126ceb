// The suite finds faulty NICs. Each NIC has one fault that real drivers have.
#include "port/host.hpp"

#include <margay/parts/osal/virtual/virtual_osal.hpp>
#include <margay/parts/oshw/filter_nic.hpp>
#include <margay/parts/oshw/frame_queue.hpp>
#include <margay/receive_clock.hpp>
#include <margay/timed_send.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace margay::port {
namespace {

using namespace std::chrono_literals;
using Names = std::vector<std::string>;
using Frame = std::span<const std::byte>;
using Memory = std::span<std::byte>;

// The virtual clock and the simulated slave are right. Only the NIC between them is faulty.
struct FaultyNics : testing::Test {
    Host host;
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal, {.queue_frames = 16}};

    void SetUp() override { put_slave_into(segment, osal.now()); }

    Names failures(Nic& nic) { return failures(nic, osal); }
    Names failures(Nic& nic, Osal& waits) {
        struct Bench {
            Host& host;
            sim::Segment& segment;
        } bench{host, segment};
        auto port = host.without_threads(waits, &nic);
        port.user = &bench;
        port.print = [](void* user, std::string_view line) {
            static_cast<Bench*>(user)->host.lines.emplace_back(line);
        };
        port.plug = [](void* user, bool in) { static_cast<Bench*>(user)->segment.set_cable({0, 0}, in); };
        const auto verdict = check_port(port);
        EXPECT_EQ(verdict.failed, host.failed().size());
        return host.failed();
    }
    void expect_found(Nic& nic, const std::string& check) {
        const auto all = failures(nic);
        EXPECT_TRUE(std::ranges::count(all, check) == 1) << "not found: " << check << "\n" << host.text();
    }
};

TEST_F(FaultyNics, TheSoundOneFailsNothing) { EXPECT_EQ(failures(wire), Names{}) << host.text(); }

TEST_F(FaultyNics, TheLastOctetOfAnOddFrameIsLost) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            std::array<std::byte, 2048> copy{};
            std::ranges::copy(frame, copy.begin());
            if (frame.size() % 2 != 0) copy[frame.size() - 1] = std::byte{0x77};
            return inner().send(std::span(copy).first(frame.size()));
        }
    } nic{wire};
    expect_found(nic, "frames of every size come back unchanged");
}

TEST_F(FaultyNics, AnUnalignedFrameIsSentFromTheWordBefore) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            const auto off = reinterpret_cast<std::uintptr_t>(frame.data()) % 4;
            return inner().send(off == 3 ? Frame(frame.data() - off, frame.size()) : frame);
        }
    } nic{wire};
    expect_found(nic, "frames of every size come back unchanged");
}

TEST_F(FaultyNics, TheLengthIncludesTheFcs) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        std::size_t receive(Memory into) noexcept override {
            const auto length = inner().receive(into);
            return length == 0 ? 0 : std::min(length + 4, into.size());
        }
    } nic{wire};
    expect_found(nic, "frames of every size come back unchanged");
}

TEST_F(FaultyNics, AFullQueueLosesFramesSilently) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        unsigned queued = 0;
        SendStatus send(Frame frame) noexcept override {
            return queued++ >= 4 ? SendStatus::sent : inner().send(frame);
        }
        std::size_t receive(Memory into) noexcept override {
            queued = 0;
            return inner().receive(into);
        }
    } nic{wire};
    expect_found(nic, "a burst comes back complete and in order");
}

TEST_F(FaultyNics, AFullQueueIsCalledAFailure) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            const auto status = inner().send(frame);
            return status == SendStatus::busy ? SendStatus::failed : status;
        }
    } nic{wire};
    expect_found(nic, "send() is busy when the queue is full, and never waits");
}

TEST_F(FaultyNics, ABusyFrameIsSentAllTheSame) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        unsigned sent = 0;
        SendStatus send(Frame frame) noexcept override {
            const auto status = inner().send(frame);
            return ++sent % 8 == 0 ? SendStatus::busy : status;
        }
    } nic{wire};
    expect_found(nic, "send() is busy when the queue is full, and never waits");
}

TEST_F(FaultyNics, HalfAFrameGoesOutWhenTheQueueIsNearlyFull) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        unsigned queued = 0;
        SendStatus send(Frame frame) noexcept override {
            return inner().send(++queued == 7 && frame.size() > 1000 ? frame.first(frame.size() / 2) : frame);
        }
        std::size_t receive(Memory into) noexcept override {
            queued = 0;
            return inner().receive(into);
        }
    } nic{wire};
    expect_found(nic, "a burst comes back complete and in order");
}

TEST_F(FaultyNics, TheMemoryOfASentFrameIsReadLater) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        Frame kept;
        SendStatus send(Frame frame) noexcept override {
            if (frame.size() < 14 || frame.size() > 1518) return SendStatus::failed;
            if (!kept.empty()) (void)inner().send(kept);
            kept = frame;
            return SendStatus::sent;
        }
        std::size_t receive(Memory into) noexcept override {
            if (!kept.empty()) (void)inner().send(std::exchange(kept, {}));
            return inner().receive(into);
        }
    } nic{wire};
    expect_found(nic, "a slave answers");
}

TEST_F(FaultyNics, SendWaitsForTheWire) {
    struct Slow : FilterNic {
        Slow(Nic& inner, VirtualOsal& osal) : FilterNic(inner), clock(osal) {}
        VirtualOsal& clock;
        SendStatus send(Frame frame) noexcept override {
            clock.advance(frame.size() * 80ns);
            return inner().send(frame);
        }
    } nic{wire, osal};
    expect_found(nic, "send() is busy when the queue is full, and never waits");
}

TEST_F(FaultyNics, ReceiveWaits) {
    struct Slow : FilterNic {
        Slow(Nic& inner, VirtualOsal& osal) : FilterNic(inner), clock(osal) {}
        VirtualOsal& clock;
        std::size_t receive(Memory into) noexcept override {
            const auto length = inner().receive(into);
            if (length == 0) clock.advance(1ms);
            return length;
        }
    } nic{wire, osal};
    expect_found(nic, "receive() without a frame returns 0 at once");
}

TEST_F(FaultyNics, ReceiveWritesBehindTheMemory) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        std::size_t receive(Memory into) noexcept override {
            // Whole words, also for a length that is not a multiple of 4.
            const auto length = inner().receive(into);
            if (length == into.size()) into.data()[length] = std::byte{0};
            return length;
        }
    } nic{wire};
    expect_found(nic, "a long frame is cut to the memory, and its rest is gone");
}

TEST_F(FaultyNics, OnlyWholeWordsAreCopied) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        std::size_t receive(Memory into) noexcept override { return inner().receive(into.first(into.size() / 4 * 4)); }
    } nic{wire};
    expect_found(nic, "a long frame is cut to the memory, and its rest is gone");
}

TEST_F(FaultyNics, ItWantsRoomForTheFcs) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        std::size_t receive(Memory into) noexcept override {
            return inner().receive(into.size() < 1518 && into.size() > 1000 ? into.first(into.size() - 4) : into);
        }
    } nic{wire};
    expect_found(nic, "a long frame is cut to the memory, and its rest is gone");
}

TEST_F(FaultyNics, TheRestOfACutFrameComesNext) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        std::array<std::byte, 2048> all{};
        std::size_t begin = 0;
        std::size_t end = 0;
        std::size_t receive(Memory into) noexcept override {
            if (begin == end) {
                begin = 0;
                end = inner().receive(all);
            }
            const auto length = std::min(end - begin, into.size());
            std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(begin), length, into.begin());
            begin += length;
            return length;
        }
        Time next_arrival() const noexcept override { return begin != end ? Time{} : inner().next_arrival(); }
    } nic{wire};
    expect_found(nic, "a long frame is cut to the memory, and its rest is gone");
}

// Each interrupt of the NIC is for all frames that have arrived until then. A frame that stays in the NIC causes no
// other interrupt.
TEST_F(FaultyNics, AFrameThatIsLeftRaisesNoInterrupt) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        bool served = false;
        SendStatus send(Frame frame) noexcept override {
            served = false;
            return inner().send(frame);
        }
        std::size_t receive(Memory into) noexcept override {
            const auto length = inner().receive(into);
            served = served || length != 0;
            return length;
        }
        Time next_arrival() const noexcept override { return served ? kNever : inner().next_arrival(); }
    } nic{wire};
    expect_found(nic, "a frame that is left ends a wait()");
}

// A NIC with an interrupt, and an Osal whose wait() uses up the interrupt, as a semaphore does.
struct InterruptNic : FilterNic {
    using FilterNic::FilterNic;
    SendStatus send(Frame frame) noexcept override {
        raised = true;
        return inner().send(frame);
    }
    std::size_t receive(Memory into) noexcept override {
        const auto length = inner().receive(into);
        raised = raised || (length != 0 && rearms);
        return length;
    }
    [[nodiscard]] Time next_arrival() const noexcept override { return kNever; }
    [[nodiscard]] Time interrupt() const noexcept { return raised ? later(inner().next_arrival(), late) : kNever; }
    bool raised = false;
    Duration late{};
    bool rearms = true;  // raises the interrupt for a frame that is left
};

struct Semaphore : Osal {
    Semaphore(VirtualOsal& clock, InterruptNic& source)
        : Osal(ThreadIdentity::thread_pointer), inner(clock), nic(source) {}
    std::uintptr_t calling_thread() noexcept override { return inner.thread_number(); }
    Time now() noexcept override {
        inner.advance(1us);
        return inner.now();
    }
    void wait(Time until, WaitHandles handle) noexcept override {
        const Time interrupt = nic.interrupt();
        inner.wait(std::min(until, interrupt), handle);
        if (interrupt <= until) nic.raised = false;
    }
    VirtualOsal& inner;
    InterruptNic& nic;
};

TEST_F(FaultyNics, AFrameThatIsLeftRaisesNoInterruptAfterAWait) {
    InterruptNic nic(wire);
    Semaphore waits(osal, nic);
    EXPECT_EQ(failures(nic, waits), Names{}) << host.text();
    host.lines.clear();
    nic.rearms = false;
    const auto all = failures(nic, waits);
    EXPECT_TRUE(std::ranges::count(all, "a frame that is left ends a wait()") == 1) << host.text();
}

TEST_F(FaultyNics, TheSameFrameComesForEver) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        std::array<std::byte, 2048> last{};
        std::size_t size = 0;
        std::size_t receive(Memory into) noexcept override {
            if (const auto length = inner().receive(into); length != 0) {
                size = length;
                std::copy_n(into.begin(), size, last.begin());
            } else {
                std::copy_n(last.begin(), std::min(size, into.size()), into.begin());
            }
            return std::min(size, into.size());
        }
    } nic{wire};
    EXPECT_FALSE(failures(nic).empty());
    EXPECT_NE(host.text().find("receive() returns frames without an end"), std::string::npos) << host.text();
}

// The suite does not report frames as lost that come back in a wrong way.
class OddReplies : public FilterNic {
  public:
    OddReplies(Nic& inner, bool unmarked) : FilterNic(inner), unmarked_(unmarked) {}
    [[nodiscard]] bool hides_own_frames() const noexcept override { return false; }
    std::size_t receive(Memory into) noexcept override {
        const auto length = inner().receive(into);
        if (length != 0 && unmarked_) into[6] &= ~std::byte{2};
        if (length != 0 && !unmarked_) into[30] ^= std::byte{1};
        return length;
    }

  private:
    bool unmarked_;
};

TEST_F(FaultyNics, RepliesThatAreChangedAreSaidToBe) {
    OddReplies nic(wire, false);
    (void)failures(nic);
    EXPECT_NE(host.text().find("a slave answers: a frame came back changed"), std::string::npos) << host.text();
}

TEST_F(FaultyNics, RepliesWithoutTheMarkAreSaidToBe) {
    OddReplies nic(wire, true);
    (void)failures(nic);
    EXPECT_NE(host.text().find("a slave answers: frames come back without the mark of a slave"), std::string::npos)
        << host.text();
}

TEST_F(FaultyNics, ACutFrameLocksTheReceiver) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        bool locked = false;
        std::size_t receive(Memory into) noexcept override {
            if (locked) return 0;
            const auto length = inner().receive(into);
            locked = length == into.size() && length != 0;
            return length;
        }
        Time next_arrival() const noexcept override { return locked ? kNever : inner().next_arrival(); }
    } nic{wire};
    expect_found(nic, "a long frame is cut to the memory, and its rest is gone");
}

TEST_F(FaultyNics, FramesAreDoubled) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            if (frame.size() > 1000) (void)inner().send(frame);
            return inner().send(frame);
        }
    } nic{wire};
    expect_found(nic, "frames of different sizes follow each other");
}

TEST_F(FaultyNics, FramesOvertakeEachOther) {
    // The descriptors are read from the wrong end.
    struct Stack : FilterNic {
        using FilterNic::FilterNic;
        std::vector<std::vector<std::byte>> frames;
        std::size_t receive(Memory into) noexcept override {
            std::vector<std::byte> next(2048);
            while (const auto length = inner().receive(next)) frames.emplace_back(next.data(), next.data() + length);
            if (frames.empty()) return 0;
            const auto last = frames.back();
            frames.pop_back();
            std::copy_n(last.begin(), std::min(last.size(), into.size()), into.begin());
            return std::min(last.size(), into.size());
        }
        Time next_arrival() const noexcept override { return frames.empty() ? inner().next_arrival() : Time{}; }
    } nic{wire};
    expect_found(nic, "a burst comes back complete and in order");
}

TEST_F(FaultyNics, TheReceiveQueueIsSmallerThanSaid) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        unsigned queued = 0;
        std::size_t receive(Memory into) noexcept override {
            std::array<std::byte, 2048> lost{};
            while (queued > 4) {
                (void)inner().receive(lost);
                --queued;
            }
            queued = 0;
            return inner().receive(into);
        }
        SendStatus send(Frame frame) noexcept override {
            ++queued;
            return inner().send(frame);
        }
    } nic{wire};
    expect_found(nic, "a burst comes back complete and in order");
}

TEST_F(FaultyNics, TheSourceAddressHasTheMark) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        MacAddress source_mac() const noexcept override { return {2, 0, 0, 0, 0, 1}; }
    } nic{wire};
    expect_found(nic, "source_mac() leaves the mark of the slaves free");
}

TEST_F(FaultyNics, OwnFramesComeBack) {
    struct Hub : FilterNic {
        using FilterNic::FilterNic;
        std::vector<std::byte> echo;
        SendStatus send(Frame frame) noexcept override {
            echo.assign(frame.begin(), frame.end());
            return inner().send(frame);
        }
        std::size_t receive(Memory into) noexcept override {
            if (echo.empty()) return inner().receive(into);
            const auto frame = std::exchange(echo, {});
            const auto length = std::min(frame.size(), into.size());
            std::copy_n(frame.begin(), length, into.begin());
            return length;
        }
        bool hides_own_frames() const noexcept override { return says_hidden; }
        bool says_hidden = true;
    } nic{wire};
    expect_found(nic, "frames of every size come back unchanged");
    host.lines.clear();
    nic.says_hidden = false;
    EXPECT_EQ(failures(nic), Names{}) << "a NIC that does not hide its echo is right: " << host.text();
}

TEST_F(FaultyNics, WhatIsNotAFrameIsAccepted) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            if (frame.size() > 1518) return SendStatus::sent;
            return inner().send(frame);
        }
    } nic{wire};
    expect_found(nic, "send() refuses what is not a frame");
}

TEST_F(FaultyNics, AFrameDoesNotEndAWait) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        Time next_arrival() const noexcept override { return kNever; }  // in virtual time: no wake-up by the frame
    } nic{wire};
    const Time begin = osal.now();
    expect_found(nic, "a frame ends a wait()");
    EXPECT_EQ(host.failed().front(), "a frame ends a wait()") << "the first line tells the cause\n" << host.text();
    EXPECT_LT(host.text().find("FAIL  a frame ends a wait()"), host.text().find("run   frames of every size"));
    EXPECT_LT(osal.now() - begin, 60s) << "all later checks wait in vain for each frame";
}

TEST_F(FaultyNics, AFrameEndsAWaitTooLate) {
    InterruptNic nic(wire);
    nic.late = 20ms;
    Semaphore waits(osal, nic);
    const auto all = failures(nic, waits);
    EXPECT_TRUE(std::ranges::count(all, "a frame ends a wait()") == 1) << host.text();
}

TEST_F(FaultyNics, TheLinkIsDownNowAndThen) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        unsigned calls = 0;
        LinkState link_state() noexcept override { return ++calls % 10 == 0 ? LinkState::down : inner().link_state(); }
    } nic{wire};
    expect_found(nic, "link_state() is up with a cable");
}

TEST_F(FaultyNics, TheLinkIsAlwaysUp) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        LinkState link_state() noexcept override { return LinkState::up; }
    } nic{wire};
    expect_found(nic, "link_state() follows the cable");
}

TEST_F(FaultyNics, TheLinkStaysDown) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        bool was_down = false;  // the latched bit of a PHY, never cleared
        LinkState link_state() noexcept override {
            was_down = was_down || inner().link_state() == LinkState::down;
            return was_down ? LinkState::down : LinkState::up;
        }
    } nic{wire};
    expect_found(nic, "link_state() follows the cable");
}

// Frames of one size are lost or damaged, as by a USB adapter that does not end a transfer of a multiple of 64 octets.
struct OneSize : FilterNic {
    OneSize(Nic& inner, std::size_t bad_size, bool damages) : FilterNic(inner), size(bad_size), damaged(damages) {}
    std::size_t size;
    bool damaged;
    SendStatus send(Frame frame) noexcept override {
        if (frame.size() != size) return inner().send(frame);
        if (!damaged) return SendStatus::sent;
        std::array<std::byte, 2048> copy{};
        std::ranges::copy(frame, copy.begin());
        copy[size - 3] ^= std::byte{1};
        return inner().send(std::span(copy).first(size));
    }
};

TEST_F(FaultyNics, FramesOfOneSizeAreLostOrDamaged) {
    for (const std::size_t size : {128U, 256U, 512U, 1024U, 1400U, 1484U, 1500U, 1512U}) {
        OneSize nic(wire, size, size % 8 == 4);
        host.lines.clear();
        expect_found(nic, "frames of every size come back unchanged");
    }
}

TEST_F(FaultyNics, FramesWithAVlanTagAreRefused) {
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            return frame.size() > 1514 ? SendStatus::failed : inner().send(frame);
        }
    } nic{wire};
    expect_found(nic, "send() takes all that is a frame");
}

TEST_F(FaultyNics, AFullQueueLosesWhatItSaysItHasSent) {
    // The queue is longer than a burst.
    struct : FilterNic {
        using FilterNic::FilterNic;
        SendStatus send(Frame frame) noexcept override {
            const auto status = inner().send(frame);
            return status == SendStatus::busy ? SendStatus::sent : status;
        }
    } nic{wire};
    expect_found(nic, "what send() takes comes back");
}

TEST_F(FaultyNics, AFrameThatIsThereDoesNotEndAWait) {
    // An edge-triggered interrupt, and no flag that stores it.
    struct Edge : FilterNic {
        Edge(Nic& inner, VirtualOsal& osal) : FilterNic(inner), clock(osal) {}
        VirtualOsal& clock;
        Time next_arrival() const noexcept override {
            const Time next = inner().next_arrival();
            return next > clock.now() ? next : kNever;
        }
    } nic{wire, osal};
    expect_found(nic, "a frame that is there ends a wait()");
}

TEST_F(FaultyNics, ReceiveOfAFrameWaits) {
    struct Slow : FilterNic {
        Slow(Nic& inner, VirtualOsal& osal) : FilterNic(inner), clock(osal) {}
        VirtualOsal& clock;
        std::size_t receive(Memory into) noexcept override {
            const auto length = inner().receive(into);
            if (length != 0) clock.advance(5ms);
            return length;
        }
    } nic{wire, osal};
    expect_found(nic, "receive() of a frame does not wait");
}

TEST_F(FaultyNics, LinkStateWaits) {
    struct Slow : FilterNic {
        Slow(Nic& inner, VirtualOsal& osal) : FilterNic(inner), clock(osal) {}
        VirtualOsal& clock;
        LinkState link_state() noexcept override {
            clock.advance(20ms);
            return inner().link_state();
        }
    } nic{wire, osal};
    expect_found(nic, "link_state() does not wait");
}

TEST_F(FaultyNics, NothingIsConnected) {
    segment.set_cable({0, 0}, false);
    expect_found(wire, "link_state() is up with a cable");
    EXPECT_EQ(std::ranges::count(host.failed(), "a slave answers"), 1) << host.text();
}

// A NIC with times of frames, which has one fault.
struct FaultyTimes : FaultyNics {
    SimulatedNic timed{segment, osal, {.queue_frames = 16, .time_stamps = true, .timed_frames = 4}};

    struct Changed : FilterNic, SendClock, ReceiveClock, TimedSend {
        explicit Changed(SimulatedNic& inner) : FilterNic(inner), nic(inner) {}
        SimulatedNic& nic;
        FrameTiming timing() noexcept override { return {this, this, this}; }
        std::optional<std::uint64_t> send_time_ns(Frame head) noexcept override { return nic.send_time_ns(head); }
        std::optional<std::uint64_t> receive_time_ns(Frame head) noexcept override { return nic.receive_time_ns(head); }
        void set_send_time(Time at) noexcept override { nic.set_send_time(at); }
        std::uint64_t missed() noexcept override { return nic.missed(); }
    };
};

TEST_F(FaultyTimes, TheSoundOneFailsNothing) {
    Changed nic(timed);
    EXPECT_EQ(failures(nic), Names{}) << host.text();
}

TEST_F(FaultyTimes, TheClockCountsTooFast) {
    struct : Changed {
        using Changed::Changed;
        std::optional<std::uint64_t> send_time_ns(Frame head) noexcept override {
            const auto time = nic.send_time_ns(head);
            return time ? std::optional(*time + *time / 4) : time;
        }
    } nic{timed};
    expect_found(nic, "the times of sent frames count as the clock does");
}

TEST_F(FaultyTimes, TheReceiveTimeIsThatOfTheFrameBefore) {
    struct : Changed {
        using Changed::Changed;
        std::optional<std::uint64_t> last, now;
        std::size_t receive(Memory into) noexcept override {
            const auto length = inner().receive(into);
            if (length >= SendClock::kHeadBytes)
                last = std::exchange(now, nic.receive_time_ns(into.first(SendClock::kHeadBytes)));
            return length;
        }
        std::optional<std::uint64_t> receive_time_ns(Frame) noexcept override { return last; }
    } nic{timed};
    expect_found(nic, "a frame is received after it was sent");
}

TEST_F(FaultyTimes, TheTimeOfAnyFrameIsReturned) {
    struct : Changed {
        using Changed::Changed;
        std::optional<std::uint64_t> send_time_ns(Frame) noexcept override { return 1; }
    } nic{timed};
    expect_found(nic, "a frame that was not sent has no time");
}

TEST_F(FaultyTimes, TheClocksDiffer) {
    struct : Changed {
        using Changed::Changed;
        std::optional<std::uint64_t> receive_time_ns(Frame head) noexcept override {
            const auto time = nic.receive_time_ns(head);
            return time ? std::optional(*time + 1'000'000'000) : time;
        }
    } nic{timed};
    expect_found(nic, "a frame is received after it was sent");
}

TEST_F(FaultyTimes, TheTimeOfAFrameIsIgnored) {
    struct : Changed {
        using Changed::Changed;
        void set_send_time(Time) noexcept override {}
    } nic{timed};
    expect_found(nic, "a frame leaves at its time");
}

TEST_F(FaultyTimes, AFrameThatIsTooLateIsNotCounted) {
    struct : Changed {
        using Changed::Changed;
        std::uint64_t missed() noexcept override { return 0; }
    } nic{timed};
    expect_found(nic, "a frame whose time has passed leaves at once, and is counted");
}

TEST_F(FaultyTimes, TheTimeStaysForLaterFrames) {
    struct : Changed {
        using Changed::Changed;
        void set_send_time(Time at) noexcept override {
            if (at != kAtOnce) nic.set_send_time(at);
        }
    } nic{timed};
    expect_found(nic, "a frame without a time leaves at once");
}

}  // namespace
}  // namespace margay::port
