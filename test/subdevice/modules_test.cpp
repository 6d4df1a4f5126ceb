// Modular devices: the configured list of modules is compared with the detected list before SAFEOP.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

void expect_modules(Bench& bench, std::span<const int> idents) {
    ASSERT_EQ(download(bench, 0xF030, 0, raw({0})).abort, Abort::none);
    int slot = 0;
    for (const int ident : idents)
        ASSERT_EQ(download(bench, 0xF030, ++slot, raw({ident & 0xFF, ident >> 8, 0, 0})).abort, Abort::none);
    ASSERT_EQ(download(bench, 0xF030, 0, raw({slot})).abort, Abort::none);
}

TEST(Modules, TheProfileNamesSlotsAndDistance) {
    Bench bench;
    EXPECT_EQ(upload(bench, 0xF000, 1).number(), 0x10U);
    EXPECT_EQ(upload(bench, 0xF000, 2).number(), 3U);
    EXPECT_EQ(upload(bench, 0xF050, 0).number(), 0U);
    EXPECT_EQ(download(bench, 0xF030, 0, raw({4})).abort, Abort::value_too_high);
    EXPECT_EQ(download(bench, 0xF050, 1, raw({1, 0, 0, 0})).abort, Abort::read_only);
}

TEST(Modules, SafeopIsRefusedWhereTheListsDiffer) {
    struct Case {
        const char* what;
        std::vector<std::uint32_t> found;
        std::vector<int> expected;
        bool right;
    };
    const Case cases[] = {{"no expectation", {0x11, 0x22}, {}, true},
                          {"equal", {0x11, 0x22, 0x333}, {0x11, 0x22, 0x333}, true},
                          {"empty slots behind the modules", {0x11}, {0x11, 0, 0}, true},
                          {"an empty slot between", {0x11, 0, 0x33}, {0x11, 0, 0x33}, true},
                          {"another module", {0x11, 0x22}, {0x11, 0x23}, false},
                          {"a module is missing", {0x11}, {0x11, 0x22}, false},
                          {"a module too many", {0x11, 0x22}, {0x11}, false},
                          {"exchanged", {0x11, 0x22}, {0x22, 0x11}, false}};
    for (const Case& one : cases) {
        SCOPED_TRACE(one.what);
        Bench bench;
        Values::modules::store_found(bench.image, one.found);
        EXPECT_EQ(upload(bench, 0xF050, 0).number(), one.found.size());
        expect_modules(bench, one.expected);
        const AlStatus status = bench.request(4);
        EXPECT_EQ(status.state, one.right ? AlState::safeop : AlState::preop);
        EXPECT_EQ(status.code, one.right ? 0 : 0x0070);
    }
}

}  // namespace
}  // namespace margay::subdevice
