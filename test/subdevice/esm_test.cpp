// The state machine compared with the tables of ETG.1000.6 "EtherCAT state machine": every pair of states, every
// check, error indication and acknowledge.
#include "subdevice/esm.hpp"

#include "plain_esc.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <string>

namespace margay::subdevice {
namespace {

using namespace std::chrono_literals;
using testing::PlainEsc;
using wire::SyncManager;

constexpr SyncManager kReceive{0x1000, 128, 0x26, 1};
constexpr SyncManager kSend{0x1080, 128, 0x22, 1};
constexpr SyncManager kOutputs{0x1100, 6, 0x64, 1};
constexpr SyncManager kInputs{0x1200, 8, 0x20, 1};

constexpr DeviceDescription kDevice{
    .mailbox = {{.start = 0x1000, .size_bytes = 128, .min_bytes = 64, .max_bytes = 256},
                {.start = 0x1080, .size_bytes = 128}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 256}, {.start = 0x1100, .size_bytes = 256}},
    .outputs = {.sync_manager = 2, .start = 0x1100, .max_bytes = 16},
    .inputs = {.sync_manager = 3, .start = 0x1200, .max_bytes = 16},
    .dc = {.supported = true, .min_cycle = 100us, .max_cycle = 10ms},
};

class Client final : public EsmClient {
  public:
    std::uint16_t device_id() override { return id; }
    ProcessDataSizes process_data_sizes() override { return sizes; }
    Verdict before(Transition t, Time now) override {
        log += name(t, '?');
        return answer ? answer(t, now) : Verdict::go();
    }
    void dropped(Transition t) override { log += name(t, 'x'); }
    void perform(Transition t, Time) override { log += name(t, '!'); }
    void after(Transition t, Time) override { log += name(t, '.'); }

    static std::string name(Transition t, char sign) {
        const auto letter = [](AlState s) { return "NIPBS...O"[static_cast<int>(s)]; };
        return std::string{letter(t.from), letter(t.to), sign, ' '};
    }
    ProcessDataSizes sizes{6, 8};
    std::uint16_t id = 0;
    std::string log;
    std::function<Verdict(Transition, Time)> answer;
};

class EsmTest : public ::testing::Test {
  protected:
    EsmTest() { start(kDevice); }
    void start(const DeviceDescription& description) {
        device = description;
        esm.emplace(esc, device, client);
        esm->init();
        configure();
    }
    void configure() {
        esc.configure(0, kReceive);
        esc.configure(1, kSend);
        esc.configure(2, kOutputs);
        esc.configure(3, kInputs);
    }
    Time step() { return esm->step(esc.time, esc.events()); }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)step();
        return esc.al_status();
    }
    // Reaches the state by the shortest legal way from INIT.
    void bring_to(AlState state) {
        (void)request(0x11);
        if (state == AlState::boot) {
            esc.configure(0, {0x1000, 256, 0x26, 1});
            esc.configure(1, {0x1100, 256, 0x22, 1});
            (void)request(0x03);
        }
        for (const int s : {2, 4, 8})
            if (state != AlState::boot && s <= static_cast<int>(state)) (void)request(static_cast<std::uint16_t>(s));
        ASSERT_EQ(esc.al_status(), (AlStatus{state, false, 0}));
        client.log.clear();
    }

    PlainEsc esc;
    DeviceDescription device;
    Client client;
    std::optional<Esm> esm;
};

AlStatus ok(AlState state) { return {state, false, 0}; }
AlStatus refused(AlState state, AlStatusCode code) { return {state, true, static_cast<std::uint16_t>(code)}; }

TEST_F(EsmTest, EveryPairOfStatesAnswersAsTheStandardSays) {
    const std::array states{AlState::init, AlState::preop, AlState::boot, AlState::safeop, AlState::op};
    for (const auto from : states)
        for (const auto to : states) {
            esc = PlainEsc{};
            start(kDevice);
            bring_to(from);
            if (to == AlState::boot && from == AlState::init) {
                esc.configure(0, {0x1000, 256, 0x26, 1});
                esc.configure(1, {0x1100, 256, 0x22, 1});
            }
            (void)step();
            bool legal = from == to || to == AlState::init;
            legal |= from == AlState::init && (to == AlState::preop || to == AlState::boot);
            legal |= from == AlState::preop && to == AlState::safeop;
            legal |= from == AlState::safeop && (to == AlState::preop || to == AlState::op);
            legal |= from == AlState::op && (to == AlState::preop || to == AlState::safeop);
            const auto expected = legal ? ok(to) : refused(from, AlStatusCode::invalid_requested_state_change);
            EXPECT_EQ(request(static_cast<std::uint16_t>(to)), expected)
                << "from " << int(from) << " to " << int(to) << " code " << esc.al_status().code;
        }
}

