// The SDO services of the CoE server: every form of transfer at every boundary, and every abort code.
#include "bench_device.hpp"

#include <algorithm>

namespace margay::subdevice {
namespace {

using namespace testing;

std::vector<std::byte> sdo_pattern(std::size_t bytes) {
    std::vector<std::byte> out(bytes);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = static_cast<std::byte>(i * 7 + 1);
    return out;
}

TEST(SdoUpload, ExpeditedForUpToFourOctets) {
    Bench bench;
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x1018, 1)), raw({0, 0x30, 0x43, 0x18, 0x10, 1, 0x47, 0x4D, 0, 0}));
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x1C00, 3)), raw({0, 0x30, 0x4F, 0x00, 0x1C, 3, 3, 0, 0, 0}));
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x2000, 0)), raw({0, 0x30, 0x4B, 0x00, 0x20, 0, 100, 0, 0, 0}));
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x2002, 0)), raw({0, 0x30, 0x43, 0x02, 0x20, 0, 'n', 'o', 'n', 'e'}));
}

TEST(SdoUpload, NormalInOneMessage) {
    Bench bench;
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x2001, 0)),
              raw({0, 0x30, 0x41, 0x01, 0x20, 0, 8, 0, 0, 0, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11}));
    EXPECT_EQ(upload(bench, 0x1008).text(), "Bench device of many words");
}

TEST(SdoUpload, AnEmptyStringIsANormalTransferOfNothing) {
    Bench bench;
    ASSERT_EQ(download(bench, 0x2002, 0, {}).abort, Abort::none);
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x2002, 0)), raw({0, 0x30, 0x41, 0x02, 0x20, 0, 0, 0, 0, 0}));
}

TEST(SdoTransfer, EveryLengthGoesThereAndBackThroughEveryMailbox) {
    for (const int size : {24, 26, 64, 128, 256}) {
        const auto mailbox = static_cast<std::uint16_t>(size);
        Bench bench(mailbox);
        for (std::size_t bytes = 1; bytes <= 20; ++bytes) {
            const auto data = std::vector<std::byte>(bytes, std::byte{'x'});
            ASSERT_EQ(download(bench, 0x2002, 0, data).abort, Abort::none) << bytes << " through " << mailbox;
            ASSERT_EQ(upload(bench, 0x2002).data, data) << bytes << " through " << mailbox;
        }
        const std::size_t room = mailbox - 6u;
        for (const std::size_t bytes :
             {room - 17, room - 11, room - 10, room - 9, room - 4, room - 3, room - 2, room, room + 1, room * 2})
            for (const std::size_t first : {std::size_t{0}, std::size_t{1}, SIZE_MAX}) {
                if (bytes > 300) continue;
                const auto data = sdo_pattern(bytes);
                ASSERT_EQ(download(bench, 0x2003, 0, data, false, true, first).abort, Abort::none)
                    << bytes << " through " << mailbox;
                const auto back = upload(bench, 0x2003);
                ASSERT_EQ(back.data.size(), 300u) << "an octet string keeps its length";
                ASSERT_TRUE(std::equal(data.begin(), data.end(), back.data.begin()));
                ASSERT_TRUE(std::all_of(back.data.begin() + static_cast<std::ptrdiff_t>(bytes), back.data.end(),
                                        [](std::byte b) { return b == std::byte{0}; }));
            }
    }
}

TEST(SdoTransfer, TheLastSegmentSaysHowManyOctetsAreUnused) {
    Bench bench(24);  // 18 octets of data: 8 in the first message, 15 in a segment
    ASSERT_EQ(download(bench, 0x2002, 0, std::vector<std::byte>(13, std::byte{'y'})).abort, Abort::none);
    const auto first = bench.exchange(sdo_request(0x40, 0x2002, 0));
    EXPECT_EQ(first.size(), 18u);
    const auto y = int{'y'};
    EXPECT_EQ(bench.exchange(sdo_request(0x60, 0, 0)), raw({0, 0x30, 0x05, y, y, y, y, y, 0, 0}));
}

