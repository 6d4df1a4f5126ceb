// The checks of subdevice_check: devices that keep the rules pass, whatever options their authors have chosen.
#include "samples/conformance.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/sync_objects.hpp"
#include "wire/sii.hpp"
#include "wire/sii_category.hpp"

#include <memory>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
namespace od = subdevice::od;
using subdevice::DeviceDescription;
using subdevice::Entry;
using subdevice::Le;
using subdevice::Object;

struct SmallValues {
    Le<std::uint16_t> lamps;
    Le<std::uint16_t> keys;
    std::array<std::byte, subdevice::SyncValues<0>::bytes> sync;
};
constexpr Entry kSmallLamps[] = {subdevice::value<&SmallValues::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Entry kSmallKeys[] = {subdevice::value<&SmallValues::keys>(0, "Keys", od::kRead | od::kTxMappable)};
constexpr Object kSmallObjects[] = {subdevice::variable(0x6000, "Keys", kSmallKeys),
                                    subdevice::variable(0x7000, "Lamps", kSmallLamps)};

constexpr DeviceDescription kPlain{
    .vendor_id = 0x4D47,
    .product_code = 0x99,
    .name = "Small",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1080, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = 2, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = 2}};

template <class Change>
constexpr DeviceDescription changed(Change change) {
    DeviceDescription description = kPlain;
    change(description);
    return description;
}
constexpr DeviceDescription kClockRequired =
    changed([](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .min_cycle = 250us}; });
constexpr DeviceDescription kClockWithPll =
    changed([](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .pll = true}; });
constexpr DeviceDescription kSlowPll = changed([](DeviceDescription& d) {
    d.dc = {.supported = true, .required = true, .min_cycle = 2ms, .max_cycle = 2ms, .pll = true};
});
constexpr DeviceDescription kFastPll = changed(
    [](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .max_cycle = 600us, .pll = true}; });
constexpr DeviceDescription kFastClock =
    changed([](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .max_cycle = 600us}; });
constexpr DeviceDescription kVeryFastClock = changed(
    [](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .min_cycle = 100us, .max_cycle = 250us}; });
constexpr DeviceDescription kVeryFastPll = changed(
    [](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .max_cycle = 250us, .pll = true}; });
// This device permits 8000 and 16000 cycles a second, and no slower cycle.
constexpr DeviceDescription kControlLoop = changed([](DeviceDescription& d) {
    d.dc = {.supported = true, .required = true, .min_cycle = 125us, .max_cycle = 125us, .pll = true};
});
constexpr DeviceDescription kFastControlLoop = changed([](DeviceDescription& d) {
    d.dc = {.supported = true, .required = true, .min_cycle = 62'500ns, .max_cycle = 70us, .pll = true};
});
constexpr DeviceDescription kOwnTimeout = changed([](DeviceDescription& d) { d.output_timeout = 60ms; });
constexpr DeviceDescription kShortClock =
    changed([](DeviceDescription& d) { d.dc = {.supported = true, .max_cycle = 1ms}; });
constexpr DeviceDescription kNoCycle =
    changed([](DeviceDescription& d) { d.dc = {.supported = true, .min_cycle = 5ms, .max_cycle = 6ms}; });
constexpr DeviceDescription kOneBuffer = changed([](DeviceDescription& d) { d.inputs.three_buffers = false; });
constexpr DeviceDescription kOutputsOnly = changed([](DeviceDescription& d) { d.inputs = {}; });
constexpr DeviceDescription kTightMailboxes = changed([](DeviceDescription& d) {
    d.mailbox = {{.start = 0x1000, .size_bytes = 32}, {.start = 0x1080, .size_bytes = 32}};
});
constexpr DeviceDescription kSwitch = changed([](DeviceDescription& d) { d.device_id_switch = true; });

constexpr DeviceDescription kBothInOneBuffer =
    changed([](DeviceDescription& d) { d.outputs.three_buffers = d.inputs.three_buffers = false; });
constexpr DeviceDescription kLongCycle =
    changed([](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .min_cycle = 30ms}; });
constexpr DeviceDescription kOddCycle = changed(
    [](DeviceDescription& d) { d.dc = {.supported = true, .required = true, .min_cycle = 3ms, .max_cycle = 3ms}; });