TEST_F(EsmTest, UnknownStatesAreRefusedByName) {
    for (const int state : {0, 5, 6, 7, 9, 15}) {
        (void)request(0x11);
        EXPECT_EQ(request(static_cast<std::uint16_t>(state)),
                  refused(AlState::init, AlStatusCode::unknown_requested_state));
    }
}

TEST_F(EsmTest, BootIsRefusedByADeviceWithoutIt) {
    auto without = kDevice;
    without.boot_mailbox = {};
    start(without);
    EXPECT_EQ(request(0x03), refused(AlState::init, AlStatusCode::bootstrap_not_supported));
}

TEST_F(EsmTest, ErrorStandsUntilAcknowledgedOrLeftDownwards) {
    bring_to(AlState::safeop);
    EXPECT_EQ(request(0x03), refused(AlState::safeop, AlStatusCode::invalid_requested_state_change));
    EXPECT_EQ(request(0x08), refused(AlState::safeop, AlStatusCode::invalid_requested_state_change)) << "not up";
    EXPECT_EQ(request(0x04), refused(AlState::safeop, AlStatusCode::invalid_requested_state_change)) << "not in place";
    EXPECT_EQ(request(0x14), ok(AlState::safeop));
    EXPECT_EQ(request(0x03), refused(AlState::safeop, AlStatusCode::invalid_requested_state_change));
    EXPECT_EQ(request(0x18), ok(AlState::op)) << "acknowledge and go on in one";
    EXPECT_EQ(request(0x03), refused(AlState::op, AlStatusCode::invalid_requested_state_change));
    EXPECT_EQ(request(0x02), ok(AlState::preop)) << "down needs no acknowledge";
}

TEST_F(EsmTest, AcknowledgeWithoutErrorIsHarmless) {
    bring_to(AlState::op);
    EXPECT_EQ(request(0x18), ok(AlState::op));
    EXPECT_EQ(client.log, "");
}

TEST_F(EsmTest, MailboxSettingsAreCheckedOneByOne) {
    struct Case {
        const char* what;
        SyncManager receive, send;
        bool accepted;
    };
    const Case cases[] = {
        {"as described", kReceive, kSend, true},
        {"allowed smaller size", {0x1000, 64, 0x26, 1}, kSend, true},
        {"too small", {0x1000, 63, 0x26, 1}, kSend, false},
        {"too big", {0x1000, 257, 0x26, 1}, kSend, false},
        {"allowed size, but over its neighbour", {0x1000, 129, 0x26, 1}, kSend, false},
        {"other bits of control are the master's", {0x1000, 128, 0x66, 1}, {0x1080, 128, 0x32, 1}, true},
        {"wrong start", {0x1002, 126, 0x26, 1}, kSend, false},
        {"wrong direction", {0x1000, 128, 0x22, 1}, kSend, false},
        {"not a mailbox", {0x1000, 128, 0x24, 1}, kSend, false},
        {"receive disabled", {0x1000, 128, 0x26, 0}, kSend, false},
        {"send disabled", kReceive, {0x1080, 128, 0x22, 0}, false},
        {"send length", kReceive, {0x1080, 127, 0x22, 1}, false},
        {"send length 0", kReceive, {0x1080, 0, 0x22, 1}, false},
        {"send length 64 KiB", kReceive, {0x1080, 0xFFFF, 0x22, 1}, false},
    };
    for (const auto& c : cases) {
        (void)request(0x11);
        esc.configure(0, c.receive);
        esc.configure(1, c.send);
        const auto expected =
            c.accepted ? ok(AlState::preop) : refused(AlState::init, AlStatusCode::invalid_mailbox_configuration);
        EXPECT_EQ(request(0x12), expected) << c.what;
    }
}

TEST_F(EsmTest, BootMailboxHasItsOwnCode) {
    EXPECT_EQ(request(0x03), refused(AlState::init, AlStatusCode::invalid_boot_mailbox_configuration));
}

