// Devices without process data or events: old outputs, SyncManagers without events, values of every size that return to
// their initial values, and devices without the optional objects of the stack.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
namespace reg = wire::reg;

AlStatus refused(AlState state, AlStatusCode code) { return {state, true, static_cast<std::uint16_t>(code)}; }

// ------------------------------------------------------------------ initial values after OP

TEST(SafeValues, EveryTypeGoesBackToItsWholeInitialValue) {
    using wide = Field<std::int64_t, 0>;
    using pattern = Field<std::uint64_t, 8>;
    constexpr std::size_t kText = 16;
    constexpr auto kAccess = od::kReadWrite | od::kRxMappable;
    static constexpr Entry kValues[] = {entry_count(3), value<wide>(1, "Wide", kAccess, -1),
                                        value<pattern>(2, "Pattern", kAccess, 0x1122334455667788),
                                        octets(3, "Text", DataType::visible_string, kAccess, kText, 8, "none")};
    static constexpr Entry kMap[] = {entry_count(3), mapped(1, 0x7000, 1, 64), mapped(2, 0x7000, 2, 64),
                                     mapped(3, 0x7000, 3, 64)};
    static constexpr Entry kAssigned[] = {entry_count(1), assigned(1, 0x1600)};
    static constexpr Object kObjects[] = {record(0x1600, "Map", kMap), array(0x1C12, "Assignment", kAssigned),
                                          record(0x7000, "Values", kValues)};
    std::array<std::byte, 24> image{};
    ObjectDictionary dictionary(kObjects, image);
    dictionary.restore_defaults();
    const auto before = image;
    std::array<MappedEntry, 4> memory{};
    PdoMapping mapping(memory);
    ASSERT_EQ(mapping.build(dictionary, 0x1C12, 24), Abort::none);
    image.fill(std::byte{0x5A});
    mapping.reset();
    EXPECT_EQ(wide::load(image), -1);
    EXPECT_EQ(pattern::load(image), 0x1122334455667788u);
    EXPECT_EQ(image, before);
}

// ------------------------------------------------------------------ control octets that change in OP

void sm2_in_op(Bench& bench, std::uint8_t control) {
    bench.esc.configure(2, {0x1200, 4, control, 0});
    bench.esc.configure(2, {0x1200, 4, control, 1});
    (void)bench.step();
}

TEST(ControlInOp, OutputsWithoutAnEventAreFoundByPollingFromThenOn) {
    Bench bench;
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    (void)bench.step();
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    sm2_in_op(bench, 0x44);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({7, 2, 0, 1})));
    bench.esc.time += 1ms;
    EXPECT_LE(bench.step(), bench.esc.time + 1ms);
    EXPECT_EQ(Values::out_a::load(bench.image), 7);
    sm2_in_op(bench, 0x64);
    EXPECT_GT(bench.step(), bench.esc.time + 1ms) << "events tell again";
}

TEST(ControlInOp, AWatchdogThatIsSwitchedOnWatches) {
    Bench bench;
    bench.esc.configure(2, {0x1200, 4, 0x24, 1});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    (void)bench.step();
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(bench.step(), kNever);
    sm2_in_op(bench, 0x64);
    EXPECT_EQ(bench.step(), bench.esc.time + 100ms);
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    bench.esc.time += 60ms;
    sm2_in_op(bench, 0x64);  // does not start the time again
    bench.esc.time += 40ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::safeop, true, 0x001B}));
}

TEST(ControlInOp, ARequiredWatchdogThatIsSwitchedOffLeadsToPreop) {
    Bench bench;
    bench.application.description_value.outputs.watchdog_required = true;
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    (void)bench.step();
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    sm2_in_op(bench, 0x24);
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::preop, true, 0x001F}));
}

// ------------------------------------------------------------------ old outputs

void put_outputs(Bench& bench) { ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1}))); }

TEST(OldOutputs, OutputsOfAnExpiredWatchdogDoNotLeadToOp) {
    Bench bench;
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    put_outputs(bench);
    (void)bench.step();
    bench.esc.time += 10s;
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    EXPECT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0})) << "the device waits for new outputs";
    bench.esc.time += 200ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
    EXPECT_EQ(Values::out_a::load(bench.image), 9) << "the old values were never applied";
    put_outputs(bench);
    bench.esc.ecat_set<std::uint16_t>(0x0440, 1);
    EXPECT_EQ(bench.request(0x18), (AlStatus{AlState::op, false, 0}));
}