template <const DeviceDescription& Description>
constexpr auto kSmallSync = subdevice::sync_output_entries<subdevice::offset_of(&SmallValues::sync)>(Description);
// Such a device reports its shortest cycle.
template <const DeviceDescription& Description>
constexpr Object kSyncObjects[] = {
    subdevice::record(0x1C32, "Output sync", kSmallSync<Description>, &subdevice::kSyncParameterHooks),
    subdevice::variable(0x6000, "Keys", kSmallKeys), subdevice::variable(0x7000, "Lamps", kSmallLamps)};

// How the firmware is executed, and how the application behaves.
struct Habits {
    Duration poll{};         // 0: at once
    Duration transition{};   // duration of each transition
    bool emergency = false;  // at each start of the mailbox, for a cause that stays
};
inline Habits habits{};

template <const DeviceDescription& Description, const auto& Objects = kSmallObjects, class Values = SmallValues>
class SmallFirmware final : public sim::Firmware {
  public:
    using Stack = subdevice::StandardDevice<Description, Objects, Values>;
    void start(subdevice::EscAccess& esc, Time now) override {
        all_ = std::make_unique<All>(esc);
        all_->stack.device.start(now);
    }
    // A control loop compares frames with SYNC0.
    static constexpr bool kFast =
        Description.dc.pll && Description.dc.max_cycle > 0us && Description.dc.max_cycle <= 250us;
    static constexpr Duration kStep = kFast ? 5us : 50us;
    Time step(Time now) override {
        if (now < next_poll_) return next_poll_;
        const auto next = all_->stack.device.step(now);
        if (habits.poll == 0us) return std::min(next, now + kStep);
        return next_poll_ = now + habits.poll;
    }

  private:
    struct SmallApplication final : subdevice::Application {
        [[nodiscard]] const DeviceDescription& description() const override { return Description; }
        subdevice::Emergencies* emergencies() override { return &emergency; }
        subdevice::Verdict before(subdevice::Transition, Time now) override {
            if (until == kNever) until = now + habits.transition;
            return now < until ? subdevice::Verdict::wait(until) : subdevice::Verdict::go();
        }
        void dropped(subdevice::Transition) override { until = kNever; }
        void after(subdevice::Transition transition, Time) override {
            until = kNever;
            if (habits.emergency && transition == subdevice::Transition{AlState::init, AlState::preop})
                (void)emergency.raise({.error_code = 0x3130, .error_register = 5});
        }
        Time until = kNever;
        std::array<subdevice::EmergencyMessage, 4> queue{};
        std::array<std::byte, 16> history{};
        subdevice::Emergencies emergency{queue, history};
    };
    struct All {
        explicit All(subdevice::EscAccess& esc) : stack(esc, application, memory) {}
        typename Stack::Memory memory;
        SmallApplication application;
        Stack stack;
    };
    std::unique_ptr<All> all_;
    Time next_poll_{};
};

template <const DeviceDescription& Description, const auto& Objects = kSmallObjects, class Values = SmallValues>
Checked check_small(const Options& options = {}, const std::function<void(sim::Device&)>& change = {}) {
    using Stack = typename SmallFirmware<Description, Objects, Values>::Stack;
    Values values{};
    const subdevice::ObjectDictionary dictionary(Stack::Objects::kObjects, subdevice::image_of(values));
    subdevice::SiiWorkspace<4, 16> workspace;
    sim::Device device{
        .chip = sim::chip_by_name("et1100").value(), .sii = std::vector<std::byte>(2048), .firmware = {}};
    EXPECT_TRUE(write_sii(Description, {}, dictionary, workspace, device.sii).ok());
    device.firmware = std::make_unique<SmallFirmware<Description, Objects, Values>>();
    if (change) change(device);
    return check_it(std::move(device), options);
}

std::string reason_of(const Report& report, std::string_view name) {
    const auto* const check = find(report, name);
    return check == nullptr ? "no such check" : check->reason;
}

