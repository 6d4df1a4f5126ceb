// test/embedded/sizes compares the sizes of one sequence in two manners: as the coroutines of src/station/al_state.cpp,
// and as a state machine written by hand. Here both exchange the same frames and have the same results.
#include "embedded/sizes/al_state_machine.hpp"

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/filter_nic.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "sim/library/quirks.hpp"
#include "sim/segment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;

class FrameStore final : public FilterNic {
  public:
    using FilterNic::FilterNic;
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        frames.emplace_back(frame.begin(), frame.end());
        return FilterNic::send(frame);
    }
    std::vector<std::vector<std::byte>> frames;
};

// One slave with a station address, and an engine.
struct OneSlave {
    OneSlave(const char* name, const char* quirk) {
        auto device = sim::make_device(name).value();
        EXPECT_TRUE(quirk == nullptr || sim::add_quirk(device, quirk));
        EXPECT_EQ(segment.add(std::move(device).assemble()), 0U);
        EXPECT_TRUE(segment.connect_master({0, 0}));
        segment.power_up(osal.now());
        osal.advance(1ms);
        OwnedTask<> task = assign_address();
        finish(task);
        EXPECT_TRUE(task.result());
    }
    Task<Result<>> assign_address() {
        const std::array<std::byte, 2> address{std::byte{0x01}, std::byte{0x10}};
        Datagram write(engine.link(), wire::Command::APWR, {std::uint16_t{0}, wire::reg::kStationAddress.address},
                       Bytes(address));
        const Reply reply = co_await write;
        co_return error_of_reply(station, reply, Step::assign_address, 0);
    }
    // The processor of the slave may not have read this request yet when the sequence begins.
    Task<Result<>> request(AlState state) {
        co_return co_await write<std::uint16_t>(station, wire::reg::kAlControl, static_cast<std::uint16_t>(state),
                                                Step::request_state);
    }
    Arena& arena() { return engine.arena(); }

    template <class Sequence>
    void finish(Sequence& sequence) {
        engine.poll(osal.now());
        sequence.start();
        for (int polls = 0; polls < 100000 && !sequence.done(); ++polls) osal.wait(engine.poll(osal.now()), -1);
        EXPECT_TRUE(sequence.done());
    }

    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    FrameStore nic{wire};
    std::vector<FrameSlot> slots = std::vector<FrameSlot>(4);
    std::vector<std::byte> memory = std::vector<std::byte>(16 * 1024);
    Engine engine{nic, slots, memory};
    Station station{engine, {0x1001}, 1};
};

struct AlChange {
    const char* device;
    const char* quirk;
    AlState first;  // requested before without waiting; NONE: no request
    Duration after;
    AlState state;
    std::uint16_t address;
    Duration timeout;
    Errc expected;
};

// Returns the frames of the state change.
template <class Begin>
std::vector<std::vector<std::byte>> frames_of(const AlChange& one, const Begin& begin) {
    OneSlave slave(one.device, one.quirk);
    if (one.first != AlState::none) {
        OwnedTask<> before = slave.request(one.first);
        slave.finish(before);
        slave.osal.advance(one.after);
    }
    slave.station.address = {one.address};
    slave.nic.frames.clear();
    auto sequence = begin(slave.station);
    slave.finish(*sequence);
    const Result<AlStatus> result = sequence->result();
    EXPECT_EQ(result.error().code, one.expected);
    EXPECT_TRUE(!result || result->state == one.state);
    sequence.reset();
    EXPECT_EQ(slave.arena().used_bytes(), 0U);
    return slave.nic.frames;
}

TEST(AlStateMachine, DoesTheSameAsTheCoroutines) {
    using enum AlState;
    const AlChange cases[] = {
        {"digital_out_8", nullptr, none, 0ms, preop, 0x1001, 3s, Errc::none},
        {"digital_out_8", nullptr, none, 0ms, preop, 0x2002, 3s, Errc::working_counter},  // no slave has this address
        {"drive", nullptr, none, 0ms, preop, 0x1001, 3s, Errc::al_status},                // no mailbox is set up yet
        {"drive", nullptr, preop, 0ms, init, 0x1001, 3s, Errc::none},                     // acknowledges this error
        {"drive", "slow_firmware", preop, 20ms, init, 0x1001, 3s, Errc::none},            // the error stays for a while
        {"drive", "slow_firmware", none, 0ms, preop, 0x1001, 1ms, Errc::timeout},
        {"drive", "slow_firmware", none, 0ms, preop, 0x1001, 3s, Errc::al_status},
        {"drive", "slow_firmware", preop, 0ms, init, 0x1001, 3s, Errc::al_status},  // does not take it at first
        {"drive", "slow_firmware", preop, 0ms, init, 0x1001, 1ms, Errc::timeout},
    };
    std::size_t longest = 0;
    for (const AlChange& one : cases) {
        const auto by_coroutines = frames_of(one, [&](Station station) {
            return std::make_unique<OwnedTask<Result<AlStatus>>>(
                change_al_state(station, one.state, false, one.timeout));
        });
        const auto by_machine = frames_of(one, [&](Station station) {
            return std::make_unique<AlStateMachine>(station, one.state, false, one.timeout);
        });
        EXPECT_EQ(by_coroutines, by_machine) << &one - cases;
        EXPECT_FALSE(by_machine.empty());
        longest = std::max(longest, by_machine.size());
    }
    EXPECT_GT(longest, 10U) << "the machine has waited";
}

}  // namespace
}  // namespace margay
