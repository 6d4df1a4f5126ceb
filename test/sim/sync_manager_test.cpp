// SyncManagers. ETG.1000.4 section "Sync manager", table "Sync manager channel"; ET1100 data sheet I, "SyncManager".
#include "rig.hpp"

#include "wire/sync_manager.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;
namespace status = wire::sm_status;

constexpr unsigned kMailboxOut = 0x26;  // mailbox, the master writes, PDI interrupt
constexpr unsigned kMailboxIn = 0x22;
constexpr unsigned kOutputs = 0x64;
constexpr unsigned kInputs = 0x20;

struct SyncManagerTest : testing::Test {
    Rig rig;
    void SetUp() override {
        rig.add_with_processor(et1100());
        rig.on();
    }
    std::uint16_t set(unsigned n, unsigned start, unsigned length, unsigned control, unsigned activate = 1) {
        return rig
            .write(0, reg::sync_manager(n).address,
                   bytes({start & 0xFF, start >> 8, length & 0xFF, length >> 8, control, 0, activate, 0}))
            .wkc;
    }
    std::uint8_t state(unsigned n) { return rig.get<std::uint8_t>(0, static_cast<std::uint16_t>(0x0805 + 8 * n)); }
    std::uint16_t wkc_of_read(std::uint16_t address, std::size_t length) { return rig.read(0, address, length).wkc; }
    std::vector<std::byte> pdi_read(std::uint16_t address, std::size_t length) {
        std::vector<std::byte> data(length, std::byte{0xEE});
        rig.slave(0).read(address, data);
        return data;
    }
    void pdi_write(std::uint16_t address, std::vector<std::byte> data) { rig.slave(0).write(address, data); }
};

// --- One buffer with handshake ---

TEST_F(SyncManagerTest, MailboxIsEitherEmptyOrFull) {
    EXPECT_EQ(set(0, 0x1000, 4, kMailboxOut), 1);
    EXPECT_EQ(state(0), 0);
    EXPECT_EQ(wkc_of_read(0x1000, 4), 0) << "the master writes here, it does not read";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 0x11223344), 1);
    EXPECT_EQ(state(0), status::kMailboxFull | status::kInterruptWrite);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 0x55667788), 0) << "full";
    EXPECT_EQ(pdi_read(0x1000, 4), bytes({0x44, 0x33, 0x22, 0x11}));
    EXPECT_EQ(state(0), status::kInterruptRead) << "empty again";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 0x55667788), 1);
    EXPECT_EQ(state(0), status::kMailboxFull | status::kInterruptWrite);
}

TEST_F(SyncManagerTest, MailboxTowardsTheMaster) {
    EXPECT_EQ(set(1, 0x1100, 4, kMailboxIn), 1);
    EXPECT_EQ(wkc_of_read(0x1100, 4), 0) << "empty";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1100, 1), 0) << "not the master's to write";
    pdi_write(0x1100, bytes({1, 2, 3, 4}));
    EXPECT_EQ(state(1), status::kMailboxFull | status::kInterruptWrite);
    pdi_write(0x1100, bytes({9, 9, 9, 9}));
    const auto reply = rig.read(0, 0x1100, 4);
    EXPECT_EQ(reply.wkc, 1);
    EXPECT_EQ(reply.data, bytes({1, 2, 3, 4})) << "the second write was refused";
    EXPECT_EQ(wkc_of_read(0x1100, 4), 0);
}

// "Only the last byte triggers": an access to the first octet opens a buffer, an access to the last octet completes
// it, in any number of accesses. Recorded on a LAN9252 (samples/Fidelity.AMailboxInWritingShowsBit7 reads the
// recording): 0x02 when the master has read the last reply, 0x80 while the program writes the next reply, 0x09 when it
// is complete.
TEST_F(SyncManagerTest, AMailboxThatIsBeingWrittenShowsItsBufferInUse) {
    EXPECT_EQ(set(1, 0x1100, 4, kMailboxIn), 1);
    EXPECT_EQ(state(1), 0x00);
    pdi_write(0x1100, bytes({1, 2, 3, 4}));
    EXPECT_EQ(state(1), 0x09);
    EXPECT_EQ(wkc_of_read(0x1100, 4), 1);
    EXPECT_EQ(state(1), 0x02);
    pdi_write(0x1100, bytes({5, 6}));
    EXPECT_EQ(state(1), 0x80);
    pdi_write(0x1102, bytes({7, 8}));
    EXPECT_EQ(state(1), 0x09);
}