template <const DeviceDescription& Description>
void expect_conforms(std::initializer_list<std::string_view> passed) {
    const auto report = check_small<Description>().report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    for (const auto name : passed) {
        EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name << ": " << reason_of(report, name);
        // The result is the same when only this check is executed.
        const auto alone = check_small<Description>({.only = std::string(name)}).report;
        EXPECT_EQ(find(alone, name)->outcome, Outcome::passed) << report_text(alone, true);
    }
}

TEST(SubdeviceCheckDevices, AClockThatIsRequiredIsActivated) {
    expect_conforms<kClockRequired>({"states.up", "states.down", "sm.process_settings", "mailbox.states",
                                     "watchdog.time", "watchdog.off", "clock.sync0", "clock.lost", "clock.cycle1",
                                     "clock.cycle_zero", "process_data.exchange"});
    expect_conforms<kClockWithPll>({"states.up", "watchdog.time", "watchdog.off", "clock.sync0"});
    expect_conforms<kFastClock>({"states.up", "watchdog.off", "clock.sync0"});
}

TEST(SubdeviceCheckDevices, ADeviceForShortCyclesOnlyIsTriedWithThem) {
    expect_conforms<kVeryFastClock>({"states.up", "states.down", "sm.process_settings", "mailbox.states",
                                     "process_data.exchange", "watchdog.off", "clock.sync0", "clock.lost"});
    expect_conforms<kVeryFastPll>({"states.up", "process_data.exchange", "clock.sync0"});
}

// The hook returns a value that its own description forbids.
MutableBytes level_of_twelve(const subdevice::ObjectAccess&) {
    static std::array<std::byte, 1> level{std::byte{12}};
    return level;
}
constexpr subdevice::ObjectHooks kLevelHooks{.memory = level_of_twelve};
constexpr Entry kLevel[] = {subdevice::provided(0, "Level", subdevice::DataType::unsigned8, 8, od::kReadWrite)
                                .within(subdevice::kLimits<1, 9>)};
constexpr Object kLevelObjects[] = {subdevice::variable(0x2000, "Level", kLevel, &kLevelHooks),
                                    subdevice::variable(0x6000, "Keys", kSmallKeys),
                                    subdevice::variable(0x7000, "Lamps", kSmallLamps)};

TEST(SubdeviceCheckDevices, AValueOutsideOfItsOwnLimitsIsFound) {
    const auto report = check_small<kPlain, kLevelObjects>({.only = "information"}).report;
    EXPECT_FALSE(report.conforms());
    const auto* const check = find(report, "information.limits");
    ASSERT_EQ(check->findings.size(), 1u) << report_text(report, false);
    EXPECT_EQ(check->findings[0].text, "0x2000:00 is 12, outside of its own limits 1 to 9");
    EXPECT_EQ(find(check_small<kPlain>().report, "information.limits")->outcome, Outcome::passed);
}

constexpr Entry kUncounted[] = {subdevice::entry_count(0),
                                subdevice::value<&SmallValues::keys>(1, "Keys", od::kRead | od::kTxMappable)};
constexpr Object kUncountedObjects[] = {subdevice::record(0x6000, "Keys", kUncounted),
                                        subdevice::variable(0x7000, "Lamps", kSmallLamps)};

TEST(SubdeviceCheckDevices, AMappedValueAboveTheCountOfItsObjectIsRemarked) {
    const auto report = check_small<kPlain, kUncountedObjects>({.only = "pdos.mapped"}).report;
    EXPECT_TRUE(has(report, "pdos.mapped", kRemark)) << report_text(report, true);
    EXPECT_FALSE(has(check_small<kPlain>({.only = "pdos.mapped"}).report, "pdos.mapped", kRemark));
}

// A cycle is one frame. With a frame for each SyncManager and a frame for the AL status, the frames would be too late.
TEST(SubdeviceCheckDevices, ADeviceWithAControlLoopOf125MicrosecondsOrLessIsNotBlamed) {
    const auto checks = {"states.up",     "states.down",  "states.same",         "sm.process_settings",
                         "watchdog.time", "clock.sync0",  "process_data.inputs", "mailbox.states",
                         "clock.lost",    "watchdog.off", "clock.cycle1"};
    for (const auto& report : {check_small<kControlLoop>().report, check_small<kFastControlLoop>().report}) {
        EXPECT_TRUE(report.conforms()) << report_text(report, false);
        for (const auto* const name : checks)
            EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name << ": " << reason_of(report, name);
    }
}