TEST(SdoTransfer, VastObjectsStreamPastTheStagingBuffer) {
    Bench bench(256);
    const auto back = upload(bench, 0x2008);
    EXPECT_EQ(back.data, bench.application.vast);
    EXPECT_EQ(back.segments, (70'000u - 240u + 246u) / 247u);
    const auto data = sdo_pattern(65'537);
    EXPECT_EQ(download(bench, 0x2008, 0, data).abort, Abort::none);
    EXPECT_EQ(bench.application.vast_bytes, 65'537u);
    EXPECT_EQ(upload(bench, 0x2008).data, data);
    EXPECT_EQ(download(bench, 0x2008, 0, sdo_pattern(70'001)).abort, Abort::length_too_high);
}

// Records whether octets change while the lock is not held.
struct WatchingLock final : EscAccess {
    explicit WatchingLock(const std::vector<std::byte>& watched) : octets(watched), known(watched) {}
    void read(std::uint16_t, MutableBytes) noexcept override {}
    void write(std::uint16_t, Bytes) noexcept override {}
    [[nodiscard]] Time now() noexcept override { return {}; }
    [[nodiscard]] std::uint32_t lock() noexcept override {
        if (depth == 0) look();
        return depth++;
    }
    void unlock(std::uint32_t before) noexcept override {
        depth = before;
        if (depth == 0) known = octets;
    }
    void look() { unlocked += known != octets ? 1 : 0; }
    const std::vector<std::byte>& octets;
    std::vector<std::byte> known;
    std::uint32_t depth = 0;
    unsigned unlocked = 0;
};

TEST(SdoTransfer, VastObjectsAreWrittenUnderTheLock) {
    Bench bench(256);
    WatchingLock lock(bench.application.vast);
    bench.dictionary.set_lock(&lock);
    EXPECT_EQ(download(bench, 0x2008, 0, sdo_pattern(1000)).abort, Abort::none);
    lock.look();
    EXPECT_EQ(lock.unlocked, 0u);
    EXPECT_NE(lock.known[999], std::byte{0x5A}) << "something was written";
    bench.dictionary.set_lock(nullptr);
}

TEST(SdoDownload, ExpeditedWithoutSizeTakesTheObjectsLength) {
    Bench bench;
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x22, 0x2000, 0, 0xFFFF0123))), Abort::none);
    EXPECT_EQ(upload(bench, 0x2000).number(), 0x0123u);
}

TEST(SdoDownload, IsConfirmedOctetByOctet) {
    Bench bench;
    EXPECT_EQ(bench.exchange(sdo_request(0x2B, 0x2000, 0, 5)), raw({0, 0x30, 0x60, 0x00, 0x20, 0, 0, 0, 0, 0}));
}

TEST(SdoAbort, EachWhereItBelongs) {
    using enum Abort;
    Bench bench;
    EXPECT_EQ(upload(bench, 0x5000).abort, no_object);
    EXPECT_EQ(upload(bench, 0x1018, 5).abort, no_subindex);
    EXPECT_EQ(upload(bench, 0x2005).abort, write_only);
    EXPECT_EQ(upload(bench, 0x1003, 1).abort, no_subindex) << "no error yet";
    EXPECT_EQ(download(bench, 0x1018, 1, number(1, 4)).abort, read_only);
    EXPECT_EQ(download(bench, 0x2004, 0, number(5, 1)).abort, device_state) << "written in OP only";
    EXPECT_EQ(download(bench, 0x2000, 0, number(1, 1)).abort, length_too_low);
    EXPECT_EQ(download(bench, 0x2000, 0, number(1, 3)).abort, length_too_high);
    EXPECT_EQ(download(bench, 0x2000, 0, number(501, 2)).abort, value_too_high);
    EXPECT_EQ(download(bench, 0x2000, 0, number(static_cast<std::uint64_t>(-501), 2)).abort, value_too_low);
    EXPECT_EQ(download(bench, 0x2000, 0, number(static_cast<std::uint64_t>(-500), 2)).abort, none);
    EXPECT_EQ(download(bench, 0x2002, 0, sdo_pattern(21)).abort, length_too_high);
    EXPECT_EQ(download(bench, 0x2001, 0, sdo_pattern(7), false, true).abort, length_too_low);
    EXPECT_EQ(download(bench, 0x2001, 0, sdo_pattern(9), false, true).abort, length_too_high);
    EXPECT_EQ(download(bench, 0x2003, 0, sdo_pattern(301)).abort, length_too_high) << "told before the segments travel";
    EXPECT_EQ(upload(bench, 0x1018, 2, true).abort, unsupported_access) << "complete access begins at 0 or 1";
    EXPECT_EQ(upload(bench, 0x2000, 0, true).abort, unsupported_access) << "a variable is complete as it is";
    EXPECT_EQ(upload(bench, 0x10F3, 0, true).abort, complete_access_unsupported);
    EXPECT_EQ(download(bench, 0x1018, 0, sdo_pattern(18), true).abort, read_only);
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), unknown_command) << "no upload is under way";
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x00, 0, 0))), unknown_command);
    for (const int specifier : {0xA0, 0xC0, 0xE0})
        EXPECT_EQ(abort_of(bench.exchange(sdo_request(specifier, 0x2000, 0))), unknown_command);
    EXPECT_EQ(download(bench, 0x1C12, 1, number(0x1601, 2)).abort, subindex_needs_zero);
    EXPECT_EQ(download(bench, 0x1003, 0, number(1, 1)).abort, value_range);
    auto too_long = sdo_request(0x21, 0x2001, 0, 4);
    too_long.resize(18);
    EXPECT_EQ(abort_of(bench.exchange(too_long)), length_mismatch) << "more data than announced";
}