TEST_F(SyncManagerTest, ABufferedOneThatIsOffHasNoBufferWritten) {
    EXPECT_EQ(state(1), 0x30) << "at power-up";
    EXPECT_EQ(set(1, 0x1100, 4, kInputs), 1);
    pdi_write(0x1100, bytes({1, 2, 3, 4}));
    EXPECT_NE(state(1) & 0x30, 0x30);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x080E, 0), 1);
    EXPECT_EQ(state(1), 0x30);
}

TEST_F(SyncManagerTest, PartialAccessesHandOverWithTheLastOctet) {
    EXPECT_EQ(set(0, 0x1000, 8, kMailboxOut), 1);
    EXPECT_EQ(rig.write(0, 0x1004, bytes({5, 6, 7, 8})).wkc, 0) << "not opened yet";
    EXPECT_EQ(rig.write(0, 0x1000, bytes({1, 2, 3, 4})).wkc, 1);
    EXPECT_EQ(state(0) & status::kMailboxFull, 0);
    EXPECT_EQ(rig.write(0, 0x1004, bytes({5, 6})).wkc, 1);
    EXPECT_EQ(state(0) & status::kMailboxFull, 0);
    EXPECT_EQ(rig.write(0, 0x1007, bytes({8})).wkc, 1) << "octets may be left out";
    EXPECT_EQ(state(0) & status::kMailboxFull, status::kMailboxFull);
    EXPECT_EQ(pdi_read(0x1000, 8), bytes({1, 2, 3, 4, 5, 6, 0, 8}));
    // Accesses to the first and the last octet are sufficient.
    EXPECT_EQ(rig.frame({{Command::APWR, {RingPosition{0}, 0x1000}, bytes({1})},
                         {Command::APWR, {RingPosition{0}, 0x1007}, bytes({2})}})
                  .at(1)
                  .wkc,
              1);
    EXPECT_EQ(state(0) & status::kMailboxFull, status::kMailboxFull);
    // The same for the PDI.
    (void)pdi_read(0x1000, 1);
    EXPECT_EQ(state(0) & status::kMailboxFull, status::kMailboxFull);
    (void)pdi_read(0x1007, 1);
    EXPECT_EQ(state(0) & status::kMailboxFull, 0);
}

TEST_F(SyncManagerTest, AnAccessMayBeginBeforeAndEndBehind) {
    EXPECT_EQ(set(0, 0x1002, 2, kMailboxOut), 1);
    EXPECT_EQ(rig.write(0, 0x1000, bytes({1, 2, 3, 4, 5, 6})).wkc, 1);
    EXPECT_EQ(state(0) & status::kMailboxFull, status::kMailboxFull);
    EXPECT_EQ(rig.read(0, 0x1000, 2).data, bytes({1, 2}));
    EXPECT_EQ(rig.read(0, 0x1004, 2).data, bytes({5, 6}));
    EXPECT_EQ(pdi_read(0x1002, 2), bytes({3, 4}));
    const auto reply = rig.send(Command::APRD, {RingPosition{0}, 0x1000}, bytes({0, 0, 0, 0, 0, 0}));
    EXPECT_EQ(reply.wkc, 1) << "part of it could be read";
    EXPECT_EQ(reply.data, bytes({1, 2, 0, 0, 5, 6}));
}

