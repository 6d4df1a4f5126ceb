// interrupt(), sync0() and sync1() beside step(): what the lock protects, which events stay masked, SYNC signals at
// pins, and the master's reading of values while an interrupt handler changes them.
#include "bench_device.hpp"

#include "subdevice/foe_server.hpp"
#include "subdevice/sii_image.hpp"

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>

namespace margay::subdevice {
namespace {

using namespace testing;
namespace reg = wire::reg;

// An access to the ESC whose lock interrupts the device: `handler` executes at each point where an interrupt could
// occur, that is before a critical section begins and after it ends.
class Interruptible final : public EscAccess {
  public:
    explicit Interruptible(PlainEsc& esc) : esc_(esc) {}
    void read(std::uint16_t address, MutableBytes into) noexcept override {
        note_access(into.size());
        esc_.read(address, into);
    }
    void write(std::uint16_t address, Bytes data) noexcept override {
        note_access(data.size());
        esc_.write(address, data);
    }
    [[nodiscard]] Time now() noexcept override { return esc_.now(); }
    [[nodiscard]] std::uint32_t lock() noexcept override {
        if (depth_ == 0) point();
        return depth_++;
    }
    void unlock(std::uint32_t before) noexcept override {
        depth_ = before;
        if (depth_ == 0) point();
    }
    // A place where an interrupt may occur, for hooks.
    void point() {
        if (inside_ || !handler) return;
        ++points;
        if (points != strike && strike != kEverywhere) return;
        inside_ = true;
        handler();
        inside_ = false;
    }
    [[nodiscard]] bool locked() const { return depth_ != 0 && !inside_; }

    static constexpr unsigned kEverywhere = 0;
    std::function<void()> handler;
    unsigned strike = kEverywhere;
    unsigned points = 0;
    unsigned unlocked_accesses = 0;
    std::size_t longest_access = 0;

  private:
    void note_access(std::size_t bytes) {
        unlocked_accesses += depth_ == 0 ? 1 : 0;
        longest_access = std::max(longest_access, bytes);
    }
    PlainEsc& esc_;
    std::uint32_t depth_ = 0;
    bool inside_ = false;
};

// Its cycle() changes several values that belong together.
class CountingApplication final : public ReportingApplication<3, 4, 3> {
  public:
    CountingApplication(std::span<std::byte> image) : image_(image) {}
    [[nodiscard]] const DeviceDescription& description() const override { return description_value; }
    Verdict before(Transition, Time) override { return in_step(), Verdict::go(); }
    void after(Transition transition, Time) override {
        in_step();
        state = transition.to;
    }
    void cycle(Time, bool outputs_valid) override {
        EXPECT_FALSE(inside_) << "one update within another";
        inside_ = true;
        ++cycles;
        Values::big::store(image_, cycles * 0x0000000100000001u);
        std::fill_n(image_.begin() + Values::block, 300, static_cast<std::byte>(cycles));
        if (outputs_valid) {
            EXPECT_EQ(Values::out_b::load(image_), Values::out_a::load(image_)) << "outputs of one frame";
        }
        inside_ = false;
    }
    void safe_outputs(Time) override { ++safe; }
    void in_step() const {
        if (pdi != nullptr) {
            EXPECT_FALSE(pdi->locked()) << "a hook executes with the lock held";
            pdi->point();
        }
    }
    DeviceDescription description_value = table::kDevice;
    Interruptible* pdi = nullptr;
    std::uint64_t cycles = 0;
    unsigned safe = 0;
    AlState state = AlState::init;

