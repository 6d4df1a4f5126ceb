// All mailbox protocols at the same time on the same slaves, from real threads, beside a cycle. Each thread compares
// the data that it receives, and the owner compares each cycle. The tests use real time, because each of the threads
// would advance a shared virtual clock. No result depends on durations. Built with a thread sanitizer (label
// `threads`), these tests find data races.
#include "mailbox/all_protocols.hpp"
#include "mailbox/eoe_frames.hpp"
#include "real_osal.hpp"

#include <array>
#include <atomic>
#include <thread>

namespace margay {
namespace {

namespace all = all_protocols;

constexpr std::uint16_t kSlaves = 2;
constexpr std::uint32_t kVendor = 0x4D47;
constexpr int kRounds = 6;

class AllProtocols : public testing::Test {
  protected:
    RealOsal osal;
    sim::Segment segment;
    SimulatedNic nic{segment, osal};
    std::unique_ptr<HostContext> own = std::make_unique<HostContext>(Limits{.slaves = kSlaves});
    HostContext& ctx = *own;
    std::array<std::byte, 64> image{};
    std::array<std::array<std::byte, 4096>, kSlaves> mail{};
    std::array<VoeInbox, kSlaves> inboxes{VoeInbox{mail[0]}, VoeInbox{mail[1]}};
    std::array<EoePortMemory<4, 16>, kSlaves> frames{};
    std::array<EoePort, kSlaves> ports{EoePort{frames[0]}, EoePort{frames[1]}};
    std::atomic<unsigned> wrong{0};
    std::atomic<unsigned> good{0};