// "The buffer is handed over at the end of a frame without errors."
TEST_F(SyncManagerTest, DamagedFramesHandNothingOver) {
    EXPECT_EQ(set(1, 0x1100, 2, kMailboxIn), 1);
    pdi_write(0x1100, bytes({1, 2}));
    std::array<std::byte, 64> raw{};
    wire::FrameBuilder builder(raw, {0, 1, 1, 1, 1, 1});
    (void)builder.append(Command::APRD, 0, {RingPosition{0}, 0x1100}, 2);
    const auto size = builder.finish().size();
    raw[14 + 2 + 7] |= std::byte{0x80};  // the header announces another datagram, which is missing
    rig.now += 100us;
    (void)rig.segment.process(MutableBytes(raw).first(size), rig.now);
    EXPECT_EQ(rig.read(0, 0x1100, 2).data, bytes({1, 2})) << "still there";
}

// Activate bit 1 and PDI control bit 1: repeat request and acknowledge. The slave's program copies the bit.
TEST_F(SyncManagerTest, RepeatRequestAndAcknowledge) {
    EXPECT_EQ(set(1, 0x1100, 2, kMailboxIn), 1);
    pdi_write(0x1100, bytes({1, 2}));
    EXPECT_EQ(rig.read(0, 0x1100, 2).data, bytes({1, 2}));
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x080E, 0x03), 1);
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x10, 0x10u) << "the slave is told";
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x080F), 0);
    EXPECT_EQ(rig.pdi_get<std::uint8_t>(0, 0x080E), 0x03);
    pdi_write(0x1100, bytes({1, 2}));
    rig.pdi_put<std::uint8_t>(0, 0x080F, 0x02);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x080F), 0x02);
    EXPECT_EQ(rig.read(0, 0x1100, 2).data, bytes({1, 2})) << "repeated";
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x080F, 0), 0) << "PDI control is the PDI's";
}

// --- Three buffers ---

TEST_F(SyncManagerTest, ThreeBuffersGiveTheLatest) {
    EXPECT_EQ(set(3, 0x1100, 2, kInputs), 1);
    EXPECT_EQ(state(3) & status::kLastBufferMask, 0x30) << "none written";
    EXPECT_EQ(wkc_of_read(0x1100, 2), 0) << "nothing there yet";
    pdi_write(0x1100, bytes({1, 1}));
    EXPECT_EQ(state(3) & status::kLastBufferMask, 0x00) << "the first";
    pdi_write(0x1100, bytes({2, 2}));
    EXPECT_NE(state(3) & status::kLastBufferMask, 0x30);
    EXPECT_EQ(rig.read(0, 0x1100, 2).data, bytes({2, 2}));
    EXPECT_EQ(rig.read(0, 0x1100, 2).data, bytes({2, 2})) << "again, until there is a newer one";
    pdi_write(0x1100, bytes({3, 3}));
    EXPECT_EQ(rig.read(0, 0x1100, 2).data, bytes({3, 3}));
}

TEST_F(SyncManagerTest, AWriterNeverWaitsAndAReaderNeverSeesHalf) {
    EXPECT_EQ(set(2, 0x1200, 4, kOutputs), 1);
    for (unsigned i = 1; i <= 10; ++i) EXPECT_EQ(rig.write(0, 0x1200, bytes({i, i, i, i})).wkc, 1);
    EXPECT_EQ(pdi_read(0x1200, 4), bytes({10, 10, 10, 10}));
    // The PDI reads half of the buffer, the master writes twice, then the PDI reads the other half.
    EXPECT_EQ(pdi_read(0x1200, 2), bytes({10, 10}));
    EXPECT_EQ(state(2) & status::kReadBufferInUse, status::kReadBufferInUse);
    for (unsigned i = 11; i <= 12; ++i) EXPECT_EQ(rig.write(0, 0x1200, bytes({i, i, i, i})).wkc, 1);
    EXPECT_EQ(pdi_read(0x1202, 2), bytes({10, 10}));
    EXPECT_EQ(pdi_read(0x1200, 4), bytes({12, 12, 12, 12}));
    // The master writes half of the buffer.
    EXPECT_EQ(rig.write(0, 0x1200, bytes({13, 13})).wkc, 1);
    EXPECT_EQ(state(2) & status::kWriteBufferInUse, status::kWriteBufferInUse);
    EXPECT_EQ(pdi_read(0x1200, 4), bytes({12, 12, 12, 12}));
    EXPECT_EQ(rig.write(0, 0x1202, bytes({13, 13})).wkc, 1);
    EXPECT_EQ(pdi_read(0x1200, 4), bytes({13, 13, 13, 13}));
}