  private:
    std::span<std::byte> image_;
    bool inside_ = false;
};

// A device in one of the run modes, over an ESC that interrupts it.
class Interrupted {
  public:
    explicit Interrupted(RunMode mode) : device(pdi, application, process_data, &mailbox, nullptr, mode) {
        application.description_value.boot_mailbox = {};
        device.start(esc.time);
        hand.configure(128);
        esc.configure(2, {0x1200, 4, 0x64, 1});
        esc.configure(3, {0x1300, 6, 0x20, 1});
        (void)request(2);
        application.pdi = &pdi;
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        run();
        return esc.al_status();
    }
    void put_outputs(int value) { (void)esc.ecat_write(0x1200, raw({value, value, 0, 1})); }
    [[nodiscard]] bool line() const { return (esc.events() & esc.get<std::uint32_t>(reg::kAlEventMask.address)) != 0; }
    // As on hardware: the handler executes while the line is active, and step() after it.
    void run() {
        (void)device.step(esc.time);
        for (int i = 0; line(); ++i) {
            ASSERT_LT(i, 8) << "the interrupt line stays active: events " << std::hex << esc.events() << ", mask "
                            << esc.get<std::uint32_t>(reg::kAlEventMask.address);
            (void)device.interrupt(esc.time);
            (void)device.step(esc.time);
        }
    }
    // Exchanges mailbox messages until the reply has arrived.
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, data)));
        run();
        auto reply = hand.fetch();
        run();
        if (reply.empty()) return reply;
        reply.resize(wire::kMailboxHeaderBytes + wire::load_mailbox_header(reply).length);
        reply.erase(reply.begin(), reply.begin() + wire::kMailboxHeaderBytes);
        return reply;
    }
    // Both halves of 0x2001 belong to one update, and so do all octets of 0x2003.
    void check_values() {
        const auto big = exchange(sdo_request(0x40, 0x2001, 0));
        ASSERT_EQ(big.size(), 18u);
        EXPECT_EQ(load_le<std::uint32_t>(big, 10), load_le<std::uint32_t>(big, 14)) << "a value of two updates";
        auto reply = exchange(sdo_request(0x40, 0x2003, 0));
        ASSERT_GT(reply.size(), 10u);
        std::vector<std::byte> block(reply.begin() + 10, reply.end());
        for (int toggle = 0; block.size() < 300; toggle ^= 0x10) {
            reply = exchange(sdo_request(0x60 | toggle, 0, 0));
            ASSERT_GT(reply.size(), 3u);
            block.insert(block.end(), reply.begin() + 3, reply.end());
        }
        EXPECT_EQ(block, std::vector<std::byte>(block.size(), block[0])) << "a value of two updates";
    }
    // From PREOP to OP and back, with mailbox services in each state.
    void session() {
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        check_values();
        put_outputs(3);
        run();
        ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
        put_outputs(7);
        run();
        check_values();
        esc.ecat_set<std::uint8_t>(0x081E, 1);  // the event of a SyncManager that stays as it is
        run();
        ASSERT_EQ(esc.al_status(), (AlStatus{AlState::op, false, 0}));
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        EXPECT_EQ(Values::out_a::load(image), 9) << "the initial value";
        ASSERT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
        const auto cycles = application.cycles;
        (void)device.interrupt(esc.time);
        EXPECT_EQ(application.cycles, cycles) << "no update below SAFEOP";
        EXPECT_EQ(application.safe, 1u);
    }

    PlainEsc esc;
    Interruptible pdi{esc};
    std::array<std::byte, Values::bytes> image{};
    CountingApplication application{image};
    ObjectDictionary dictionary{table::kObjects, image, &application};
    std::array<std::byte, 512> staging{};
    CoeServer coe{dictionary, staging, true, application.emergencies()};
    MailboxProtocol protocols[1] = {{wire::MailboxType::coe, &coe}};
    MailboxMemory<256, 4> memory;
    Mailbox mailbox{pdi, memory, protocols};
    ProcessDataMemory<16, 16, 8> process_memory;
    ProcessData process_data{pdi, application, dictionary, process_memory};
    Device device;
    MailHand hand{esc};
};

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

// The same with a thread: interrupt() executes at any machine instruction of step() where the lock is free.
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
            // An event of the SyncManagers: the state machine compares them with the mapping again.
            locked([&] { plain.ecat_set<std::uint8_t>(0x081E, 1); });
            (void)device.step({});
        }
        EXPECT_EQ(request(2), AlState::preop);
    }
    stop = true;
    handler.join();
}

// ------------------------------------------------------------------ events that nobody can serve now

TEST(EventStorm, AFullMailboxOfAMasterThatDoesNotReadKeepsTheLineQuiet) {
    Interrupted rig(RunMode::interrupts);
    int sent = 0;
    while (rig.hand.put(rig.hand.message(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)))) {
        rig.run();  // fails when the line stays active
        ASSERT_LT(++sent, 20);
    }
    EXPECT_TRUE(rig.esc.full(0)) << "the last message stays in the mailbox";
    for (; sent > 0; --sent) {
        ASSERT_FALSE(rig.hand.fetch().empty()) << sent;
        ASSERT_TRUE(rig.line()) << "the device must hear that a slot is free";
        rig.run();
    }
    EXPECT_FALSE(rig.esc.full(0));
}