TEST(SdoAbort, NamesTheObjectAndTravelsAsRequest) {
    Bench bench;
    EXPECT_EQ(bench.exchange(sdo_request(0x40, 0x5000, 7)), raw({0, 0x20, 0x80, 0x00, 0x50, 7, 0, 0, 0x02, 0x06}));
}

TEST(SdoAbort, DevicesWithoutCompleteAccess) {
    Bench bench;
    CoeServer plain(bench.dictionary, bench.staging, false);
    const std::array<MailboxProtocol, 1> protocols{{{wire::MailboxType::coe, &plain}}};
    std::array<std::byte, 128> receive{};
    std::array<std::byte, 512> send{};
    bench.mailbox.emplace(bench.esc, MutableBytes(receive), MutableBytes(send), protocols);
    ASSERT_TRUE(bench.mailbox->fits());
    bench.mailbox->start(AlState::preop);
    EXPECT_EQ(upload(bench, 0x1018, 0, true).abort, Abort::unsupported_access);
    EXPECT_EQ(upload(bench, 0x1018, 0).abort, Abort::none);
}

TEST(SdoAbort, SegmentsOutOfStep) {
    Bench bench(64);
    const auto start = [&] { return abort_of(bench.exchange(sdo_request(0x40, 0x2003, 0))); };
    ASSERT_EQ(start(), Abort::none);
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x70, 0, 0))), Abort::toggle_not_changed);
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), Abort::unknown_command) << "that ended it";
    ASSERT_EQ(start(), Abort::none);
    ASSERT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), Abort::none);
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), Abort::toggle_not_changed);
    ASSERT_EQ(start(), Abort::none);
    ASSERT_EQ(upload(bench, 0x2000).abort, Abort::none) << "a new transfer ends the old";
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), Abort::unknown_command);
    ASSERT_EQ(start(), Abort::none);
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x80, 0x2003, 0, 0x05040000)));
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty()) << "the client's abort is not answered";
    EXPECT_EQ(abort_of(bench.exchange(sdo_request(0x60, 0, 0))), Abort::unknown_command);
}

