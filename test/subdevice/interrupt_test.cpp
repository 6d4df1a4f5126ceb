// interrupt(), sync0() and sync1() beside step(): the data that the lock protects, and reads of the master while an
// interrupt handler changes the values.
#include "interrupted.hpp"

#include <atomic>
#include <mutex>
#include <thread>

namespace margay::subdevice {
namespace {

using namespace testing;

class BetweenAnyTwoSteps : public ::testing::TestWithParam<RunMode> {};

TEST_P(BetweenAnyTwoSteps, AnInterruptChangesNothingButTheProcessData) {
    unsigned points = 1;
    for (unsigned strike = 0; strike <= points; ++strike) {
        SCOPED_TRACE(strike);
        Interrupted rig(GetParam());
        rig.pdi.strike = strike;  // 0: everywhere
        rig.pdi.handler = [&] {
            rig.put_outputs(5);
            (void)rig.device.interrupt(rig.esc.time);
        };
        rig.session();
        points = rig.pdi.points;
        EXPECT_EQ(rig.pdi.unlocked_accesses, 0u) << "each access of the stack to the ESC holds the lock";
        EXPECT_LE(rig.pdi.longest_access, EscAccess::kMostLockedBytes);
        if (::testing::Test::HasFailure()) return;
    }
    EXPECT_GT(points, 200u);
}

TEST_P(BetweenAnyTwoSteps, ASync0AtItsPinChangesNothingButTheProcessData) {
    unsigned points = 1;
    for (unsigned strike = 0; strike <= points; ++strike) {
        SCOPED_TRACE(strike);
        Interrupted rig(GetParam());
        rig.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
        rig.esc.ecat_set<std::uint8_t>(0x0981, 3);
        SyncValues<Values::sync>::error_limit::store(rig.image, 0);
        rig.pdi.strike = strike;
        rig.pdi.handler = [&] { rig.device.sync0(rig.esc.time); };
        ASSERT_EQ(rig.request(4), (AlStatus{AlState::safeop, false, 0}));
        rig.device.sync0(rig.esc.time);
        rig.put_outputs(3);
        rig.run();
        ASSERT_EQ(rig.request(8), (AlStatus{AlState::op, false, 0}));
        rig.check_values();
        ASSERT_EQ(rig.request(2), (AlStatus{AlState::preop, false, 0}));
        points = rig.pdi.points;
        if (::testing::Test::HasFailure()) return;
    }
    EXPECT_GT(points, 100u);
}

INSTANTIATE_TEST_SUITE_P(Modes, BetweenAnyTwoSteps,
                         ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

// Complete access holds the lock for one value at a time. The test counts the interrupts between two values of 0x2006.
unsigned interrupts_between_values(const std::vector<std::byte>& request) {
    Interrupted rig(RunMode::mixed);
    unsigned found = 0;
    unsigned points = 1;
    for (unsigned strike = 1; strike <= points; ++strike) {
        Values::mixed_a::store(rig.image, 1);
        Values::mixed_b::store(rig.image, 0xA1B2C3D4);
        bool between = false;
        rig.pdi.points = 0;
        rig.pdi.strike = strike;
        rig.pdi.handler = [&] {
            between = Values::mixed_a::load(rig.image) == 0 && Values::mixed_b::load(rig.image) == 0xA1B2C3D4;
            Values::mixed_a::store(rig.image, 0);
            Values::mixed_b::store(rig.image, 0xFFFFFFFF);
        };
        const auto reply = rig.exchange(request);
        points = rig.pdi.points;
        if (reply.size() > 18)
            between = (reply[12] & std::byte{1}) != std::byte{0} && load_le<std::uint32_t>(reply, 13) == 0xFFFFFFFF;
        found += between ? 1 : 0;
    }
    return found;
}

TEST(CompleteAccess, AnInterruptExecutesBetweenTwoValues) {
    EXPECT_GT(interrupts_between_values(sdo_request(0x50, 0x2006, 0)), 0u);
    auto write = sdo_request(0x31, 0x2006, 1, 8);
    for (const int octet : {0, 1, 2, 3, 4, 0, 0, 5}) write.push_back(static_cast<std::byte>(octet));
    EXPECT_GT(interrupts_between_values(write), 0u);
}

// The same with a thread: interrupt() is executed at any machine instruction of step() at which the lock is free.
class ThreadedEsc final : public EscAccess {
  public:
    explicit ThreadedEsc(PlainEsc& esc) : esc_(esc) {}
    void read(std::uint16_t address, MutableBytes into) noexcept override { esc_.read(address, into); }
    void write(std::uint16_t address, Bytes data) noexcept override { esc_.write(address, data); }
    [[nodiscard]] Time now() noexcept override { return {}; }
    [[nodiscard]] std::uint32_t lock() noexcept override { return mutex_.lock(), 0; }
    void unlock(std::uint32_t) noexcept override { mutex_.unlock(); }

  private:
    PlainEsc& esc_;
    std::recursive_mutex mutex_;
};

TEST(InterruptThread, ValuesThatTheMasterReadsAreOfOneUpdate) {
    PlainEsc plain;
    ThreadedEsc esc(plain);
    std::array<std::byte, Values::bytes> image{};
    CountingApplication application(image);
    ObjectDictionary dictionary(table::kObjects, image, &application);
    std::array<std::byte, 512> staging{};
    CoeServer coe(dictionary, staging, true);
    const MailboxProtocol protocols[] = {{wire::MailboxType::coe, &coe}};
    MailboxMemory<512, 4> memory;
    application.description_value.mailbox.receive.max_bytes = 512;
    application.description_value.mailbox.send = {.start = 0x2000, .size_bytes = 512};
    application.description_value.mailbox.receive.start = 0x1800;
    Mailbox mailbox(esc, memory, protocols);
    ProcessDataMemory<16, 16, 8> process_memory;
    ProcessData process_data(esc, application, dictionary, process_memory);
    Device device(esc, application, process_data, &mailbox, nullptr, RunMode::interrupts);
    const auto locked = [&](const auto& action) {
        const Guard guard(esc);
        return action();
    };
    const auto request = [&](std::uint16_t control) {
        locked([&] { plain.al_control(control); });
        const auto state = [&] { return locked([&] { return plain.al_status().state; }); };
        for (int i = 0; i < 1'000'000 && state() != static_cast<AlState>(control); ++i) (void)device.step({});
        return state();
    };
    device.start({});
    plain.configure(0, {0x1800, 512, 0x26, 1});
    plain.configure(1, {0x2000, 512, 0x22, 1});
    plain.configure(2, {0x1200, 4, 0x64, 1});
    plain.configure(3, {0x1300, 6, 0x20, 1});
    ASSERT_EQ(request(2), AlState::preop);
    std::atomic<bool> stop = false;
    std::thread handler([&] {
        while (!stop) {
            locked([&] { (void)plain.ecat_write(0x1200, raw({5, 5, 0, 1})); });
            (void)device.interrupt({});
        }
    });
    std::uint8_t counter = 0;
    const auto upload = [&](int index) {
        counter = wire::next_mailbox_counter(counter);
        std::vector<std::byte> message(512);
        const auto data = sdo_request(0x40, index, 0);
        wire::store_mailbox_header(
            message,
            {.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::coe, .counter = counter});
        std::copy(data.begin(), data.end(), message.begin() + 6);
        EXPECT_TRUE(locked([&] { return plain.ecat_write(0x1800, message); }));
        (void)device.step({});
        std::vector<std::byte> reply(512);
        EXPECT_TRUE(locked([&] { return plain.ecat_read(0x2000, reply); }));
        (void)device.step({});
        return std::vector<std::byte>(reply.begin() + 16, reply.begin() + 6 + load_le<std::uint16_t>(reply));
    };
    for (int round = 0; round < 40 && !::testing::Test::HasFailure(); ++round) {
        EXPECT_EQ(request(4), AlState::safeop);
        EXPECT_EQ(request(8), AlState::op);
        for (int n = 0; n < 20; ++n) {
            const auto big = upload(0x2001);
            EXPECT_EQ(load_le<std::uint32_t>(big), load_le<std::uint32_t>(big, 4));
            const auto block = upload(0x2003);
            EXPECT_EQ(block, std::vector<std::byte>(300, block.at(0)));
            // An event of the SyncManagers. The state machine compares them with the mapping again.
            locked([&] { plain.ecat_set<std::uint8_t>(0x081E, 1); });
            (void)device.step({});
        }
        EXPECT_EQ(request(2), AlState::preop);
    }
    stop = true;
    handler.join();
}

}  // namespace
}  // namespace margay::subdevice