TEST(EventStorm, AReplyThatWasReadLastKeepsTheLineQuiet) {
    Interrupted rig(RunMode::interrupts);
    EXPECT_FALSE(rig.exchange(sdo_request(0x40, 0x1000, 0)).empty());
    EXPECT_NE(rig.esc.events() & wire::al_event::sync_manager(1), 0u) << "active until the next reply is written";
    EXPECT_FALSE(rig.line());
}

TEST(EventStorm, InputsThatTheMasterReadsBesideOutputsKeepTheLineQuiet) {
    for (const auto mode : {RunMode::mixed, RunMode::interrupts}) {
        Interrupted rig(mode);
        ASSERT_EQ(rig.request(4).state, AlState::safeop);
        rig.put_outputs(1);
        rig.run();
        std::vector<std::byte> inputs(6);
        ASSERT_TRUE(rig.esc.ecat_read(0x1300, inputs));
        rig.run();
        EXPECT_FALSE(rig.line());
    }
}

// ------------------------------------------------------------------ events that an update must leave

// interrupt() reads the watchdog settings of the SyncManagers. The event of their change is for step().
TEST(ChangedSyncManagers, AreNoticedAfterAnInterruptThatReadsTheirSettings) {
    Interrupted rig(RunMode::interrupts);
    rig.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    rig.esc.ecat_set<std::uint8_t>(0x0981, 3);
    ASSERT_EQ(rig.request(4).state, AlState::safeop);
    rig.put_outputs(5);
    rig.run();
    ASSERT_EQ(rig.request(8).state, AlState::safeop) << "it waits for SYNC0";
    rig.esc.configure(2, {0x1200, 4, 0x64, 0});
    (void)rig.device.interrupt(rig.esc.time);
    (void)rig.device.step(rig.esc.time);
    const AlStatus wrong{AlState::preop, true, static_cast<std::uint16_t>(AlStatusCode::invalid_output_configuration)};
    EXPECT_EQ(rig.esc.al_status(), wrong);
    rig.esc.raise(wire::al_event::kDcSync0);
    rig.run();
    EXPECT_EQ(rig.esc.al_status(), wrong);
    EXPECT_EQ(rig.application.safe, 0u);
}

TEST(ChangedSyncManagers, AreNoticedInOpWithOneOctetOfOutputs) {
    Bench bench;
    bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr,
                         RunMode::interrupts);
    bench.device->start(bench.esc.time);
    bench.configure(128);
    (void)bench.request(2);
    ASSERT_EQ(download(bench, 0x1600, 0, raw({0})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1600, 1, raw({8, 1, 0, 0x70})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1600, 0, raw({1})).abort, Abort::none);
    bench.esc.configure(2, {0x1200, 1, 0x64, 1});
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    bench.esc.time += 2ms;
    (void)bench.step();
    (void)bench.request(8);
    ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    bench.esc.time += 2ms;
    bench.esc.configure(2, {0x1200, 1, 0x64, 0});
    (void)bench.device->interrupt(bench.esc.time);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::preop, true, 0x001D}));
}

// The change comes while PREOP→SAFEOP is executed: after the checks, and before the process data start.
TEST(ChangedSyncManagers, AreNoticedWhenTheyChangeDuringTheTransition) {
    static Bench* at_work = nullptr;
    Bench bench;
    at_work = &bench;
    bench.application.transition_hook = [](Transition transition, Time) {
        if (transition.to == AlState::safeop) at_work->esc.configure(2, {0x1200, 4, 0x64, 0});
        return Verdict::go();
    };
    EXPECT_EQ(bench.request(4).state, AlState::safeop);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::preop, true, 0x001D}));
}

// ------------------------------------------------------------------ SYNC signals at pins

class SyncPins : public ::testing::TestWithParam<RunMode> {
  protected:
    SyncPins() {
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, GetParam());
        bench.device->start(bench.esc.time);
        bench.configure(128);
        (void)bench.request(2);
        bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
        bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    }
    void sync(Duration after = 1ms) {
        bench.esc.time += after;
        bench.device->sync0(bench.esc.time);
        (void)bench.step();
    }
    Bench bench;
};

TEST_P(SyncPins, Sync0RunsTheApplicationWithTheOutputsThatHaveArrived) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    const auto before = bench.application.cycles;
    sync();
    EXPECT_EQ(bench.application.cycles, before + 1);
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({0x42, 2, 0, 1})));
    sync();
    EXPECT_EQ(Values::out_a::load(bench.image), 0x42);
    EXPECT_EQ(bench.application.cycles, before + 2);
    EXPECT_TRUE(bench.application.last_valid);
    bench.esc.raise(wire::al_event::kDcSync0);  // the signal is also mapped as an event
    (void)bench.device->interrupt(bench.esc.time);
    (void)bench.step();
    EXPECT_EQ(bench.application.cycles, before + 2) << "not twice";
    EXPECT_EQ(bench.esc.get<std::uint32_t>(0x0204) & wire::al_event::kDcSync0, 0u);
}