// Outputs that are older than the device permits have the same effect as an expired watchdog.
TEST(SubdeviceCheckDevices, ATimeoutShorterThanTheWatchdogIsARemark) {
    const auto report = check_small<kOwnTimeout>().report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    for (const auto* const name : {"watchdog.expires", "watchdog.time"}) {
        EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name;
        EXPECT_TRUE(has(report, name, Severity::remark)) << name;
    }
}

// A device that compares frames with SYNC0: each SYNC0 needs one frame.
TEST(SubdeviceCheckDevices, FramesHaveThePeriodOfSync0) {
    expect_conforms<kSlowPll>({"states.up", "states.down", "sm.process_settings", "mailbox.states", "watchdog.time",
                               "watchdog.off", "process_data.exchange", "process_data.inputs", "clock.sync0"});
    expect_conforms<kFastPll>({"states.up", "watchdog.time", "watchdog.off", "process_data.exchange"});
}

TEST(SubdeviceCheckDevices, AnotherCycleIsTried) {
    expect_conforms<kShortClock>({"clock.sync0", "clock.lost"});
    const auto report = check_small<kNoCycle>({.only = "clock."}).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    EXPECT_TRUE(reason_of(report, "clock.sync0").find("could not be tried") != std::string::npos)
        << report_text(report, true);
}

// A record with all difficulties of complete access: single bits, a number after the bits, a gap, a value that cannot
// be read, a text that is shorter than its place, and a value that changes with each access.
struct MixedRecordValues {
    Le<std::uint16_t> lamps;
    std::uint8_t on;
    std::uint8_t mode;
    Le<std::int16_t> offset;
    Le<std::uint32_t> key;
    std::array<char, 9> label;
    Le<std::uint32_t> reads;
    std::uint8_t last;
};
constexpr Entry kMixedRecord[] = {
    subdevice::entry_count(9),
    subdevice::flag<&MixedRecordValues::on>(1, "On", od::kReadWrite, 1, 1),
    subdevice::flag<&MixedRecordValues::mode>(2, "Mode", od::kReadWrite, 4, 9),
    subdevice::value<&MixedRecordValues::offset>(3, "Offset", od::kReadWrite, -2),
    subdevice::value<&MixedRecordValues::key>(5, "Key", od::kWrite, 0x12345678),
    subdevice::octets<&MixedRecordValues::label>(6, "Label", subdevice::DataType::visible_string, od::kReadWrite, "ab"),
    subdevice::value<&MixedRecordValues::reads>(7, "Reads", od::kRead),
    subdevice::padding(8, 3),
    subdevice::value<&MixedRecordValues::last>(9, "Last", od::kReadWrite, 77)};
constexpr subdevice::ObjectHooks kMixedHooks{.before_read = [](const subdevice::ObjectAccess& access) {
    const auto reads = access.dictionary.in_image(access.object, *access.object.entry(7), 7);
    store_le(reads, 0, load_le<std::uint32_t>(reads) + 1);
    return subdevice::HookAnswer();
}};
constexpr Entry kMixedLamps[] = {
    subdevice::value<&MixedRecordValues::lamps>(0, "Lamps", od::kReadWrite | od::kRxMappable)};
constexpr Object kMixedObjects[] = {subdevice::variable(0x7000, "Lamps", kMixedLamps),
                                    subdevice::record(0x8000, "Mixed", kMixedRecord, &kMixedHooks)};

TEST(SubdeviceCheckDevices, CompleteAccessOfARecordOfEveryKindIsNotBlamed) {
    const auto report = check_small<kOutputsOnly, kMixedObjects, MixedRecordValues>().report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    for (const auto* const name : {"sdo.complete_objects", "sdo.complete_access"}) {
        EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name << ": " << reason_of(report, name);
        EXPECT_TRUE(find(report, name)->findings.empty()) << report_text(report, false);
    }
}