// The outputs and the request for a lower state come in one cycle of the master. The device executes the request first,
// and the device does not read the outputs: their AL event stays.
void come_with_a_request(int control, AlState lower) {
    SCOPED_TRACE(::testing::Message() << std::hex << control << " " << static_cast<int>(lower));
    Bench bench;
    bench.esc.configure(2, {0x1200, 4, static_cast<std::uint8_t>(control), 1});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    put_outputs(bench);
    (void)bench.step();
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({7, 7, 7, 7})));
    ASSERT_EQ(bench.request(static_cast<std::uint16_t>(lower)), (AlStatus{lower, false, 0}));
    bench.settle();
    bench.esc.time += 1s;
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    bench.esc.time += 1ms;
    bench.settle();
    EXPECT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0})) << "the device waits for new outputs";
    bench.esc.time += 200ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::no_valid_outputs));
    EXPECT_EQ(Values::out_a::load(bench.image), 9) << "the old values were never applied";
    put_outputs(bench);
    EXPECT_EQ(bench.request(0x18), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(Values::out_a::load(bench.image), 1);
}

TEST(OldOutputs, OutputsThatCameWithARequestForALowerStateDoNotLeadToOp) {
    for (const auto lower : {AlState::preop, AlState::safeop})
        for (const int control : {0x24, 0x04})  // with an AL event, and without it by the status of the SyncManager
            come_with_a_request(control, lower);
}

TEST(OldOutputs, TheEventOfTheWatchdogForgetsThemToo) {
    Bench bench;
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    put_outputs(bench);
    (void)bench.step();
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    bench.esc.raise(wire::al_event::kWatchdog);
    (void)bench.step();
    bench.esc.ecat_set<std::uint16_t>(0x0440, 1);
    EXPECT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0}));
}

TEST(OldOutputs, TheTimeoutOfTheDeviceForgetsThemWithoutAWatchdog) {
    Bench bench;
    bench.application.description_value.output_timeout = 20ms;
    bench.esc.ecat_set<std::uint16_t>(0x0420, 0);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    put_outputs(bench);
    (void)bench.step();
    bench.esc.time += 20ms;
    EXPECT_EQ(bench.request(8), (AlStatus{AlState::safeop, false, 0}));
    put_outputs(bench);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

// ------------------------------------------------------------------ deadlines in every run mode

class EveryMode : public ::testing::TestWithParam<RunMode> {
  protected:
    EveryMode() { restart(); }
    void restart() {
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox, nullptr, GetParam());
        bench.device->start(bench.esc.time);
        bench.configure(128);
        (void)bench.request(2);
    }
    // Executes the device for a time: step() at each deadline.
    void run(Duration time) {
        const auto end = bench.esc.time + time;
        for (auto next = bench.step(); next <= end; next = bench.step())
            bench.esc.time = std::max(bench.esc.time, next);
        bench.esc.time = end;
    }
    Bench bench;
};

TEST_P(EveryMode, OutputsWithoutAnEventAreFoundByPolling) {
    bench.esc.configure(2, {0x1200, 4, 0x44, 1});  // control octet without the PDI interrupt
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    (void)bench.request(8);
    EXPECT_LE(bench.step(), bench.esc.time + 1ms);
    bench.esc.ecat_set<std::uint8_t>(0x0815, 1);  // status of SM2: the buffer was written
    bench.esc.time += 1ms;
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
}

TEST_P(EveryMode, TheFreeRunCycleRuns) {
    bench.application.description_value.free_run_cycle = 5ms;
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    const auto before = bench.application.cycles;
    run(50ms);
    EXPECT_EQ(bench.application.cycles, before + 10);
}