TEST_P(SyncPins, MissedSync0AreCounted) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    for (int n = 0; n < 5; ++n) sync();
    sync(1100us);
    EXPECT_EQ(bench.process_data.counters().missed_syncs, 0u) << "jitter";
    sync(4ms);
    EXPECT_EQ(bench.process_data.counters().missed_syncs, 3u);
    sync(10s);
    EXPECT_NE(bench.process_data.counters().missed_syncs, 3u);
}

TEST_P(SyncPins, Sync1CallsTheApplication) {
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.application.syncs1, 0u) << "no process data in PREOP";
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    bench.device->sync1(bench.esc.time);
    EXPECT_EQ(bench.application.syncs1, 1u);
}

TEST_P(SyncPins, Sync1AsAnEventCallsTheApplication) {
    bench.application.description_value.dc.sync1 = true;
    bench.esc.ecat_set<std::uint8_t>(0x0981, 7);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    bench.esc.raise(wire::al_event::kDcSync1);
    if (GetParam() == RunMode::polling) {
        (void)bench.step();
    } else {
        EXPECT_NE(bench.esc.get<std::uint32_t>(0x0204) & wire::al_event::kDcSync1, 0u);
        (void)bench.device->interrupt(bench.esc.time);
    }
    EXPECT_EQ(bench.application.syncs1, 1u);
}

INSTANTIATE_TEST_SUITE_P(Modes, SyncPins, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

TEST(SyncSii, MapsTheSignalsThatTheDeviceNeeds) {
    Bench bench;
    auto& d = bench.application.description_value;
    const auto octet = [&](const BoardDescription& board) {
        std::array<std::byte, 2048> eeprom{};
        SiiWorkspace<8, 32> workspace;
        EXPECT_TRUE(write_sii(d, board, bench.dictionary, workspace, eeprom).ok());
        return std::to_integer<unsigned>(eeprom[3]);
    };
    EXPECT_EQ(octet({}), 0x0Cu) << "SYNC0 is an output and an AL event";
    d.dc.sync1 = true;
    EXPECT_EQ(octet({}), 0xCCu);
    EXPECT_EQ(octet({.sync0 = SyncPin{.output = true}, .sync1 = SyncPin{.output = true, .active_high = true}}), 0x64u);
    d.dc = {};
    EXPECT_EQ(octet({}), 0x00u) << "latch inputs";
}

// ------------------------------------------------------------------ sync objects

TEST(SyncObjects, TheMasterSetsTheLimitAndTheCycleTime) {
    Bench bench;
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 200'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    EXPECT_EQ(upload(bench, 0x10F1, 2).number(), 4u) << "the description's limit";
    ASSERT_EQ(download(bench, 0x10F1, 2, number(1, 2)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1C32, 2, number(1'000'000, 4)).abort, Abort::none);
    const auto sync = [&] {
        bench.esc.time += 200us;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    };
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(bench.process_data.syncs_per_frame(), 5u);
    EXPECT_EQ(download(bench, 0x10F1, 2, number(9, 2)).abort, Abort::device_state);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    (void)bench.request(8);
    sync();
    ASSERT_EQ(bench.esc.al_status().state, AlState::op);
    for (int n = 0; n < 20; ++n) {
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
        (void)bench.step();
        for (int k = 0; k < 5; ++k) sync();
    }
    EXPECT_EQ(bench.esc.al_status().state, AlState::op);
    EXPECT_EQ(upload(bench, 0x1C32, 0x0B).number(), 0u);
    for (int n = 0; n < 5; ++n) sync();
    EXPECT_EQ(bench.esc.al_status().code, static_cast<std::uint16_t>(AlStatusCode::synchronization_error));
    EXPECT_EQ(upload(bench, 0x1C32, 0x0B).number(), 1u);
    EXPECT_EQ(upload(bench, 0x1C32, 0x20).number(), 1u);
    EXPECT_EQ(upload(bench, 0x1C33, 4).number(), 6u) << "SM event, DC SYNC0";
}

}  // namespace
}  // namespace margay::subdevice