TEST_F(EsmTest, MailboxesAreLockedInInitOnly) {
    EXPECT_TRUE(esc.locked(0));
    EXPECT_TRUE(esc.locked(1));
    (void)request(2);
    EXPECT_FALSE(esc.locked(0));
    EXPECT_FALSE(esc.locked(1));
    EXPECT_TRUE(esc.locked(2));
    EXPECT_TRUE(esc.locked(3));
    (void)request(4);
    EXPECT_FALSE(esc.locked(2));
    EXPECT_FALSE(esc.locked(3));
    (void)request(2);
    EXPECT_TRUE(esc.locked(2));
    (void)request(1);
    EXPECT_TRUE(esc.locked(0));
}

TEST_F(EsmTest, ProcessDataSettingsAreCheckedOneByOne) {
    using enum AlStatusCode;
    struct Case {
        const char* what;
        SyncManager outputs, inputs;
        AlStatusCode code;
    };
    const Case cases[] = {
        {"as mapped", kOutputs, kInputs, none},
        {"without watchdog bit", {0x1100, 6, 0x24, 1}, kInputs, none},
        {"outputs too long", {0x1100, 7, 0x64, 1}, kInputs, invalid_output_configuration},
        {"outputs too short", {0x1100, 5, 0x64, 1}, kInputs, invalid_output_configuration},
        {"outputs elsewhere", {0x1101, 6, 0x64, 1}, kInputs, invalid_output_configuration},
        {"outputs off", {0x1100, 6, 0x64, 0}, kInputs, invalid_output_configuration},
        {"inputs too long", kOutputs, {0x1200, 9, 0x20, 1}, invalid_input_configuration},
        {"inputs off", kOutputs, {0x1200, 8, 0x20, 0}, invalid_input_configuration},
        {"outputs as inputs", {0x1100, 6, 0x20, 1}, kInputs, invalid_sync_manager_types},
        {"inputs as mailbox", kOutputs, {0x1200, 8, 0x22, 1}, invalid_sync_manager_types},
    };
    for (const auto& c : cases) {
        bring_to(AlState::preop);
        esc.configure(2, c.outputs);
        esc.configure(3, c.inputs);
        EXPECT_EQ(request(0x14), c.code == none ? ok(AlState::safeop) : refused(AlState::preop, c.code)) << c.what;
    }
    bring_to(AlState::preop);
    client.sizes = {.fault = invalid_output_mapping};
    EXPECT_EQ(request(0x14), refused(AlState::preop, invalid_output_mapping));
    client.sizes = {0, 8};
    EXPECT_EQ(request(0x14), refused(AlState::preop, invalid_output_configuration)) << "nothing mapped, SM2 enabled";
    esc.configure(2, {0x1100, 0, 0x64, 0});
    esc.configure(3, kInputs);
    EXPECT_EQ(request(0x14), ok(AlState::safeop)) << "nothing mapped, SM2 off";
}

// The description of the author is wrong. The master uses these settings, and the ESC would mix up the data.
TEST_F(EsmTest, SyncManagersNeedMemoryOfTheirOwn) {
    using enum AlStatusCode;
    struct Case {
        const char* what;
        std::uint16_t outputs, inputs;
        std::uint8_t ram_kib;
        bool buffers;
        AlStatusCode code;
    };
    const Case cases[] = {
        {"right behind the three buffers", 0x1100, 0x1112, 0, true, none},
        {"inputs in the third buffer of the outputs", 0x1100, 0x1111, 0, true, invalid_input_configuration},
        {"outputs in the first buffer of the inputs", 0x1207, 0x1200, 0, true, invalid_input_configuration},
        {"one buffer each", 0x1100, 0x1106, 0, false, none},
        {"outputs on the last octet of a mailbox", 0x10FF, 0x1200, 0, true, invalid_output_configuration},
        {"inputs up to a mailbox", 0x1100, 0x1000 - 24, 0, true, invalid_input_configuration},
        {"outputs in the registers", 0x0FEE, 0x1200, 0, true, invalid_output_configuration},
        {"inputs at the end of the RAM", 0x1100, 0x2000 - 24, 4, true, none},
        {"inputs beyond the RAM", 0x1100, 0x2000 - 23, 4, true, invalid_input_configuration},
        {"inputs beyond all addresses", 0x1100, 0xFFF0, 0, true, invalid_input_configuration},
    };
    for (const auto& c : cases) {
        auto description = kDevice;
        description.outputs.start = c.outputs;
        description.inputs.start = c.inputs;
        description.outputs.three_buffers = description.inputs.three_buffers = c.buffers;
        esc = PlainEsc{};
        esc.ecat_set<std::uint8_t>(0x0006, c.ram_kib);
        start(description);
        bring_to(AlState::preop);
        const auto control = [&](unsigned bits) { return static_cast<std::uint8_t>(bits | (c.buffers ? 0U : 2U)); };
        esc.configure(2, {c.outputs, 6, control(0x64), 1});
        esc.configure(3, {c.inputs, 8, control(0x20), 1});
        EXPECT_EQ(request(0x04), c.code == none ? ok(AlState::safeop) : refused(AlState::preop, c.code)) << c.what;
    }
}