TEST(SdoAbort, SegmentedDownloadsThatEndWrong) {
    Bench bench(64);
    const auto start = [&](std::uint32_t size) { return abort_of(bench.exchange(sdo_request(0x21, 0x2003, 0, size))); };
    const auto segment = [&](int command, std::size_t bytes) {
        std::vector<std::byte> data(3 + bytes);
        data[1] = std::byte{0x20};
        data[2] = static_cast<std::byte>(command);
        return abort_of(bench.exchange(data));
    };
    ASSERT_EQ(start(100), Abort::none);
    EXPECT_EQ(segment(0x01, 50), Abort::length_too_low) << "the last one, and half is missing";
    ASSERT_EQ(start(100), Abort::none);
    EXPECT_EQ(segment(0x00, 55), Abort::none);
    EXPECT_EQ(segment(0x10, 55), Abort::length_too_high) << "more than announced";
    EXPECT_EQ(segment(0x00, 5), Abort::unknown_command) << "over";
    ASSERT_EQ(start(100), Abort::none);
    EXPECT_EQ(segment(0x10, 50), Abort::toggle_not_changed);
    bench.dictionary.restore_defaults();
    EXPECT_EQ(upload(bench, 0x2003).data, std::vector<std::byte>(300)) << "nothing half-written";
}

TEST(SdoAbort, StagingIsTheAuthorsAndEndsSomewhere) {
    Bench bench(64);
    CoeServer small(bench.dictionary, MutableBytes(bench.staging).first(80), true);
    const std::array<MailboxProtocol, 1> protocols{{{wire::MailboxType::coe, &small}}};
    std::array<std::byte, 128> receive{};
    std::array<std::byte, 512> send{};
    bench.mailbox.emplace(bench.esc, MutableBytes(receive), MutableBytes(send), protocols);
    ASSERT_TRUE(bench.mailbox->fits());
    bench.mailbox->start(AlState::preop);
    EXPECT_EQ(download(bench, 0x2003, 0, sdo_pattern(81)).abort, Abort::out_of_memory);
    EXPECT_EQ(download(bench, 0x2003, 0, sdo_pattern(80)).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x2003).abort, Abort::out_of_memory) << "the application could change it meanwhile";
    EXPECT_EQ(download(bench, 0x2008, 0, sdo_pattern(500)).abort, Abort::none) << "straight into an object in pieces";
    EXPECT_EQ(upload(bench, 0x2008).data, sdo_pattern(500)) << "and out of it";
}

TEST(SdoComplete, SubindexZeroTakesSixteenBits) {
    Bench bench;
    EXPECT_EQ(upload(bench, 0x1018, 0, true).data,
              raw({4, 0, 0x47, 0x4D, 0, 0, 0x10, 0, 0, 0, 1, 0, 0, 0, 7, 0, 0, 0}));
    EXPECT_EQ(upload(bench, 0x1018, 1, true).data, raw({0x47, 0x4D, 0, 0, 0x10, 0, 0, 0, 1, 0, 0, 0, 7, 0, 0, 0}));
    EXPECT_EQ(upload(bench, 0x1C12, 0, true).data, raw({1, 0, 0x00, 0x16}));
    EXPECT_EQ(upload(bench, 0x1C00, 0, true).data, raw({4, 0, 1, 2, 3, 4}));
}

