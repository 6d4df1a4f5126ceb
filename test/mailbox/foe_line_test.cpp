// File transfers over a line that loses frames, to many slaves at the same time, beside a cycle, and in a recording
// that tshark decodes.
#include "mailbox/foe_bus.hpp"
#include "oshw/filters/drop_nic.hpp"
#include "oshw/filters/duplicate_nic.hpp"
#include "wire/mailbox_pcap.hpp"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <memory>

namespace margay {
namespace {

using sim::Bootloader;
constexpr std::uint32_t kOpen = Bootloader::kOpenProduct;

// A line of slaves in BOOT with open bootloaders.
class OpenLine {
  public:
    explicit OpenLine(std::size_t slaves, const DropNic::Options& drops = {})
        : cable_(segment, osal), drop(cable_, drops), ctx({.slaves = static_cast<std::uint16_t>(slaves)}) {
        for (std::size_t n = 0; n < slaves; ++n) {
            const auto number = segment.add(sim::make_device("bootloader_open").value().assemble());
            EXPECT_TRUE(n == 0 ? segment.connect_master({number, 0}) : segment.connect({number - 1, 1}, {number, 0}));
        }
        segment.power_up(osal.now());
        EXPECT_TRUE(init(ctx, drop, osal).ok());
        const auto found = config_init(ctx);
        EXPECT_TRUE(found.ok()) << MailboxBus::words(found.error());
        for (const Slave& slave : ctx.slaves()) {
            const auto boot = set_target(ctx, slave.number, AlState::boot);
            EXPECT_TRUE(boot.ok()) << MailboxBus::words(boot.error());
        }
    }
    // Writes the image to all slaves at the same time. Returns the round trips.
    std::uint64_t flash(const std::vector<std::byte>& image) {
        const std::uint64_t before = ctx.statistics().bursts;
        std::vector<std::unique_ptr<FoeWrite>> writes;
        for (const Slave& slave : ctx.slaves()) {
            auto& write = *writes.emplace_back(std::make_unique<FoeWrite>());
            write.slave = slave.number;
            write.name = "firmware";
            write.data = image;
            EXPECT_TRUE(submit(ctx, write).ok());
        }
        const auto busy = [&] { return std::ranges::any_of(writes, [](const auto& w) { return w->busy(); }); };
        while (busy()) {
            const Time next = poll(ctx, osal.now());
            if (busy()) osal.wait(next, -1);
        }
        for (const auto& write : writes)
            EXPECT_EQ(write->state(), RequestState::success) << MailboxBus::words(write->error());
        return ctx.statistics().bursts - before;
    }

    VirtualOsal osal;
    sim::Segment segment;

  private:
    SimulatedNic cable_;

