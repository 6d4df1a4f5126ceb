// A cable breaks or heals at any frame of a scan, of the way to OP, and of a mail transfer.
#include "redundancy/ring_bus.hpp"

namespace margay {
namespace {

struct Walk : testing::Test {
    std::unique_ptr<RingBus> bus;

    void build() {
        bus = std::make_unique<RingBus>();
        bus->build_tree();
        bus->plug();
    }
    // Scans again while the ring changes. A failed scan names the reason and is repeated.
    unsigned scans_until_right() {
        for (unsigned tries = 1; tries <= 3; ++tries) {
            const auto found = config_init(*bus->ctx);
            const bool errors = bus->ctx->errors().take().has_value();
            if (found.ok() && *found == bus->segment.size() && !errors) return tries;
            while (bus->ctx->errors().take()) {
            }
        }
        return 4;
    }
};

// Every frame of the scan, with every third cable.
TEST_F(Walk, TheRingChangesAtAnyFrameOfAScan) {
    build();
    bus->start();
    const std::uint64_t frames = bus->frames;
    ASSERT_GT(frames, 50U);
    unsigned repeated = 0;
    unsigned scans = 0;
    const auto change = [&](std::uint64_t at, std::size_t which, bool intact) {
        SCOPED_TRACE("frame " + std::to_string(at) + ", ring cable " + std::to_string(which) +
                     (intact ? " heals" : " breaks"));
        build();
        bus->cable(bus->ring_cables[which], !intact);
        bus->on_frame = [&](std::uint64_t frame) {
            if (frame == at) bus->cable(bus->ring_cables[which], intact);
        };
        ASSERT_TRUE(bus->begin().ok());
        const unsigned tries = scans_until_right();
        EXPECT_LE(tries, 2U);
        repeated += tries - 1;
        ++scans;
        for (std::size_t s = 1; s <= bus->ctx->slaves().size(); ++s) EXPECT_EQ(bus->ctx->slave(s).ring_position, s);
    };
    for (std::uint64_t at = 0; at < frames; ++at)
        for (std::size_t which = at % 3; which < 15; which += 3)
            for (const bool intact : {false, true}) change(at, which, intact);
    RecordProperty("scans", static_cast<int>(scans));
    RecordProperty("repeated", static_cast<int>(repeated));
    EXPECT_LE(repeated, scans / 4);  // most scans do not notice
}

TEST_F(Walk, TheRingChangesAtAnyFrameOfTheWayToOp) {
    build();
    bus->start();
    const std::uint64_t begin = bus->frames;
    bus->run();
    const std::uint64_t frames = bus->frames;
    for (const bool intact : {false, true})
        for (std::uint64_t at = begin; at < frames; ++at) {
            const std::size_t which = static_cast<std::size_t>(at * 11) % 15;
            SCOPED_TRACE("frame " + std::to_string(at) + ", ring cable " + std::to_string(which) +
                         (intact ? " heals" : " breaks"));
            build();
            bus->cable(bus->ring_cables[which], !intact);
            bus->start();
            bus->on_frame = [&](std::uint64_t frame) {
                if (frame == at) bus->cable(bus->ring_cables[which], intact);
            };
            bus->run();
            EXPECT_EQ(bus->stale_cycles(10), 0U);
            for (const Slave& slave : bus->ctx->slaves()) EXPECT_EQ(slave.error.code, Errc::none) << slave.number;
        }
}

// Mail to slaves at both ends while every cable of the ring breaks and heals, also with lost frames. Each read returns
// the value that was written.
TEST_F(Walk, MailWhileEveryCableBreaksAndHeals) {
    for (const double lost : {0.0, 0.05}) {
        bus = std::make_unique<RingBus>();
        std::vector<std::unique_ptr<StackSlave>> stacks;
        std::vector<StackSlave*> programs;
        const auto add = [&] {
            auto stack = std::make_unique<StackSlave>(std::uint16_t{128}, true);
            programs.push_back(stack.get());
            sim::Device device;
            device.chip = StackSlave::chip();
            device.sii = stack->sii();
            device.firmware = std::move(stack);
            (void)bus->add_to_ring(std::move(device));
        };
        for (unsigned n = 0; n < 5; ++n) (void)bus->add_to_ring();
        add();
        for (unsigned n = 0; n < 5; ++n) (void)bus->add_to_ring();
        add();
        bus->close_ring();
        bus->start();
        bus->run();
        bus->segment.set_noise({.lost = lost, .seed = 3});
        const std::vector<std::uint16_t> slaves{6, 12};
        for (std::size_t cable = 0; cable < bus->ring_cables.size(); ++cable)
            for (const bool intact : {false, true}) {
                SCOPED_TRACE("ring cable " + std::to_string(cable) + (intact ? " heals" : " breaks"));
                for (const std::uint16_t slave : slaves) {
                    std::vector<std::byte> value(900);
                    for (std::size_t n = 0; n < value.size(); ++n) value[n] = static_cast<std::byte>(n * 3 + cable);
                    std::vector<std::byte> back(2000);
                    SdoDownload write;
                    write.slave = slave;
                    write.index = 0x2008;
                    write.data = value;
                    const std::uint64_t at = bus->frames + 5 + cable;
                    bus->on_frame = [&](std::uint64_t frame) {
                        if (frame == at) bus->cable(bus->ring_cables[cable], intact);
                    };
                    ASSERT_TRUE(submit(*bus->ctx, write).ok());
                    for (unsigned n = 0; n < 4000 && write.busy(); ++n) (void)bus->cycle();
                    ASSERT_EQ(write.state(), RequestState::success) << bus->words(write.error());
                    SdoUpload read;
                    read.slave = slave;
                    read.index = 0x2008;
                    read.data = back;
                    ASSERT_TRUE(submit(*bus->ctx, read).ok());
                    for (unsigned n = 0; n < 4000 && read.busy(); ++n) (void)bus->cycle();
                    ASSERT_EQ(read.state(), RequestState::success) << bus->words(read.error());
                    ASSERT_EQ(read.bytes, value.size());
                    EXPECT_TRUE(std::equal(value.begin(), value.end(), back.begin()));
                }
            }
    }
}

// A cable breaks or heals at any frame of a mail transfer, also between both copies of a frame. No message is lost, so
// no transfer waits for an answer until its timeout.
TEST_F(Walk, TheRingChangesAtAnyFrameOfAMailTransfer) {
    bus = std::make_unique<RingBus>();
    const auto add = [&] {
        auto stack = std::make_unique<StackSlave>(std::uint16_t{128}, true);
        sim::Device device;
        device.chip = StackSlave::chip();
        device.sii = stack->sii();
        device.firmware = std::move(stack);
        (void)bus->add_to_ring(std::move(device));
    };
    for (const bool mail : {false, true, false, true, false}) mail ? add() : (void)bus->add_to_ring();
    bus->close_ring();
    bus->start();
    bus->run();
    const auto transfer = [&](SdoDownload& write, SdoUpload& read, std::size_t cable, bool intact) {
        std::vector<std::byte> value(300);
        for (std::size_t n = 0; n < value.size(); ++n) value[n] = static_cast<std::byte>(n * 3 + cable);
        std::vector<std::byte> back(value.size());
        write.index = read.index = 0x2008;
        write.data = value;
        read.data = back;
        unsigned cycles = 0;
        ASSERT_TRUE(submit(*bus->ctx, write).ok());
        for (; cycles < 4000 && write.busy(); ++cycles) (void)bus->cycle();
        ASSERT_EQ(write.state(), RequestState::success) << bus->words(write.error());
        ASSERT_TRUE(submit(*bus->ctx, read).ok());
        for (; cycles < 4000 && read.busy(); ++cycles) (void)bus->cycle();
        bus->cable(bus->ring_cables[cable], intact);
        ASSERT_EQ(read.state(), RequestState::success) << bus->words(read.error());
        EXPECT_EQ(back, value);
        EXPECT_LT(cycles, 300U);
    };
    for (std::size_t cable = 0; cable < bus->ring_cables.size(); ++cable)
        for (std::uint64_t frame = 0; frame < 60; ++frame)
            for (const bool intact : {false, true}) {
                SCOPED_TRACE("ring cable " + std::to_string(cable) + (intact ? " heals" : " breaks") + " at frame " +
                             std::to_string(frame));
                const std::uint64_t at = bus->frames + frame;
                bus->on_frame = [&, at](std::uint64_t now) {
                    if (now == at) bus->cable(bus->ring_cables[cable], intact);
                };
                SdoDownload write;
                SdoUpload read;
                write.slave = read.slave = frame % 2 == 0 ? 2 : 4;
                transfer(write, read, cable, intact);
                if (HasFatalFailure()) return;
            }
}

}  // namespace
}  // namespace margay
