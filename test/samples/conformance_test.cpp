// The checks of subdevice_check: devices that keep the rules pass the checks, and each broken rule of a quirk is found
// by name. conformance_faults_test.cpp contains the faults that are not quirks.
#include "samples/conformance.hpp"

#include <nlohmann/json.hpp>

#include <set>

namespace margay::samples::conformance {
namespace {

TEST(SubdeviceCheck, EveryDeviceOfTheLibraryKeepsTheRules) {
    std::size_t judged = 0;
    for (const auto name : sim::device_names()) {
        const auto checked = check_it(sim::make_device(name).value(), {.write_eeprom = true});
        EXPECT_EQ(checked.error, "") << name;
        EXPECT_TRUE(checked.report.conforms()) << name << "\n" << report_text(checked.report, false);
        EXPECT_EQ(checked.report.checks.size(), all_checks().size()) << name;
        for (const auto& check : checked.report.checks) judged += check.outcome == Outcome::passed ? 1U : 0U;
        if (name != "odd_device") continue;
        // Nearly all checks apply to this device.
        std::set<std::string> left;
        for (const auto& check : checked.report.checks)
            if (check.outcome != Outcome::passed) left.insert(check.name);
        EXPECT_EQ(left, (std::set<std::string>{"clock.cycle_short", "clock.sync1", "messages.emergencies",
                                               "modules.lists", "modules.match", "modules.mismatch", "sdo.write_only",
                                               "sm.boot_settings", "states.device_id", "sync.types"}));
    }
    EXPECT_GT(judged, 700U);
}

// The lengths of process data are found before a check changes the assignment.
TEST(SubdeviceCheck, AnAssignmentThatACheckHasChangedDoesNoHarmToTheNext) {
    for (const auto* const before : {"pdos.assignment", "pdos.unknown", "pdos.mapping"}) {
        const auto only = std::string(before) + ",clock.sync0";
        const auto checked = check_it(sim::make_device("split_io").value(), {.only = only});
        const auto* const sync = find(checked.report, "clock.sync0");
        ASSERT_NE(sync, nullptr);
        EXPECT_EQ(sync->outcome, Outcome::passed) << before << "\n" << report_text(checked.report, true);
    }
}

TEST(SubdeviceCheck, EachQuirkOfTheLibraryIsFoundByName) {
    std::set<std::string_view> listed;
    for (const auto& row : kQuirks) {
        listed.insert(row.quirk);
        // The slow object of the odd device is slower than slow replies.
        auto device = sim::make_device(row.quirk == "slow_replies" ? "digital_io_16" : "odd_device").value();
        ASSERT_TRUE(add_quirk(device, row.quirk)) << row.quirk;
        const auto checked =
            check_it(std::move(device), {.write_eeprom = row.check == "eeprom.write", .only = only(row.check)});
        EXPECT_EQ(checked.error, "") << row.quirk;
        if (row.check.empty()) {
            EXPECT_NE(row.no_rule, "") << row.quirk;
            EXPECT_TRUE(checked.report.conforms()) << row.quirk << "\n" << report_text(checked.report, false);
        } else {
            EXPECT_TRUE(has(checked.report, row.check, row.severity)) << row.quirk << " by " << row.check << "\n"
                                                                      << report_text(checked.report, true);
        }
    }
    for (const auto& quirk : sim::quirks()) EXPECT_TRUE(listed.contains(quirk.name)) << quirk.name;
}

TEST(SubdeviceCheck, JsonHasEachCheckAndFindingWithItsClause) {
    auto device = sim::make_device("odd_device").value();
    ASSERT_TRUE(add_quirk(device, "empty_repeats"));
    const auto json = report_json(check_it(std::move(device), {.only = "mailbox."}).report);
    EXPECT_EQ(json["number"], 1);
    EXPECT_EQ(json["conforms"], false);
    EXPECT_EQ(json["errors"], 1);
    for (const auto& check : json["checks"]) {
        const bool repeat = check["name"] == "mailbox.repeat";
        EXPECT_EQ(check["outcome"], repeat ? "failed" : "passed") << check;
        if (!repeat) continue;
        EXPECT_EQ(check["findings"][0]["severity"], "error");
        EXPECT_EQ(check["findings"][0]["clause"], "ETG.1000.4, Mailbox (repeat of a lost message)");
    }
}

TEST(SubdeviceCheck, MessagesAreNotJudgedWhereNoneCame) {
    const auto report = check_it(sim::make_device("odd_device").value(), {.only = "messages."}).report;
    for (const auto& check : report.checks) EXPECT_EQ(check.outcome, Outcome::not_applicable) << check.name;
}

TEST(SubdeviceCheck, EachNameOfChecksMustExist) {
    const auto chosen = [](std::string only) {
        return check_it(sim::make_device("odd_device").value(), {.only = std::move(only)});
    };
    for (const auto* const wrong : {"states.same,mailbox.repaet", "mailbox.repaet,states.same", ",", " "}) {
        EXPECT_TRUE(chosen(wrong).wrong_arguments) << wrong;
        EXPECT_TRUE(chosen(wrong).report.checks.empty()) << wrong;
    }
    EXPECT_NE(chosen("states.same,mailbox.repaet").error.find("'mailbox.repaet'"), std::string::npos);
    EXPECT_EQ(chosen(" states.same , mailbox.answers ").report.checks.size(), 2U);
}

TEST(SubdeviceCheck, NamesOfChecksAreUniqueAndHaveClauses) {
    std::set<std::string_view> names;
    for (const auto& check : all_checks()) {
        EXPECT_TRUE(names.insert(check.name).second) << check.name;
        EXPECT_TRUE(check.clause.starts_with("ETG.")) << check.name;
    }
}

// A real NIC ends a wait only with a frame, so a wait without a limit while no frame is in flight would never end.
class OsalOfARealNic final : public Osal {
  public:
    [[nodiscard]] Time now() noexcept override { return now_; }
    void wait(Time until, WaitHandles) noexcept override {
        if (nic != nullptr) until = std::min(until, nic->next_arrival());
        if (until == kNever)
            ++endless;
        else
            now_ = std::max(now_, until);
    }
    const SimulatedNic* nic = nullptr;
    unsigned endless = 0;