TEST_F(EsmTest, MailboxesNeedMemoryOfTheirOwn) {
    using enum AlStatusCode;
    const auto attempt = [&](std::uint16_t receive, std::uint16_t send, std::uint8_t ram_kib) {
        auto description = kDevice;
        description.mailbox.receive.start = receive;
        description.mailbox.send.start = send;
        esc = PlainEsc{};
        esc.ecat_set<std::uint8_t>(0x0006, ram_kib);
        start(description);
        esc.configure(0, {receive, 128, 0x26, 1});
        esc.configure(1, {send, 128, 0x22, 1});
        return request(0x02);
    };
    EXPECT_EQ(attempt(0x1080, 0x1000, 1), ok(AlState::preop));
    EXPECT_EQ(attempt(0x107F, 0x1000, 1), refused(AlState::init, invalid_mailbox_configuration)) << "overlap";
    EXPECT_EQ(attempt(0x0FFF, 0x1080, 1), refused(AlState::init, invalid_mailbox_configuration)) << "registers";
    EXPECT_EQ(attempt(0x1000, 0x1380, 1), ok(AlState::preop));
    EXPECT_EQ(attempt(0x1000, 0x1381, 1), refused(AlState::init, invalid_mailbox_configuration)) << "beyond the RAM";
}

TEST_F(EsmTest, WatchdogIsDemandedWhereTheDeviceNeedsIt) {
    auto strict = kDevice;
    strict.outputs.watchdog_required = true;
    start(strict);
    bring_to(AlState::preop);
    esc.configure(2, {0x1100, 6, 0x24, 1});
    EXPECT_EQ(request(0x04), refused(AlState::preop, AlStatusCode::invalid_watchdog_configuration));
    esc.configure(2, kOutputs);
    esc.ecat_set<std::uint16_t>(0x0420, 0);
    EXPECT_EQ(request(0x14), refused(AlState::preop, AlStatusCode::invalid_watchdog_configuration));
    esc.ecat_set<std::uint16_t>(0x0420, 100);
    EXPECT_EQ(request(0x14), ok(AlState::safeop));
}