  public:
    DropNic drop;
    HostContext ctx;
};

TEST(FoeOverABadLine, TwoMebibytesArriveIdentical) {
    OpenLine line(1, {.seed = 3, .sent = Rate{5000}, .received = Rate{5000}});
    const auto image = Bootloader::make_image(2, 1, 2 * 1024 * 1024, kOpen);
    (void)line.flash(image);
    std::vector<std::byte> back(image.size());
    const auto read = FOEread(line.ctx, 1, "firmware", 0, std::span(back));
    ASSERT_TRUE(read.ok()) << MailboxBus::words(read.error());
    EXPECT_EQ(*read, image.size());
    EXPECT_TRUE(back == image);
    EXPECT_GT(line.drop.dropped(), 50U);
}

TEST(FoeOfManySlaves, TwentyAtOnceTakeTheRoundTripsOfOne) {
    const auto image = Bootloader::make_image(2, 1, 100'000, kOpen);
    OpenLine one(1);
    OpenLine twenty(20);
    const std::uint64_t of_one = one.flash(image);
    const std::uint64_t of_twenty = twenty.flash(image);
    EXPECT_GT(of_one, 200U);
    EXPECT_LE(of_twenty * 10, of_one * 13) << of_one << " and " << of_twenty;
}

// A read begins and ends beside the process data of another slave. No cycle has an error.
TEST(FoeBesideTheCycle, EveryCycleHasItsInputs) {
    MailboxBus bus;
    bus.add_device(sim::make_device("digital_in_16").value());
    bus.add_device(sim::make_device("bootloader").value());
    bus.start();
    std::array<std::byte, 16> image{};
    ASSERT_EQ(bring(bus, AlState::boot, 2).code, Errc::none);
    bus.ctx->slave(2).config.optional = true;
    ASSERT_TRUE(set_target(*bus.ctx, 2, AlState::boot).ok());
    (void)config_map(*bus.ctx, image);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    const auto op = reach(*bus.ctx, AlState::op, 5s);
    ASSERT_TRUE(op.ok()) << bus.words(op.error());
    const auto firmware = Bootloader::make_image(2, 1, 20'000);
    FoeWrite write;
    write.slave = 2;
    write.name = "firmware";
    write.password = Bootloader::kPassword;
    write.data = firmware;
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    unsigned cycles = 0;
    unsigned wrong = 0;
    (void)run_cycle(*bus.ctx, {}, [&](const CycleInfo& cycle) {
        ++cycles;
        wrong += cycle.error.code == Errc::none && inputs_fresh(*bus.ctx, 1) ? 0 : 1;
        return write.busy();
    });
    EXPECT_EQ(write.error().code, Errc::none) << bus.words(write.error());
    EXPECT_GT(cycles, 50U);
    EXPECT_EQ(wrong, 0U);
}

// ------------------------------------------------------------------ tshark

// Writes the mailbox messages of all frames to a file.
class MailTap final : public Nic {
  public:
    MailTap(Nic& nic, const std::string& path) : nic_(nic), file_(path) {}
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        keep(frame, wire::Command::FPWR, 0);
        return nic_.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        const std::size_t length = nic_.receive(into);
        if (length != 0) keep(into.first(length), wire::Command::FPRD, 1);
        return length;
    }
    LinkState link_state() noexcept override { return nic_.link_state(); }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }

  private:
    void keep(Bytes frame, wire::Command command, std::uint16_t wkc) {
        wire::DatagramReader reader(frame);
        while (const auto datagram = reader.next()) {
            const bool mail = datagram->header.command == command && datagram->wkc == wkc &&
                              datagram->header.address.ado() >= 0x1000 && datagram->data.size() > 64;
            if (!mail) continue;
            const auto header = wire::load_mailbox_header(datagram->data);
            const std::size_t bytes = wire::kMailboxHeaderBytes + header.length;
            if (header.type != wire::MailboxType::foe || bytes > datagram->data.size()) continue;
            const Bytes whole = Bytes(datagram->data).first(bytes);
            file_.add({whole.begin(), whole.end()});
        }
    }
    Nic& nic_;
    testing_tshark::MailboxPcap file_;
};

TEST(FoeTshark, DecodesEveryMessageOfBothEnds) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    const auto path = std::filesystem::temp_directory_path() / ("margay-foe-" + std::to_string(::getpid()) + ".pcap");
    {
        VirtualOsal osal;
        sim::Segment segment;
        (void)segment.add(sim::make_device("bootloader").value().assemble());
        ASSERT_TRUE(segment.connect_master({0, 0}));
        segment.power_up(osal.now());
        SimulatedNic cable(segment, osal);
        MailTap tap(cable, path.string());
        HostContext ctx({.slaves = 1});
        ASSERT_TRUE(init(ctx, tap, osal).ok());
        ASSERT_TRUE(config_init(ctx).ok());
        ASSERT_TRUE(set_target(ctx, 1, AlState::boot).ok());
        const auto image = Bootloader::make_image(2, 1, 8 * 500 - 16);  // whole packets: the last one is empty
        const std::span<const std::byte> content(image);
        EXPECT_EQ(FOEwrite(ctx, 1, "firmware", 1, content).error().code, Errc::foe_error);
        EXPECT_TRUE(FOEwrite(ctx, 1, "firmware", Bootloader::kPassword, content).ok());
        std::vector<std::byte> back(image.size());
        EXPECT_TRUE(FOEread(ctx, 1, "firmware", Bootloader::kPassword, std::span(back)).ok());
        EXPECT_EQ(FOEread(ctx, 1, "firmware", Bootloader::kPassword, std::span(back).first(600)).error().code,
                  Errc::capacity);  // the client ends this transfer with an error message
        const Time end = osal.now() + 20ms;
        while (osal.now() < end) osal.wait(std::min(poll(ctx, osal.now()), osal.now() + 1ms), -1);
    }
    const auto packets = testing_tshark::fields_of(
        path.string(), {"frame.number", "_ws.malformed", "_ws.expert", "ecat_mailbox.foe_opmode",
                        "ecat_mailbox.foe_packetno", "ecat_mailbox.foe_errcode", "ecat_mailbox.foe_filename"});
    std::array<unsigned, 7> by_opcode{};
    std::set<std::string> names;
    std::set<std::string> errors;
    for (const auto& columns : packets) {
        ASSERT_EQ(columns.size(), 7U);
        EXPECT_EQ(columns[1], "") << "malformed: packet " << columns[0];
        EXPECT_EQ(columns[2], "") << "expert information: packet " << columns[0];
        const unsigned long opcode = std::stoul(columns[3], nullptr, 0);
        ASSERT_LT(opcode, by_opcode.size());
        ++by_opcode[opcode];
        if (!columns[5].empty()) errors.insert(columns[5]);
        if (!columns[6].empty()) names.insert(columns[6]);
    }
    EXPECT_EQ(by_opcode[1], 2U);  // read requests
    EXPECT_EQ(by_opcode[2], 2U);  // write requests
    EXPECT_GT(by_opcode[3], 15U);
    EXPECT_GT(by_opcode[4], 15U);
    EXPECT_EQ(by_opcode[5], 2U);  // an error of the server, and an error of the client
    EXPECT_GT(by_opcode[6], 5U);
    EXPECT_EQ(errors.size(), 2U);
    if (!names.empty()) {
        EXPECT_EQ(*names.begin(), "firmware");
    }
    std::error_code ignored;
    if (!HasFailure()) std::filesystem::remove(path, ignored);
}

}  // namespace
}  // namespace margay
