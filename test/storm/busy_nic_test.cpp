// A NIC that accepts no frame, from the start or from some moment on. Every request must end in bounded time, and
// everything must work when the NIC accepts frames again.
#include "storm/rig.hpp"

namespace margay::storm {
namespace {

using namespace std::chrono_literals;

constexpr Duration kBound = 30s;

struct BusyNic : testing::Test, Rig {
    void SetUp() override {
        plug_line({"coupler", "digital_io_16", "digital_out_8"});
        start();
    }
    void stays_busy() { nic.rates = {.busy = Rate::always(), .busy_for = 10s}; }
    void expect_works() {
        nic.settle();
        cycling = false;
        ASSERT_EQ(scan().code, Errc::none);
        ASSERT_EQ(ctx->slaves().size(), 3U);
        ASSERT_EQ(map().code, Errc::none);
    }
};

TEST_F(BusyNic, FromTheStart) {
    stays_busy();
    const auto error = scan(kBound);
    EXPECT_NE(error.code, Errc::none);
    EXPECT_NE(error.code, Errc::busy) << "the scan never ends";
    expect_works();
}

TEST_F(BusyNic, WhileProcessDataIsMapped) {
    ASSERT_EQ(scan().code, Errc::none);
    stays_busy();
    EXPECT_NE(map(kBound).code, Errc::busy) << "the mapping never ends";
    expect_works();
}

TEST_F(BusyNic, DuringAnSdo) {
    ASSERT_EQ(scan().code, Errc::none);
    stays_busy();
    std::array<std::byte, 64> data{};
    SdoUpload upload;
    upload.slave = 2;
    upload.index = 0x1008;
    upload.data = data;
    const auto error = run(upload, kBound);
    EXPECT_NE(error.code, Errc::none);
    EXPECT_NE(error.code, Errc::busy) << "the upload never ends";
    expect_works();
}

// All requests of a bring-up, with a NIC that becomes busy at each frame of the bring-up in turn.
TEST_F(BusyNic, FromEveryFrameOfTheBringUpOn) {
    ASSERT_EQ(scan().code, Errc::none);
    const auto frames = nic.sent().frames;
    for (std::uint64_t n = 0; n < frames; n += 7) {
        const auto begin = nic.sent().frames;
        ScanRequest request;
        ASSERT_TRUE(submit(*ctx, request).ok());
        (void)until([&] { return nic.sent().frames >= begin + n || !request.busy(); }, kBound);
        stays_busy();
        EXPECT_TRUE(ends(request, kBound)) << "busy from frame " << n << " on";
        nic.settle();
    }
    expect_works();
}

// The NIC refuses frames half of the time. The bring-up is slower, but without errors.
TEST_F(BusyNic, EverySecondFrameIsOnlyLate) {
    nic.rates = {.busy = Rate::percent(50), .busy_for = 200us};
    EXPECT_EQ(scan().code, Errc::none);
    EXPECT_EQ(map().code, Errc::none);
    expect_works();
}

}  // namespace
}  // namespace margay::storm