TEST_F(EsmTest, DcActivationIsChecked) {
    using enum AlStatusCode;
    const auto attempt = [&](int activation, std::uint32_t cycle_ns) {
        bring_to(AlState::preop);
        esc.ecat_set<std::uint8_t>(0x0981, static_cast<std::uint8_t>(activation));
        esc.ecat_set<std::uint32_t>(0x09A0, cycle_ns);
        return request(0x04);
    };
    EXPECT_EQ(attempt(0, 0), ok(AlState::safeop));
    EXPECT_EQ(attempt(3, 1'000'000), ok(AlState::safeop));
    EXPECT_EQ(attempt(7, 1'000'000), ok(AlState::safeop));
    EXPECT_EQ(attempt(1, 1'000'000), refused(AlState::preop, invalid_dc_sync_configuration)) << "cyclic, yet no SYNC0";
    EXPECT_EQ(attempt(3, 0), refused(AlState::preop, invalid_dc_sync0_cycle_time));
    EXPECT_EQ(attempt(3, 99'999), refused(AlState::preop, invalid_dc_sync0_cycle_time));
    EXPECT_EQ(attempt(3, 100'000), ok(AlState::safeop));
    EXPECT_EQ(attempt(3, 10'000'001), refused(AlState::preop, invalid_dc_sync0_cycle_time));
    auto other = kDevice;
    other.dc.required = true;
    start(other);
    EXPECT_EQ(attempt(0, 0), refused(AlState::preop, invalid_dc_sync_configuration));
    other.dc.sync1 = true;
    start(other);
    EXPECT_EQ(attempt(3, 1'000'000), refused(AlState::preop, invalid_dc_sync_configuration));
    other.dc = {};
    start(other);
    EXPECT_EQ(attempt(3, 1'000'000), refused(AlState::preop, invalid_dc_sync_configuration)) << "a device without DC";
}

TEST_F(EsmTest, StepsOfATransitionComeInOrder) {
    bring_to(AlState::init);
    (void)request(2);
    (void)request(4);
    (void)request(8);
    (void)request(1);
    EXPECT_EQ(client.log, "IP? IP! IP. PS? PS! PS. SO? SO! SO. OI? OI! OI. ");
}

TEST_F(EsmTest, ApplicationRefusesWithItsCode) {
    bring_to(AlState::preop);
    client.answer = [](Transition, Time) { return Verdict::refuse(AlStatusCode::no_valid_inputs); };
    EXPECT_EQ(request(4), refused(AlState::preop, AlStatusCode::no_valid_inputs));
    EXPECT_EQ(client.log, "PS? ");
}

TEST_F(EsmTest, ATransitionMayTakeItsTime) {
    bring_to(AlState::preop);
    const auto ready = esc.time + 30ms;
    client.answer = [&](Transition, Time now) { return now < ready ? Verdict::wait(now + 10ms) : Verdict::go(); };
    EXPECT_EQ(request(4), ok(AlState::preop));
    EXPECT_EQ(step(), esc.time + 10ms) << "asks to be called again";
    EXPECT_EQ(client.log, "PS? ") << "and does not bother the application before";
    EXPECT_EQ(request(4), ok(AlState::preop)) << "the same request again changes nothing";
    esc.time += 10ms;
    (void)step();
    esc.time += 20ms;
    EXPECT_EQ(step(), kNever);
    EXPECT_EQ(esc.al_status(), ok(AlState::safeop));
    EXPECT_EQ(client.log, "PS? PS? PS? PS! PS. ");
}

TEST_F(EsmTest, AnotherRequestDropsTheOneThatWaits) {
    bring_to(AlState::preop);
    client.answer = [](Transition t, Time now) { return t.up() ? Verdict::wait(now + 1s) : Verdict::go(); };
    (void)request(4);
    EXPECT_EQ(request(1), ok(AlState::init));
    EXPECT_EQ(client.log, "PS? PSx PI? PI! PI. ");
    esc.time += 5s;
    EXPECT_EQ(step(), kNever);
    EXPECT_EQ(esc.al_status(), ok(AlState::init));
}

// The checks before the call of the application are the same as the first time.
TEST_F(EsmTest, WhatChangesWhileATransitionWaitsIsCheckedAgain) {
    const auto wait = [](Transition, Time now) { return Verdict::wait(now + 10ms); };
    struct Change {
        AlStatusCode code;
        std::function<void()> make;
    };
    const Change changes[] = {
        {AlStatusCode::invalid_output_configuration,
         [&] {
             esc.configure(2, {0x1100, 7, 0x64, 1});
         }},
        {AlStatusCode::invalid_input_configuration,
         [&] {
             esc.configure(3, {0x1200, 8, 0x20, 0});
         }},
        {AlStatusCode::invalid_output_configuration,
         [&] {
             client.sizes = {5, 8};
         }},
        {AlStatusCode::invalid_output_mapping, [&] { client.sizes.fault = AlStatusCode::invalid_output_mapping; }},
        {AlStatusCode::invalid_dc_sync_configuration, [&] { esc.ecat_set<std::uint8_t>(0x0981, 1); }},
    };
    for (const auto& change : changes) {
        esc = PlainEsc{};
        client = Client{};
        start(kDevice);
        bring_to(AlState::preop);
        client.answer = wait;
        (void)request(4);
        change.make();
        client.answer = nullptr;
        esc.time += 10ms;
        EXPECT_EQ(step(), kNever);
        EXPECT_EQ(esc.al_status(), refused(AlState::preop, change.code));
        EXPECT_EQ(client.log, "PS? PSx ") << "the application hears that the transition is cancelled";
    }
}

TEST_F(EsmTest, MailboxesThatChangeWhilePreopWaitsAreCheckedAgain) {
    client.answer = [](Transition, Time now) { return Verdict::wait(now + 10ms); };
    (void)request(2);
    client.answer = nullptr;
    esc.configure(1, {0x1080, 300, 0x22, 1});
    esc.time += 10ms;
    (void)step();
    EXPECT_EQ(esc.al_status(), refused(AlState::init, AlStatusCode::invalid_mailbox_configuration));
}

// A master that has requested INIT waits for INIT and stops its outputs. Meanwhile the watchdog ends OP.
TEST_F(EsmTest, ARequestForALowerStateSurvivesAFault) {
    for (const auto& [wanted, log] :
         {std::pair{1U, "OI? OIx OS! OS. SI? SI? SI! SI. "}, std::pair{2U, "OP? OPx OS! OS. SP? SP? SP! SP. "},
          std::pair{4U, "OS? OSx OS! OS. "}}) {
        esc = PlainEsc{};
        client = Client{};
        start(kDevice);
        bring_to(AlState::op);
        client.answer = [](Transition, Time now) { return Verdict::wait(now + 10ms); };
        (void)request(static_cast<std::uint16_t>(wanted));
        esm->fall_back(AlState::safeop, AlStatusCode::sync_manager_watchdog, esc.time);
        EXPECT_EQ(esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
        client.answer = nullptr;
        esc.time += 10ms;
        EXPECT_EQ(step(), kNever);
        EXPECT_EQ(esc.al_status(), wanted == 4 ? refused(AlState::safeop, AlStatusCode::sync_manager_watchdog)
                                               : ok(static_cast<AlState>(wanted)));
        EXPECT_EQ(client.log, log);
    }
}

TEST_F(EsmTest, FaultsForceTheDeviceDown) {
    bring_to(AlState::op);
    client.answer = [](Transition, Time) { return Verdict::refuse(AlStatusCode::unspecified); };
    esm->fall_back(AlState::safeop, AlStatusCode::sync_manager_watchdog, esc.time);
    EXPECT_EQ(esc.al_status(), refused(AlState::safeop, AlStatusCode::sync_manager_watchdog));
    EXPECT_EQ(client.log, "OS! OS. ") << "nobody is asked";
    esm->fall_back(AlState::op, AlStatusCode::unspecified, esc.time);
    EXPECT_EQ(esc.al_status(), refused(AlState::safeop, AlStatusCode::unspecified)) << "a fault never lifts";
}

TEST_F(EsmTest, SyncManagersTakenAwayThrowTheDeviceOut) {
    bring_to(AlState::op);
    (void)step();
    EXPECT_EQ(esc.al_status(), ok(AlState::op));
    esc.ecat_set<std::uint8_t>(0x0816, 0);
    (void)step();
    EXPECT_EQ(esc.al_status(), refused(AlState::preop, AlStatusCode::invalid_output_configuration));
    configure();
    (void)request(0x14);
    esc.ecat_set<std::uint8_t>(0x080E, 0);
    (void)step();
    EXPECT_EQ(esc.al_status(), refused(AlState::init, AlStatusCode::invalid_mailbox_configuration));
    EXPECT_EQ(esc.events() & wire::al_event::kSmActivation, 0u);
}

TEST_F(EsmTest, RestartOfTheMasterClearsEverythingAtOnce) {
    bring_to(AlState::op);
    for (unsigned n = 0; n < 4; ++n) esc.configure(n, {});
    EXPECT_EQ(request(0x11), ok(AlState::init)) << "AL control goes before the sync managers";
}

TEST_F(EsmTest, RepeatBitsOfTheMailboxSurviveLocking) {
    bring_to(AlState::preop);
    esc.ecat_set<std::uint8_t>(0x080F, 0x02);
    (void)request(1);
    EXPECT_EQ(esc.get<std::uint8_t>(0x080F), 0x03);
}

TEST_F(EsmTest, ExplicitDeviceIdentification) {
    for (const std::uint16_t position :
         {std::uint16_t{0x1234}, std::uint16_t{7}}) {  // value of a switch, which is read at each request
        client.id = position;
        (void)request(0x21);
        EXPECT_EQ(esc.get<std::uint16_t>(0x0130), 0x21);
        EXPECT_EQ(esc.get<std::uint16_t>(0x0134), position);
        (void)request(0x01);
        EXPECT_EQ(esc.get<std::uint16_t>(0x0130), 0x01);
        EXPECT_EQ(esc.get<std::uint16_t>(0x0134), 0);
    }
    client.id = 0;
    (void)request(0x21);
    EXPECT_EQ(esc.get<std::uint16_t>(0x0130), 0x01) << "not offered, not answered";
    auto with_switch = kDevice;
    with_switch.device_id_switch = true;
    start(with_switch);
    (void)request(0x21);
    EXPECT_EQ(esc.get<std::uint16_t>(0x0130), 0x21) << "the switch is at 0";
    EXPECT_EQ(esc.get<std::uint16_t>(0x0134), 0);
    (void)request(0x01);
    EXPECT_EQ(esc.get<std::uint16_t>(0x0130), 0x01);
}

}  // namespace
}  // namespace margay::subdevice