// A SyncManager of one octet has no buffer and no event. Only the watchdog shows that outputs arrive.
TEST_P(EveryMode, OneOctetOfOutputsIsPolled) {
    ASSERT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1C12, 1, number(0x1601, 2)).abort, Abort::none);
    ASSERT_EQ(download(bench, 0x1C12, 0, number(1, 1)).abort, Abort::none);
    bench.esc.configure(2, {0x1200, 1, 0x64, 1});
    bench.esc.ecat_set<std::uint16_t>(0x0440, 0);
    ASSERT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    (void)bench.request(8);
    run(50ms);
    ASSERT_EQ(bench.esc.al_status().state, AlState::safeop) << "no outputs yet";
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1})));
    bench.esc.ecat_set<std::uint16_t>(0x0440, 1);
    run(2ms);
    ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(Values::bit_b::load(bench.image), 1);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({0})));
    run(2ms);
    EXPECT_EQ(Values::bit_b::load(bench.image), 0);
}

INSTANTIATE_TEST_SUITE_P(Modes, EveryMode, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

// ------------------------------------------------------------------ inputs without outputs or events

class FreshInputs : public EveryMode {
  protected:
    // The master reads the inputs each 4 ms. Counts how often the application ran in between.
    unsigned fresh_reads(int reads) {
        unsigned fresh = 0;
        for (int i = 0; i < reads; ++i) {
            const auto before = bench.application.cycles;
            std::vector<std::byte> inputs(6);
            EXPECT_TRUE(bench.esc.ecat_read(0x1300, inputs));
            if (GetParam() != RunMode::polling && (bench.esc.events() & mask()) != 0)
                (void)bench.device->interrupt(bench.esc.time);
            run(4ms);
            fresh += bench.application.cycles != before ? 1 : 0;
        }
        return fresh;
    }
    [[nodiscard]] std::uint32_t mask() const { return bench.esc.get<std::uint32_t>(reg::kAlEventMask.address); }
};

TEST_P(FreshInputs, AMasterThatOnlyReadsInSafeopGetsPresentValues) {
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(fresh_reads(10), 10u);
}

TEST_P(FreshInputs, AMasterThatOnlyReadsGetsThemWithoutEventsOfSm3) {
    bench.esc.configure(3, {0x1300, 6, 0x00, 1});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(fresh_reads(10), 10u);
}

TEST_P(FreshInputs, ADeviceOfInputsOnlyRunsWithoutEventsOfSm3) {
    ASSERT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, Abort::none);
    bench.esc.configure(2, {0x1200, 0, 0x64, 0});
    bench.esc.configure(3, {0x1300, 6, 0x00, 1});
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(fresh_reads(5), 5u);
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(fresh_reads(5), 5u);
}

TEST_P(FreshInputs, ADcDeviceRunsBeforeItsFirstSync0) {
    bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
    bench.esc.ecat_set<std::uint8_t>(0x0981, 3);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(fresh_reads(5), 5u);
}

INSTANTIATE_TEST_SUITE_P(Modes, FreshInputs, ::testing::Values(RunMode::polling, RunMode::mixed, RunMode::interrupts));

// ------------------------------------------------------------------ oversampling