// Only the objects themselves show that complete access to 0x1018 needs segments.
TEST(SubdeviceCheckDevices, AValueOfManySegmentsIsFoundWithoutTheInformationService) {
    const auto report = check_small<kTightMailboxes>({.only = "segments."}, [](sim::Device& device) {
                            const auto general = wire::sii::find_category(device.sii, wire::sii::category::kGeneral);
                            ASSERT_TRUE(general);
                            const auto at = static_cast<std::size_t>(general->data() - device.sii.data()) + 5;
                            device.sii[at] &= ~std::byte{coe_detail::kSdoInformation};
                        }).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    for (const auto* const name : {"segments.upload", "segments.toggle", "segments.client_abort"})
        EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name << ": " << reason_of(report, name);
    EXPECT_NE(find(report, "information.entries")->outcome, Outcome::passed);
}

TEST(SubdeviceCheckDevices, InputsInOneBufferAreRead) {
    expect_conforms<kOneBuffer>({"process_data.inputs", "process_data.exchange"});
}

// A device with these habits keeps the rules.
template <const DeviceDescription& Description>
Report report_with(const Habits& wanted, const char* only) {
    habits = wanted;
    auto report = check_small<Description>({.only = only}).report;
    habits = {};
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    return report;
}

TEST(SubdeviceCheckDevices, AFirmwareMayPollSlowly) {
    for (const auto poll : {50ms, 90ms}) {
        (void)report_with<kPlain>({.poll = poll}, "states.,sm.,process_data.inputs");
        (void)report_with<kSwitch>({.poll = poll}, "states.device_id");
    }
    const auto slow = report_with<kPlain>({.poll = 300ms}, "states.skipped,mailbox.length,mailbox.type");
    EXPECT_TRUE(has(slow, "states.skipped", Severity::remark));
}

TEST(SubdeviceCheckDevices, OneBufferMayBeTakenSlowly) {
    for (const auto poll : {5ms, 20ms})
        EXPECT_EQ(
            find(report_with<kBothInOneBuffer>({.poll = poll}, "process_data."), "process_data.exchange")->outcome,
            Outcome::passed);
}

TEST(SubdeviceCheckDevices, EachTransitionMayTakeItsTime) {
    (void)report_with<kPlain>({.transition = 2500ms}, "states.init_clears,states.down");
    // The transition takes longer than the watchdog of the outputs, which stop when the master has requested a lower
    // state.
    (void)report_with<kPlain>({.transition = 150ms}, "states.down");
}

TEST(SubdeviceCheckDevices, AnEmergencyComesAgainAfterEachStart) {
    const auto report = report_with<kPlain>({.emergency = true}, "mailbox.,states.restart,messages.emergencies");
    EXPECT_EQ(find(report, "messages.emergencies")->outcome, Outcome::passed);
}

TEST(SubdeviceCheckDevices, ALongCycleIsTriedWhenTheDeviceTellsIt) {
    for (const auto& report : {check_small<kLongCycle, kSyncObjects<kLongCycle>>().report,
                               check_small<kOddCycle, kSyncObjects<kOddCycle>>().report}) {
        EXPECT_TRUE(report.conforms()) << report_text(report, false);
        EXPECT_FALSE(has(report, "sm.control_bits", Severity::remark));
        for (const auto* const name : {"states.up", "states.down", "sm.process_settings", "mailbox.states"})
            EXPECT_EQ(find(report, name)->outcome, Outcome::passed) << name << ": " << reason_of(report, name);
    }
}

TEST(SubdeviceCheckDevices, ADeviceThatRefusesEachCycleIsNotJudged) {
    const auto report = check_small<kOddCycle>().report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    for (const auto* const name : {"states.up", "states.down", "clock.sync0"})
        EXPECT_EQ(find(report, name)->outcome, Outcome::not_applicable) << name;
    EXPECT_NE(reason_of(report, "states.up").find("refuses each cycle"), std::string::npos);
}

TEST(SubdeviceCheckDevices, AnIdSwitchMayBeAtZero) {
    const auto report = check_small<kSwitch>({.only = "states.device_id"}).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    EXPECT_TRUE(has(report, "states.device_id", Severity::remark)) << "the selector is not set";
}

}  // namespace
}  // namespace margay::samples::conformance
