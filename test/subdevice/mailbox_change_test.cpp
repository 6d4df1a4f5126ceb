// A master that moves or resizes the mailboxes while the device uses them: between two steps, and between any two
// accesses of one step.
#include "bench_device.hpp"

#include <functional>

namespace margay::subdevice {
namespace {

using namespace testing;

constexpr std::uint16_t kMailbox = static_cast<std::uint16_t>(AlStatusCode::invalid_mailbox_configuration);
constexpr std::uint16_t kBootMailbox = static_cast<std::uint16_t>(AlStatusCode::invalid_boot_mailbox_configuration);

// Rewrites both SyncManagers as a master does: off, the new setting, on.
void resize_mailboxes(PlainEsc& esc, std::uint16_t bytes) {
    esc.configure(0, {0x1000, bytes, 0x26, 0});
    esc.configure(1, {0x1100, bytes, 0x22, 0});
    esc.configure(0, {0x1000, bytes, 0x26, 1});
    esc.configure(1, {0x1100, bytes, 0x22, 1});
}

TEST(MailboxChange, AnotherAllowedSizeNeedsInit) {
    for (const std::uint16_t bytes : {std::uint16_t{64}, std::uint16_t{200}}) {
        Bench bench;
        resize_mailboxes(bench.esc, bytes);
        (void)bench.step();
        EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::init, true, kMailbox})) << bytes;
        EXPECT_FALSE(bench.mailbox->running());
        bench.configure(bytes);
        EXPECT_EQ(bench.request(0x12), (AlStatus{AlState::preop, false, 0}));
        EXPECT_EQ(upload(bench, 0x1000).number(), 0x191u) << bytes;
    }
}

TEST(MailboxChange, AnotherAllowedSizeInBootNeedsInit) {
    Bench bench;
    bench.application.description_value.boot_mailbox = table::kDevice.mailbox;
    (void)bench.request(1);
    bench.configure(128);
    ASSERT_EQ(bench.request(3), (AlStatus{AlState::boot, false, 0}));
    resize_mailboxes(bench.esc, 200);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::init, true, kBootMailbox}));
}

TEST(MailboxChange, TheSameSettingAgainIsNoChange) {
    Bench bench;
    resize_mailboxes(bench.esc, 128);
    (void)bench.step();
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::preop, false, 0}));
    EXPECT_EQ(upload(bench, 0x1000).number(), 0x191u);
}

TEST(MailboxChange, EventsThatAreSwitchedOffArePolled) {
    Bench bench;
    EXPECT_EQ(bench.step(), kNever);
    bench.esc.configure(0, {0x1000, 128, 0x06, 1});
    bench.esc.configure(1, {0x1100, 128, 0x02, 1});
    EXPECT_EQ(bench.step(), bench.esc.time + 1ms);
}

// The master acts before one access of the device.
class Meddled final : public EscAccess {
  public:
    explicit Meddled(PlainEsc& esc) : esc_(esc) {}
    void read(std::uint16_t address, MutableBytes into) noexcept override {
        point();
        esc_.read(address, into);
    }
    void write(std::uint16_t address, Bytes data) noexcept override {
        point();
        esc_.write(address, data);
    }
    [[nodiscard]] Time now() noexcept override { return esc_.now(); }

    static constexpr unsigned kEndless = 5000;
    std::function<void()> act;
    std::function<void()> end;  // ends a loop that has no other end
    unsigned strike = 0;
    unsigned accesses = 0;

  private:
    void point() {
        if (++accesses == strike && act) act();
        if (accesses == kEndless) end();
    }
    PlainEsc& esc_;
};

// A device with guard octets behind its mailbox memory, which must not change.
struct MeddledDevice {
    PlainEsc esc;
    Meddled access{esc};
    BenchApplication application;
    std::array<std::byte, Values::bytes> image{};
    ObjectDictionary dictionary{table::kObjects, image, &application};
    std::array<std::byte, 512> staging{};
    CoeServer coe{dictionary, staging, true, application.emergencies()};
    std::array<std::byte, 256 * 4> memory{};  // one slot for messages of the master, two for replies, one guard
    MailboxProtocol protocols[1] = {{wire::MailboxType::coe, &coe}};
    Mailbox mailbox{access, MutableBytes(memory).first(256), MutableBytes(memory).subspan(256, 512), protocols};
    ProcessDataMemory<16, 16, 8> process_memory;
    ProcessData process_data{access, application, dictionary, process_memory};
    Device device{access, application, process_data, &mailbox};
    MailHand hand{esc};