class Oversampling : public ::testing::Test {
  protected:
    // Executes frames with five SYNC0 each. Returns the AL status after them.
    AlStatus frames(int count) {
        for (int frame = 0; frame < count; ++frame) {
            EXPECT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
            (void)bench.step();
            for (int n = 0; n < 5; ++n) sync();
        }
        return bench.esc.al_status();
    }
    void sync() {
        bench.esc.time += 200us;
        bench.esc.raise(wire::al_event::kDcSync0);
        (void)bench.step();
    }
    void bring_to_op() {
        bench.esc.ecat_set<std::uint32_t>(0x09A0, 200'000);
        ASSERT_EQ(bench.request(4).state, AlState::safeop);
        ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
        (void)bench.request(8);
        sync();
        ASSERT_EQ(bench.esc.al_status(), (AlStatus{AlState::op, false, 0}));
    }
    Bench bench;
};

TEST_F(Oversampling, Sync1TellsHowManySync0BelongToAFrame) {
    bench.esc.ecat_set<std::uint32_t>(0x09A4, 800'000);  // SYNC1 with each fifth SYNC0
    bench.esc.ecat_set<std::uint8_t>(0x0981, 7);
    bring_to_op();
    EXPECT_EQ(frames(50), (AlStatus{AlState::op, false, 0}));
    for (int n = 0; n < 3 * 5; ++n) sync();
    EXPECT_EQ(bench.esc.al_status().state, AlState::op) << "three missing frames are tolerated";
    for (int n = 0; n < 5; ++n) sync();
    EXPECT_EQ(bench.esc.al_status(), refused(AlState::safeop, AlStatusCode::synchronization_error));
}

// ------------------------------------------------------------------ optional parts that are absent

class Bare final : public Application {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return table::kDevice; }
};

// A dictionary with all objects of the stack, over an application that implements none of the optional functions, or
// over no application at all.
class AbsentParts : public ::testing::TestWithParam<bool> {
  protected:
    AbsentParts() {
        for (const unsigned n : {0u, 1u})
            esc.configure(n, {static_cast<std::uint16_t>(n == 0 ? 0x1000 : 0x1100), 128,
                              static_cast<std::uint8_t>(n == 0 ? 0x26 : 0x22), 1});
        dictionary.restore_defaults();
        EXPECT_TRUE(mailbox.fits());
        mailbox.start(AlState::preop);
    }
    Abort ask(const std::vector<std::byte>& request) {
        hand.configure(128);
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, request)));
        (void)mailbox.step(esc.time, esc.events());
        auto reply = hand.fetch();
        (void)mailbox.step(esc.time, esc.events());
        EXPECT_FALSE(reply.empty());
        if (reply.empty()) return Abort::none;
        reply.erase(reply.begin(), reply.begin() + 6);
        reply.resize(10);
        return abort_of(reply);
    }
    PlainEsc esc;
    Bare bare;
    std::array<std::byte, Values::bytes> image{};
    ObjectDictionary dictionary{table::kObjects, image, GetParam() ? &bare : nullptr};
    std::array<std::byte, 256> staging{};
    CoeServer coe{dictionary, staging, true};
    MailboxProtocol protocols[1] = {{wire::MailboxType::coe, &coe}};
    MailboxMemory<256, 3> memory;
    Mailbox mailbox{esc, memory, protocols};
    MailHand hand{esc};
};

TEST_P(AbsentParts, ObjectsWithoutTheirPartDoNotExist) {
    for (const int index : {0x1003, 0x10F3})
        for (const int subindex : {0, 1, 3}) {
            EXPECT_EQ(ask(sdo_request(0x40, index, subindex)), Abort::no_object)
                << std::hex << index << ':' << subindex;
            EXPECT_EQ(ask(sdo_request(0x50, index, 0)), Abort::no_object) << std::hex << index;
        }
    EXPECT_EQ(ask(sdo_request(0x2F, 0x1003, 0, 0)), Abort::no_object);
    EXPECT_EQ(ask(sdo_request(0x2F, 0x10F3, 3, 0)), Abort::no_object);
    EXPECT_EQ(ask(sdo_request(0x2B, 0x10F3, 5, 0)), Abort::no_object);
    EXPECT_EQ(ask(sdo_request(0x21, 0x10F3, 5, 200)), Abort::no_object) << "a segmented download";
}

TEST_P(AbsentParts, ObjectsWithoutTheirPartCannotBeMapped) {
    EXPECT_EQ(ask(sdo_request(0x2F, 0x1A00, 0, 0)), Abort::none);
    EXPECT_EQ(ask(sdo_request(0x23, 0x1A00, 1, 0x10F30401)), Abort::no_object) << "new messages available";
}

TEST_P(AbsentParts, PdosAreConfiguredWithoutAnApplication) {
    EXPECT_EQ(ask(sdo_request(0x2F, 0x1600, 0, 0)), Abort::none);
    EXPECT_EQ(ask(sdo_request(0x23, 0x1600, 1, 0x70000108)), Abort::none);
    EXPECT_EQ(ask(sdo_request(0x2F, 0x1600, 0, 1)), Abort::none);
    EXPECT_EQ(ask(sdo_request(0x2F, 0x1C12, 0, 0)), Abort::none);
    EXPECT_EQ(ask(sdo_request(0x2B, 0x1C12, 1, 0x1600)), Abort::none);
    EXPECT_EQ(ask(sdo_request(0x2F, 0x1C12, 0, 1)), Abort::none);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutApplication, AbsentParts, ::testing::Bool());

}  // namespace
}  // namespace margay::subdevice