TEST(SdoComplete, BitsArePackedAndWriteOnlyEntriesReadAsZero) {
    Bench bench;
    EXPECT_EQ(upload(bench, 0x2006, 0, true).data, raw({5, 0, 0x01, 0xD4, 0xC3, 0xB2, 0xA1, 0xEF, 0xBE, 0x00}));
    ASSERT_EQ(download(bench, 0x2006, 0, raw({5, 0, 0x00, 1, 2, 3, 4, 0x12, 0x34, 8}), true).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x2006, 0, true).data, raw({5, 0, 0x00, 1, 2, 3, 4, 0xEF, 0xBE, 0x00}))
        << "the constant stays";
    EXPECT_EQ(Values::level::load(bench.image), 8);
    EXPECT_EQ(download(bench, 0x2006, 0, raw({5, 0, 0x00, 1, 2, 3, 4, 0x12, 0x34}), true).abort, Abort::length_too_low);
    EXPECT_EQ(download(bench, 0x2006, 0, raw({5, 0, 0, 1, 2, 3, 4, 1, 2, 3, 4}), true).abort, Abort::length_too_high);
    EXPECT_EQ(download(bench, 0x2006, 1, raw({0x01, 9, 9, 9, 9, 0, 0, 7}), true).abort, Abort::none);
    EXPECT_EQ(upload(bench, 0x2006, 3).number(), 0x09090909u);
}

TEST(SdoHooks, MayTakeTheirTimeAndOtherSdosWaitInOrder) {
    Bench bench;
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x2007, 0)));
    EXPECT_EQ(bench.step(), bench.application.slow_until);
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty());
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1001, 0)));
    bench.settle();
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    bench.settle();
    EXPECT_FALSE(bench.put(raw({0}))) << "the server, a slot, the receive buffer and the mailbox have one each";
    bench.esc.time = bench.application.slow_until;
    bench.settle();
    EXPECT_EQ(wire::coe::SdoLayout::index::load(bench.receive()), 0x2007);
    EXPECT_EQ(wire::coe::SdoLayout::index::load(bench.receive()), 0x1000);
    EXPECT_EQ(wire::coe::SdoLayout::index::load(bench.receive()), 0x1001);
    bench.settle();
    EXPECT_EQ(wire::coe::SdoLayout::index::load(bench.receive()), 0x1000);
}

TEST(SdoHooks, EmergenciesDoNotWaitForThem) {
    Bench bench;
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x2007, 0)));
    (void)bench.step();
    ASSERT_TRUE(bench.application.emergencies()->raise({.error_code = 0x8130}));
    (void)bench.step();
    EXPECT_EQ(wire::coe::load_header(bench.receive()).service, wire::coe::Service::emergency);
}

TEST(SdoHooks, ADownloadThatWaitsKeepsItsData) {
    Bench bench;
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x23, 0x2007, 0, 0xCAFE)));
    (void)bench.step();
    EXPECT_EQ(bench.application.writes, 0u);
    bench.esc.time += 50ms;
    bench.settle();
    EXPECT_EQ(abort_of(bench.receive()), Abort::none);
    EXPECT_EQ(bench.application.writes, 1u);
    EXPECT_EQ(upload(bench, 0x2007).number(), 0xCAFEu);
}

TEST(SdoHooks, AHookWithoutEndIsGivenUp) {
    Bench bench;
    bench.application.slow_until = Time{} + 1h;
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x2007, 0)));
    (void)bench.step();
    bench.esc.time += 1h - 1ns;
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty()) << "not asked again before its time";
    bench.application.slow_until = Time{} + 2h;
    bench.esc.time += 1ns;
    bench.settle();
    EXPECT_EQ(abort_of(bench.receive()), Abort::timeout);
    EXPECT_EQ(upload(bench, 0x1000).abort, Abort::none);
}

TEST(SdoHooks, AHookWithoutATimeWaitsForAStepAndIsGivenUp) {
    for (const int command : {0x40, 0x23}) {
        for (const bool comes : {true, false}) {
            Bench bench;
            bench.application.no_time = true;
            ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(command, 0x2007, 0, 0xCAFE)));
            EXPECT_EQ(bench.step(), bench.esc.time + 10s);
            bench.esc.time += 1s;
            bench.settle();
            EXPECT_TRUE(bench.fetch().empty()) << "no answer of the hook, no answer of the device";
            EXPECT_EQ(bench.application.writes, 0u);
            bench.esc.time += comes ? 8s : 9s;
            bench.application.no_time = !comes;
            bench.settle();
            EXPECT_EQ(abort_of(bench.receive()), comes ? Abort::none : Abort::timeout);
            EXPECT_EQ(bench.application.writes, comes && command == 0x23 ? 1u : 0u);
        }
    }
}

