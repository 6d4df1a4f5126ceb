// The checks of subdevice_check on a line that loses frames. The old values are restored after a check has changed
// them, or the report says that they are not restored.
#include "oshw/filter_nic.hpp"
#include "samples/conformance.hpp"

namespace margay::samples::conformance {
namespace {

// Loses the frames with these numbers, from 0 on.
class BadContact final : public FilterNic {
  public:
    explicit BadContact(Nic& inner) : FilterNic(inner) {}
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        const auto n = count++;
        return n >= first && n - first < lost ? SendStatus::sent : inner().send(frame);
    }
    unsigned count = 0;
    unsigned first = 0;
    unsigned lost = 0;
};

struct Lists {
    std::string_view device;
    std::string_view check;
    std::uint16_t index;
};
constexpr Lists kLists[] = {{"odd_device", "pdos.assignment", 0x1C12},
                            {"odd_device", "pdos.unknown", 0x1C12},
                            {"modular_io", "modules.mismatch", 0xF030}};

unsigned count_of(Context& ctx, const Lists& lists) {
    const auto count = SDOread<std::uint8_t>(ctx, 1, lists.index, 0);
    EXPECT_TRUE(count.ok());
    return count ? *count : 0xFFU;
}

// One execution of a check. The frames are counted from its beginning.
struct Trial {
    Trial(const Lists& lists, unsigned first, unsigned lost)
        : nic(cable, osal), contact(nic), ctx(Limits{.slaves = 4}) {
        cable.add(sim::make_device(lists.device).value().assemble());
        EXPECT_TRUE(cable.connect_master({0, 0}));
        cable.power_up(osal.now());
        EXPECT_TRUE(init(ctx, contact, osal).ok());
        EXPECT_TRUE(config_init(ctx).ok());
        before = count_of(ctx, lists);
        const auto begins = [&](std::string_view name) {
            contact.count = 0;
            contact.first = first;
            contact.lost = name == lists.check ? lost : 0;
        };
        const Options options{.only = std::string(lists.check)};
        report = check_device(ctx, osal, nic.wait_handle(), 1, options, begins).report;
        frames = contact.count;
        contact.lost = 0;
        ctx.link_settings() = LinkSettings{};
        EXPECT_TRUE(config_init(ctx).ok());
        after = count_of(ctx, lists);
    }
    sim::Segment cable;
    VirtualOsal osal;
    SimulatedNic nic;
    BadContact contact;
    HostContext ctx;
    Report report;
    unsigned before = 0;
    unsigned after = 0;
    unsigned frames = 0;
};

TEST(SubdeviceCheckLine, ListsGetTheirOldValuesBackWhereverFramesAreLost) {
    for (const auto& lists : kLists) {
        const Trial fine(lists, 0, 0);
        ASSERT_EQ(find(fine.report, lists.check)->outcome, Outcome::passed) << report_text(fine.report, true);
        ASSERT_EQ(fine.after, fine.before) << lists.check;
        for (unsigned first = 0; first < fine.frames; first += 5) {
            const Trial run(lists, first, 2);
            EXPECT_EQ(run.after, fine.before) << lists.check << ", frame " << first;
            EXPECT_EQ(run.report.count(Severity::error), 0U) << report_text(run.report, true);
        }
    }
}

TEST(SubdeviceCheckLine, AListThatIsNotPutBackIsSaid) {
    unsigned changed = 0;
    for (const auto& lists : kLists) {
        const Trial fine(lists, 0, 0);
        for (unsigned first = 0; first < fine.frames; first += 10) {
            const Trial run(lists, first, 1'000'000);
            if (run.after == run.before) continue;
            ++changed;
            const auto* const check = find(run.report, lists.check);
            EXPECT_EQ(check->outcome, Outcome::broken_off);
            EXPECT_FALSE(run.report.conforms());
            EXPECT_NE(check->reason.find("may still have values of this check"), std::string::npos)
                << report_text(run.report, true);
        }
    }
    EXPECT_GT(changed, 0U);
}

TEST(SubdeviceCheckLine, AReportOfNoCheckSaysWhyNothingWasChecked) {
    const auto report = check_it(sim::make_device("coupler").value(), {.only = "sdo."}).report;
    EXPECT_TRUE(report.conforms());
    const auto text = report_text(report, false);
    EXPECT_NE(text.find("Nothing was checked"), std::string::npos) << text;
    EXPECT_NE(text.find("the SII does not announce CoE"), std::string::npos) << text;
    const auto known =
        report_text(check_it(sim::make_device("coupler").value(), {.only = "sdo.,eeprom."}).report, false);
    EXPECT_EQ(known.find("Nothing was checked"), std::string::npos) << known;
}

}  // namespace
}  // namespace margay::samples::conformance