    void SetUp() override {
        for (std::uint32_t n = 0; n < kSlaves; ++n) {
            (void)segment.add(all::make().assemble());
            ASSERT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        }
        segment.power_up(osal.now());
        ASSERT_TRUE(init(ctx, nic, osal));
        ASSERT_TRUE(config_init(ctx));
        for (std::uint16_t n = 1; n <= kSlaves; ++n) {
            ASSERT_EQ(ctx.slave(n).error.code, Errc::none);
            VoeInbox& inbox = inboxes[n - 1U];
            inbox.only_slave = n;
            inbox.vendor_id = kVendor;
            inbox.vendor_type = n;
            inbox.look_every = 1ms;
            ASSERT_TRUE(listen(ctx, inbox));
            ports[n - 1U].slave = n;
            ASSERT_TRUE(submit(ctx, ports[n - 1U]));
            ASSERT_TRUE(AOEset_net_id(ctx, n, all::kAoeTarget.net_id));
        }
        ASSERT_TRUE(config_map(ctx, image));
        for (int n = 0; n < 3; ++n) (void)exchange();
        ASSERT_TRUE(writestate(ctx, 0, AlState::op));
        for (int n = 0; n < 2'000 && reached() != AlState::op; ++n) (void)exchange();
        ASSERT_EQ(reached(), AlState::op);
    }
    AlState reached() { return readstate(ctx)->state; }

    // Executes a cycle without a pause. Returns whether both slaves have taken part.
    bool exchange() {
        if (!send_processdata(ctx)) return false;
        const auto wkc = receive_processdata(ctx, 10s);
        (void)poll(ctx, osal.now());
        return wkc.ok() && *wkc == ctx.group(0).expected_wkc;
    }
    // The owner executes cycles until all `work` has ended. The inputs repeat the outputs of an earlier cycle.
    void cycle_beside(const std::vector<std::function<void()>>& work) {
        std::atomic<std::size_t> left = work.size();
        std::vector<std::thread> threads;
        for (const auto& one : work)
            threads.emplace_back([&left, &one] {
                one();
                --left;
            });
        unsigned cycles = 0;
        unsigned not_right = 0;
        for (; left != 0 || cycles < 10; ++cycles) {
            for (std::uint16_t n = 1; n <= kSlaves; ++n)
                store_le<std::uint16_t>(ctx.slave(n).image.outputs.bytes, 0, static_cast<std::uint16_t>(0x1100 + n));
            not_right += exchange() ? 0 : 1;
            for (std::uint16_t n = 1; cycles > 5 && n <= kSlaves; ++n)
                not_right += load_le<std::uint16_t>(ctx.slave(n).image.inputs.bytes) == 0x1100 + n ? 0 : 1;
        }
        for (auto& thread : threads) thread.join();
        EXPECT_EQ(not_right, 0U) << "of " << cycles << " cycles";
        EXPECT_EQ(reached(), AlState::op);
    }
    void expect(bool right) { ++(right ? good : wrong); }

    // Octets that are different in each round.
    static std::vector<std::byte> content(std::size_t bytes, int round) {
        auto octets = pattern(bytes + static_cast<std::size_t>(round));
        octets.erase(octets.begin(), octets.begin() + round);
        return octets;
    }

    void by_coe(std::uint16_t slave) {
        std::array<std::byte, all::kObjectBytes> back{};
        for (int n = 0; n < kRounds; ++n) {
            const auto value = content(all::kObjectBytes, n);
            expect(SDOwrite(ctx, slave, all::kObject, 0, false, Bytes(value)).ok());
            const auto read = SDOread(ctx, slave, all::kObject, 0, false, back);
            expect(read.ok() && *read == value.size() && std::ranges::equal(back, value));
        }
    }
    void by_foe(std::uint16_t slave) {
        std::array<std::byte, all::kFileBytes> back{};
        for (int n = 0; n < kRounds; ++n) {
            const auto file = content(500 + 97U * static_cast<unsigned>(n), n);
            expect(FOEwrite(ctx, slave, "file", 0, Bytes(file)).ok());
            const auto read = FOEread(ctx, slave, "file", 0, MutableBytes(back));
            expect(read.ok() && std::ranges::equal(Bytes(back).first(*read), file));
        }
    }
    void by_soe(std::uint16_t slave) {
        for (std::uint32_t n = 0; n < kRounds * 4; ++n) {
            expect(SoEwrite(ctx, slave, 0, all::kIdn, n * 0x01010101U).ok());
            const auto read = SoEread<std::uint32_t>(ctx, slave, 0, all::kIdn);
            expect(read.ok() && *read == n * 0x01010101U);
        }
    }
    // Each of several threads has its own octet range.
    void by_aoe(std::uint16_t slave, std::uint32_t at) {
        std::array<std::byte, 16> back{};
        for (int n = 0; n < kRounds * 4; ++n) {
            const auto value = content(back.size(), n);
            expect(AOEwrite(ctx, slave, all::kAoeTarget, 1, at, Bytes(value)).ok());
            const auto read = AOEread(ctx, slave, all::kAoeTarget, 1, at, back);
            expect(read.ok() && std::ranges::equal(back, value));
        }
    }
    void by_voe(std::uint16_t slave) {
        std::array<std::byte, 64> back{};
        for (int n = 0; n < kRounds * 4; ++n) {
            const auto message = content(40, n);
            expect(VOEsend(ctx, slave, {kVendor, slave}, message).ok());
            const auto echo = VOEreceive(ctx, inboxes[slave - 1U], back, 30s);
            expect(echo.ok() && echo->slave == slave && std::ranges::equal(Bytes(back).first(echo->bytes), message));
        }
    }
    void by_eoe(std::uint16_t slave) {
        EoePort& port = ports[slave - 1U];
        std::array<std::byte, kEoeFrameBytes> back{};
        for (unsigned n = 0; n < kRounds * 2; ++n) {
            const auto frame = ethernet_frame(60 + 61 * (n % 24), n);
            expect(port.send(frame));
            std::optional<EoeFrame> echo;
            while (!(echo = port.receive(back)) && port.busy()) std::this_thread::yield();
            expect(echo && std::ranges::equal(Bytes(back).first(echo->bytes), frame));
        }
    }
    // Requests of all protocols that are ended at any moment. None of them changes the data that the other threads
    // compare.
    void cancelled(std::uint16_t slave, unsigned seed) {
        std::array<std::byte, all::kFileBytes> memory{};
        std::array<std::byte, 16> small{};
        for (unsigned n = 0; n < 30; ++n) {
            const auto end = [&](Request& request) {
                for (std::atomic<unsigned> k = (n * 7919 + seed) % 3000; k > 0;) --k;
                request.cancel();
                while (request.busy()) std::this_thread::yield();
            };
            SdoUpload upload;
            upload.slave = slave;
            upload.index = all::kObject;
            upload.data = memory;
            expect(submit(ctx, upload).ok());
            end(upload);
            FoeRead file;
            file.slave = slave;
            file.name = "file";
            file.data = memory;
            expect(submit(ctx, file).ok());
            end(file);
            AoeRead read;
            read.slave = slave;
            read.target = all::kAoeTarget;
            read.index_group = 1;
            read.data = small;
            expect(submit(ctx, read).ok());
            end(read);
            SoeRead number;
            number.slave = slave;
            number.idn = all::kIdn;
            number.data = small;
            expect(submit(ctx, number).ok());
            end(number);
            VoeSend message;
            message.slave = slave;
            message.header = {kVendor, 0x7777};
            message.data = Bytes(small);
            expect(submit(ctx, message).ok());
            end(message);
            EoeGetIp ip;
            ip.slave = slave;
            expect(submit(ctx, ip).ok());
            end(ip);
        }
    }
    std::vector<std::function<void()>> everything() {
        std::vector<std::function<void()>> work;
        for (std::uint16_t n = 1; n <= kSlaves; ++n) {
            work.emplace_back([this, n] { by_coe(n); });
            work.emplace_back([this, n] { by_foe(n); });
            work.emplace_back([this, n] { by_soe(n); });
            work.emplace_back([this, n] { by_aoe(n, 0); });
            work.emplace_back([this, n] { by_aoe(n, 16); });
            work.emplace_back([this, n] { by_voe(n); });
            work.emplace_back([this, n] { by_eoe(n); });
        }
        return work;
    }
    static constexpr unsigned kAnswers = kSlaves * (2 * kRounds * 2 + 4 * 4 * kRounds * 2 + 2 * kRounds * 2);
};

TEST_F(AllProtocols, EachThreadGetsItsOwnAnswersBesideTheCycle) {
    cycle_beside(everything());
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(good, kAnswers);
    for (const auto& inbox : inboxes) EXPECT_EQ(inbox.lost(), 0U);
    for (const auto& port : ports) {
        EXPECT_EQ(port.statistics().sent, 2U * kRounds);
        EXPECT_EQ(port.statistics().received, 2U * kRounds);
    }
}

TEST_F(AllProtocols, CancelledRequestsOfOtherThreadsHarmNone) {
    auto work = everything();
    for (std::uint16_t n = 1; n <= kSlaves; ++n) {
        work.emplace_back([this, n] { cancelled(n, n); });
        work.emplace_back([this, n] { cancelled(n, 1000U + n); });
    }
    cycle_beside(work);
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(good, kAnswers + kSlaves * 2U * 30U * 6U);
}

}  // namespace
}  // namespace margay