// A hook reports an error that ends the mailbox, or restarts the device: the reply of its access is dropped.
TEST(SdoHooks, MayEndTheMailbox) {
    for (const bool restart : {false, true}) {
        for (const bool after : {false, true}) {
            for (const int command : {0x40, 0x23}) {
                if (after && command == 0x40) continue;
                Bench bench;
                bench.application.slow_until = Time{};
                unsigned calls = 0;
                auto& hook = after ? bench.application.during_write : bench.application.during_hook;
                hook = [&] {
                    ++calls;
                    if (restart) return bench.device->start(bench.esc.time);
                    bench.device->fall_back(AlState::init, AlStatusCode::unspecified, bench.esc.time);
                };
                ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(command, 0x2007, 0, 0xCAFE)));
                bench.settle();
                EXPECT_EQ(calls, 1u);
                EXPECT_EQ(bench.device->state(), AlState::init);
                EXPECT_EQ(bench.esc.al_status().error, !restart);
                EXPECT_EQ(bench.mailbox->counters().sent, 0u);
                EXPECT_FALSE(bench.mailbox->running());
                hook = [] {};
                bench.configure(128);
                EXPECT_EQ(bench.request(0x12).state, AlState::preop);
                EXPECT_EQ(upload(bench, 0x1000).number(), 0x191u) << "the mailbox works again, without an old reply";
            }
        }
    }
}

TEST(SdoStates, ASegmentedDownloadEndsWhenTheStateForbidsIt) {
    Bench bench(64);
    const auto segment = [&](int command, std::size_t bytes) {
        std::vector<std::byte> data(3 + bytes);
        data[1] = std::byte{0x20};
        data[2] = static_cast<std::byte>(command);
        return abort_of(bench.exchange(data));
    };
    // The number of entries and the entries of 0x1600 may be written in PREOP only.
    ASSERT_EQ(abort_of(bench.exchange(sdo_request(0x31, 0x1600, 0, 14))), Abort::none);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(segment(0x01, 14), Abort::device_state);
    EXPECT_EQ(Values::rx_count::load(bench.image), 3) << "nothing has changed";

    ASSERT_EQ(bench.request(2).state, AlState::preop);
    ASSERT_EQ(abort_of(bench.exchange(sdo_request(0x21, 0x1600, 1, 4))), Abort::none);
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(segment(0x01 | (3 << 1), 7), Abort::device_state);
    EXPECT_EQ(Values::rx_first::load(bench.image), 0x70000108u);
}

TEST(SdoStates, AccessFollowsTheState) {
    Bench bench;
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(download(bench, 0x1C12, 0, number(0, 1)).abort, Abort::device_state);
    EXPECT_EQ(download(bench, 0x7000, 1, number(5, 1)).abort, Abort::none);
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 3, 0})));
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(download(bench, 0x2004, 0, number(5, 1)).abort, Abort::none);
    EXPECT_EQ(download(bench, 0x2004, 0, number(0, 1)).abort, Abort::value_too_low);
    EXPECT_EQ(download(bench, 0x7000, 1, number(5, 1)).abort, Abort::mapped_to_rx_pdo);
    EXPECT_EQ(download(bench, 0x7000, 0, raw({4, 0, 1, 2, 3, 0}), true).abort, Abort::mapped_to_rx_pdo);
    EXPECT_EQ(download(bench, 0x7000, 4, number(1, 1)).abort, Abort::none) << "not in the mapping";
}

}  // namespace
}  // namespace margay::subdevice