// The three buffers are adjacent: the memory behind the first buffer cannot be accessed by other means.
TEST_F(SyncManagerTest, TheThreeBuffersLieOneBehindTheOther) {
    EXPECT_EQ(set(3, 0x1100, 2, kInputs), 1);
    for (unsigned i = 1; i <= 3; ++i) pdi_write(0x1100, bytes({i, i}));
    const auto memory = rig.slave(0).peek(0x1100, 6);
    std::vector<unsigned> values;
    for (std::size_t i = 0; i < 6; i += 2) values.push_back(std::to_integer<unsigned>(memory[i]));
    std::sort(values.begin(), values.end());
    EXPECT_EQ(values.back(), 3u);
    EXPECT_NE(values[0] + values[1], 0u) << "more than one of them was used";
}

// Interrupt bits of the status octet: the write bit is cleared by a read, the read bit is cleared by a write.
TEST_F(SyncManagerTest, InterruptBits) {
    EXPECT_EQ(set(3, 0x1100, 2, kInputs), 1);
    EXPECT_EQ(state(3) & 3, 0);
    pdi_write(0x1100, bytes({1, 1}));
    EXPECT_EQ(state(3) & 3, status::kInterruptWrite);
    (void)rig.read(0, 0x1100, 1);
    EXPECT_EQ(state(3) & 3, 0) << "first octet read";
    (void)rig.read(0, 0x1101, 1);
    EXPECT_EQ(state(3) & 3, status::kInterruptRead);
    pdi_write(0x1100, bytes({1}));
    EXPECT_EQ(state(3) & 3, 0) << "first octet written";
}

// --- Switching on and off ---

TEST_F(SyncManagerTest, SettingsAreLockedWhileItIsOn) {
    EXPECT_EQ(set(0, 0x1000, 4, kMailboxOut), 1);
    (void)set(0, 0x1200, 8, kMailboxIn);
    EXPECT_EQ(rig.read(0, 0x0800, 5).data, bytes({0x00, 0x10, 4, 0, kMailboxOut}));
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0806, 0), 1);
    EXPECT_EQ(set(0, 0x1200, 8, kMailboxIn), 1);
    EXPECT_EQ(rig.read(0, 0x0800, 5).data, bytes({0x00, 0x12, 8, 0, kMailboxIn}));
}

TEST_F(SyncManagerTest, SwitchingOffAndOnEmptiesIt) {
    EXPECT_EQ(set(0, 0x1000, 4, kMailboxOut), 1);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 1), 1);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0806, 0), 1);
    EXPECT_EQ(state(0), 0);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 2), 1) << "plain memory now";
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x1000), 2u);
    EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0806, 1), 1);
    EXPECT_EQ(state(0), 0) << "empty";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1000, 3), 1);
}

// The bits in 0x0210 and 0x0220 show the interrupt bits of the status.
TEST_F(SyncManagerTest, SwitchingOffClearsItsEvents) {
    for (const bool by_pdi : {false, true}) {
        EXPECT_EQ(set(2, 0x1200, 2, kOutputs), 1);
        EXPECT_EQ(rig.put<std::uint16_t>(0, 0x1200, 1), 1);
        EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x400, 0x400u);
        if (by_pdi)
            rig.pdi_put<std::uint8_t>(0, 0x0817, 1);
        else
            EXPECT_EQ(rig.put<std::uint8_t>(0, 0x0816, 0), 1);
        EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x400, 0u);
        if (!by_pdi) continue;
        rig.pdi_put<std::uint8_t>(0, 0x0817, 0);
        EXPECT_EQ(rig.get<std::uint32_t>(0, 0x0220) & 0x400, 0u) << "no outputs were written";
    }
}