  private:
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override { return 1; }
    Time now_{};
};

TEST(SubdeviceCheck, NoWaitIsWithoutAnEnd) {
    sim::Segment segment;
    OsalOfARealNic osal;
    segment.add(sim::make_device("drive").value().assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    osal.nic = &nic;
    HostContext ctx{Limits{.slaves = 4}};
    ASSERT_TRUE(init(ctx, nic, osal).ok());
    const auto checked = check_device(ctx, osal, nic.wait_handle(), 1);
    EXPECT_EQ(checked.error, "");
    EXPECT_TRUE(checked.report.conforms()) << report_text(checked.report, false);
    EXPECT_EQ(osal.endless, 0U);
}

TEST(SubdeviceCheck, ADeviceThatIsPulledOutDoesNotConform) {
    sim::Segment segment;
    VirtualOsal osal;
    segment.add(sim::make_device("drive").value().assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx{Limits{.slaves = 4}};
    ASSERT_TRUE(init(ctx, nic, osal).ok());
    const auto pull = [&](std::string_view check) { segment.set_master_cable(0, !check.starts_with("sdo.write")); };
    const auto checked = check_device(ctx, osal, nic.wait_handle(), 1, {.only = "sdo"}, pull);
    EXPECT_EQ(checked.report.count(Severity::error), 0U);
    EXPECT_FALSE(checked.report.conforms());
    const auto* const broken_off = find(checked.report, "sdo.write");
    ASSERT_NE(broken_off, nullptr);
    EXPECT_EQ(broken_off->outcome, Outcome::broken_off);
    EXPECT_EQ(broken_off->reason.find("the line loses frames: "), 0U) << broken_off->reason;
    const auto text = report_text(checked.report, false);
    EXPECT_NE(text.find("broken off     sdo.write "), std::string::npos) << text;
    EXPECT_NE(text.find(" broken off; 0 errors"), std::string::npos) << text;
}

TEST(SubdeviceCheck, APositionThatDoesNotExistIsAnError) {
    sim::Segment segment;
    VirtualOsal osal;
    segment.add(sim::make_device("coupler").value().assemble());
    ASSERT_TRUE(segment.connect_master({0, 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx{Limits{.slaves = 4}};
    ASSERT_TRUE(init(ctx, nic, osal).ok());
    const auto absent = check_device(ctx, osal, -1, 2);
    EXPECT_EQ(absent.error, "NUMBER: there is 1 slave, the first is 1");
    EXPECT_TRUE(absent.wrong_arguments);
    const auto nothing = check_device(ctx, osal, -1, 1, {.only = "nothing"});
    EXPECT_EQ(nothing.error, "no check has a name that begins with 'nothing'");
    EXPECT_TRUE(nothing.wrong_arguments);
}

}  // namespace
}  // namespace margay::samples::conformance