    MeddledDevice() {
        device.start(esc.time);
        hand.configure(128);
        step();  // the device has seen this change
        access.end = [this] { resize_mailboxes(esc, 128); };
    }
    void step() {
        esc.time += 1ms;
        (void)device.step(esc.time);
    }
    [[nodiscard]] bool guard_is_whole() const {
        return std::all_of(memory.begin() + 768, memory.end(), [](std::byte b) { return b == std::byte{}; });
    }
};

// Sets `bytes` in SM0 and SM1, and writes a message that fills SM0, before each access of the step that enters PREOP.
void meddle_at_start(std::uint16_t bytes) {
    unsigned strike = 0;
    for (;;) {
        ++strike;
        MeddledDevice device;
        device.access.act = [&] {
            auto& esc = device.esc;
            esc.configure(0, {0x1000, 128, 0x26, 0});
            esc.configure(1, {0x3000, 128, 0x22, 0});
            esc.configure(0, {0x1000, bytes, 0x26, 1});
            esc.configure(1, {0x3000, bytes, 0x22, 1});
            std::vector<std::byte> mail(bytes, std::byte{0xEE});
            wire::store_mailbox_header(
                mail, {.length = static_cast<std::uint16_t>(bytes - 6), .type = wire::MailboxType::coe, .counter = 1});
            (void)esc.ecat_write(0x1000, mail);
        };
        device.esc.al_control(2);
        device.access.accesses = 0;
        device.access.strike = strike;
        device.step();
        if (device.access.accesses < strike) break;  // the step has fewer accesses
        ASSERT_LT(device.access.accesses, Meddled::kEndless) << "step() has no end, change before access " << strike;
        device.access.act = nullptr;
        device.access.accesses = 0;
        for (int n = 0; n < 4; ++n) device.step();
        EXPECT_LT(device.access.accesses, Meddled::kEndless) << "step() has no end, change before access " << strike;
        EXPECT_TRUE(device.guard_is_whole()) << "octets behind the memory, change before access " << strike;
        EXPECT_EQ(device.esc.al_status().state, AlState::init) << "change before access " << strike;
        EXPECT_TRUE(device.esc.al_status().error) << "change before access " << strike;
    }
    EXPECT_GT(strike, 13U);
}

TEST(MailboxChange, AtAnyAccessOfTheStartTheMemoryIsSafe) { meddle_at_start(3000); }
TEST(MailboxChange, AtAnyAccessOfTheStartAShortMailboxIsRefused) { meddle_at_start(8); }

// The same in PREOP, while the device reads a message.
TEST(MailboxChange, AtAnyAccessOfAStepAnotherSizeHasAnEnd) {
    unsigned strike = 0;
    for (;;) {
        ++strike;
        MeddledDevice device;
        device.esc.al_control(2);
        device.step();
        ASSERT_EQ(device.esc.al_status(), (AlStatus{AlState::preop, false, 0}));
        ASSERT_TRUE(device.hand.put(device.hand.message(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0), 1)));
        device.access.act = [&] {
            resize_mailboxes(device.esc, 200);
            device.hand.configure(200);
            (void)device.hand.put(device.hand.message(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0), 2));
        };
        device.access.accesses = 0;
        device.access.strike = strike;
        device.step();
        if (device.access.accesses < strike) break;  // the step has fewer accesses
        ASSERT_LT(device.access.accesses, Meddled::kEndless) << "step() has no end, change before access " << strike;
        for (int n = 0; n < 4; ++n) device.step();
        EXPECT_EQ(device.esc.al_status(), (AlStatus{AlState::init, true, kMailbox})) << strike;
        EXPECT_TRUE(device.guard_is_whole()) << strike;
    }
    EXPECT_GT(strike, 6U);
}

}  // namespace
}  // namespace margay::subdevice