// PDI control bit 0: the slave locks its SyncManager; no access succeeds until it unlocks the SyncManager.
TEST_F(SyncManagerTest, ThePdiMayLockIt) {
    EXPECT_EQ(set(2, 0x1200, 4, kOutputs), 1);
    rig.pdi_put<std::uint8_t>(0, 0x0817, 1);
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0817), 1) << "the master can see it";
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1200, 1), 0);
    rig.pdi_put<std::uint8_t>(0, 0x0817, 0);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1200, 1), 1);
}

TEST_F(SyncManagerTest, ALengthOfZeroIsOff) {
    EXPECT_EQ(set(2, 0x1200, 0, kOutputs), 1);
    EXPECT_EQ(rig.put<std::uint32_t>(0, 0x1200, 1), 1) << "plain memory";
    EXPECT_EQ(rig.get<std::uint32_t>(0, 0x1200), 1u);
}

// When two SyncManagers cover the same memory, the lower number controls it.
TEST_F(SyncManagerTest, OverlapsBelongToTheLowerNumber) {
    EXPECT_EQ(set(1, 0x1000, 8, kMailboxOut), 1);
    EXPECT_EQ(set(0, 0x1004, 8, kMailboxOut), 1);
    EXPECT_EQ(rig.write(0, 0x1004, std::vector<std::byte>(8)).wkc, 1);
    EXPECT_EQ(state(0) & status::kMailboxFull, status::kMailboxFull);
    EXPECT_EQ(state(1) & status::kMailboxFull, 0);
}

TEST_F(SyncManagerTest, BehindTheMemoryThereIsNothing) {
    EXPECT_EQ(set(0, 0xFFF0, 0xFFFF, kMailboxOut), 1);
    EXPECT_EQ(set(1, 0x2FFE, 4, kMailboxIn), 1);
    EXPECT_EQ(rig.write(0, 0xFFF0, bytes({1, 2, 3, 4})).wkc, 0);
    pdi_write(0x2FFE, bytes({1, 2, 3, 4}));
    EXPECT_EQ(wkc_of_read(0x2FFE, 4), 0);
    EXPECT_EQ(set(2, 0x0600, 0x1000, kOutputs), 1) << "over registers";
    EXPECT_EQ(rig.get<std::uint8_t>(0, 0x0000), 0x11) << "the others still answer";
}

// masters-on-the-wire: IgH reads all of SM1 to check whether its mailbox is full; libethercat maps the bit by an FMMU.
TEST_F(SyncManagerTest, MailboxStatusAsMastersLookAtIt) {
    EXPECT_EQ(set(1, 0x1100, 2, kMailboxIn), 1);
    EXPECT_EQ(rig.read(0, 0x0808, 8).data, bytes({0x00, 0x11, 2, 0, kMailboxIn, 0x00, 1, 0}));
    pdi_write(0x1100, bytes({1, 2}));
    EXPECT_EQ(rig.read(0, 0x0808, 8).data, bytes({0x00, 0x11, 2, 0, kMailboxIn, 0x09, 1, 0}));
    EXPECT_EQ(rig.write(0, 0x0600, bytes({0, 0, 0, 9, 1, 0, 0, 0, 0x0D, 0x08, 3, 1, 1, 0, 0, 0})).wkc, 1);
    const auto look = [&] {
        return rig.send(Command::LRD, wire::DatagramAddress(LogicalAddress{0x09000000}), bytes({0}));
    };
    EXPECT_EQ(look().data, bytes({1}));
    EXPECT_EQ(look().wkc, 1);
    (void)rig.read(0, 0x1100, 2);
    EXPECT_EQ(look().data, bytes({0}));
}

}  // namespace
}  // namespace margay::sim::test
