// Each mailbox protocol beside a cycle of a millisecond. In each cycle the working counter has the expected value, and
// the inputs are the outputs of the previous cycle.
#include "mailbox/all_protocols.hpp"
#include "mailbox/foe_bus.hpp"

namespace margay {
namespace {

namespace all = all_protocols;

// Slave 1 has every protocol and is in OP; slave 2 is in BOOT.
class MailBesideTheCycle : public testing::Test {
  protected:
    MailboxBus bus;
    std::array<std::byte, 64> image{};
    std::uint16_t written = 0;
    bool in_op = false;

    void SetUp() override {
        bus.add_device(all::make());
        bus.add_device(sim::make_device("bootloader_open").value());
        bus.start();
        ASSERT_TRUE(AOEset_net_id(*bus.ctx, 1, all::kAoeTarget.net_id).ok());
        ASSERT_EQ(bring(bus, AlState::boot, 2).code, Errc::none);
        bus.ctx->slave(2).config.optional = true;
        (void)config_map(*bus.ctx, image);
        for (int n = 0; n < 5; ++n) cycle();
        ASSERT_TRUE(writestate(*bus.ctx, 1, AlState::op).ok());
        for (int n = 0; n < 200; ++n) cycle();
        ASSERT_EQ(statecheck(*bus.ctx, 1, AlState::op, 0ms)->state, AlState::op);
        in_op = true;
    }
    void cycle() {
        bus.osal.advance(1ms);
        bus.segment.advance(bus.osal.now());
        store_le(bus.ctx->slave(1).image.outputs.bytes, 0, ++written);
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        const auto wkc = receive_processdata(*bus.ctx, 500us);
        ASSERT_TRUE(wkc.ok()) << bus.words(wkc.error());
        ASSERT_EQ(*wkc, bus.ctx->group(0).expected_wkc);
        if (in_op) {
            ASSERT_EQ(load_le<std::uint16_t>(bus.ctx->slave(1).image.inputs.bytes), written - 1);
        }
        (void)poll(*bus.ctx, bus.osal.now());
    }
    // Submits the request repeatedly. Calls `right` after each success.
    void repeat(Request& request, const std::function<bool()>& right) {
        unsigned answers = 0;
        for (int n = 0; n < 1000 || request.busy(); ++n) {
            if (!request.busy() && n != 0) {
                ASSERT_EQ(request.state(), RequestState::success) << bus.words(request.error());
                ASSERT_TRUE(right());
                ++answers;
            }
            if (!request.busy()) {
                const auto begun = submit(*bus.ctx, request);
                ASSERT_TRUE(begun.ok()) << bus.words(begun.error());
            }
            cycle();
            if (HasFatalFailure()) return;
            ASSERT_LT(n, 20'000);
        }
        EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
        EXPECT_GE(answers, 4U);
        EXPECT_EQ(statecheck(*bus.ctx, 1, AlState::op, 0ms)->state, AlState::op);
    }
};

TEST_F(MailBesideTheCycle, Coe) {
    const auto value = pattern(all::kObjectBytes);
    std::vector<std::byte> back(value.size());
    SdoDownload write;
    write.slave = 1;
    write.index = all::kObject;
    write.data = Bytes(value);
    repeat(write, [] { return true; });
    SdoUpload read;
    read.slave = 1;
    read.index = all::kObject;
    read.data = back;
    repeat(read, [&] { return back == value; });
}

TEST_F(MailBesideTheCycle, Foe) {
    const auto file = pattern(3000);
    std::vector<std::byte> back(all::kFileBytes);
    FoeWrite write;
    write.slave = 1;
    write.name = "file";
    write.data = Bytes(file);
    repeat(write, [] { return true; });
    FoeRead read;
    read.slave = 1;
    read.name = "file";
    read.data = back;
    repeat(read, [&] { return std::ranges::equal(Bytes(back).first(read.bytes()), file); });
}

TEST_F(MailBesideTheCycle, FirmwareOfAnotherSlave) {
    const auto file = sim::Bootloader::make_image(2, 1, 5000, sim::Bootloader::kOpenProduct);
    FoeWrite write;
    write.slave = 2;
    write.name = "firmware";
    write.data = Bytes(file);
    repeat(write, [] { return true; });
}

TEST_F(MailBesideTheCycle, Soe) {
    std::array<std::byte, 4> number{std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}};
    std::array<std::byte, 4> back{};
    SoeWrite write;
    write.slave = 1;
    write.idn = all::kIdn;
    write.data = Bytes(number);
    repeat(write, [] { return true; });
    SoeRead read;
    read.slave = 1;
    read.idn = all::kIdn;
    read.data = back;
    repeat(read, [&] { return back == number; });
}

TEST_F(MailBesideTheCycle, Aoe) {
    const auto value = pattern(16);
    std::vector<std::byte> back(value.size());
    AoeWrite write;
    write.slave = 1;
    write.target = all::kAoeTarget;
    write.index_group = 1;
    write.data = Bytes(value);
    repeat(write, [] { return true; });
    AoeRead read;
    read.slave = 1;
    read.target = all::kAoeTarget;
    read.index_group = 1;
    read.data = back;
    repeat(read, [&] { return back == value; });
}

TEST_F(MailBesideTheCycle, Voe) {
    std::array<std::byte, 4096> memory{};
    VoeInbox inbox(memory);
    inbox.only_slave = 1;
    inbox.look_every = 1ms;
    ASSERT_TRUE(listen(*bus.ctx, inbox).ok());
    const auto message = pattern(40);
    std::array<std::byte, 64> back{};
    unsigned sent = 0;
    unsigned echoes = 0;
    bool same = true;
    const auto take = [&] {
        while (const auto echo = inbox.take(back)) {
            ++echoes;
            same &= std::ranges::equal(Bytes(back).first(echo->bytes), message);
        }
    };
    VoeSend send;
    send.slave = 1;
    send.header = {0x4D47, 1};
    send.data = Bytes(message);
    repeat(send, [&] {
        ++sent;
        take();
        return same;
    });
    for (int n = 0; n < 50; ++n) cycle();
    take();
    EXPECT_TRUE(same);
    EXPECT_EQ(echoes, sent + 1);  // the loop did not check the last echo
    EXPECT_EQ(inbox.lost(), 0U);
}

TEST_F(MailBesideTheCycle, EoeParameters) {
    EoeSetIp set;
    set.slave = 1;
    set.ip.address = Ipv4Address{10, 0, 0, 7};
    repeat(set, [] { return true; });
    EoeGetIp get;
    get.slave = 1;
    repeat(get, [&] { return get.ip.address == Ipv4Address{10, 0, 0, 7}; });
}

}  // namespace
}  // namespace margay
