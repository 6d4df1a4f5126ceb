// Objects 0x1010, 0x1011 and 0x10F0: values that survive a loss of power.
#include "subdevice/stored_values.hpp"

#include "bench_device.hpp"

namespace margay::subdevice::testing {
namespace {

// A flash memory that needs some time, may fail, and may lose its power while it is written.
struct Flash final : ValueStore {
    std::vector<std::byte> content;
    Duration needs{};
    bool broken = false;
    Time done = kNever;
    unsigned blocks = 0;

    std::size_t load(MutableBytes into) override {
        if (content.size() > into.size()) return 0;
        std::ranges::copy(content, into.begin());
        return content.size();
    }
    HookAnswer save(Bytes block, Time now) override {
        if (broken) return Abort::hardware_error;
        if (done == kNever) done = now + needs;
        if (now < done) return HookAnswer::later(done);
        done = kNever;
        ++blocks;
        content.assign(block.begin(), block.end());
        return Abort::none;
    }
};

class StoredValuesTest : public ::testing::Test {
  protected:
    Flash flash;
    static constexpr std::size_t kBytes = stored_bytes(table::kObjects);

    // A device after power-up, with the values that the flash memory has.
    struct Powered {
        explicit Powered(Flash& flash) : stored(bench.dictionary, flash, buffer) {
            bench.application.stored = &stored;
            loaded = stored.load();
        }
        Bench bench;
        std::array<std::byte, kBytes> buffer{};
        StoredValues stored;
        bool loaded = false;
    };
    static std::vector<std::byte> word(std::uint32_t value) {
        return raw({static_cast<int>(value & 0xFF), static_cast<int>(value >> 8 & 0xFF),
                    static_cast<int>(value >> 16 & 0xFF), static_cast<int>(value >> 24)});
    }
    static std::vector<std::byte> octets(std::string_view text) {
        const auto bytes = std::as_bytes(std::span(text));
        return {bytes.begin(), bytes.end()};
    }
    static Abort save(Bench& bench) { return download(bench, 0x1010, 1, octets("save")).abort; }
    static Abort restore(Bench& bench) { return download(bench, 0x1011, 1, octets("load")).abort; }
};

TEST_F(StoredValuesTest, BackupValuesSurviveALossOfPower) {
    {
        Powered device(flash);
        EXPECT_FALSE(device.loaded) << "the memory is empty";
        EXPECT_EQ(upload(device.bench, 0x2000).number(), 100U) << "the initial value";
        ASSERT_EQ(download(device.bench, 0x2000, 0, raw({0x2C, 0x01})).abort, Abort::none);
        ASSERT_EQ(download(device.bench, 0x2002, 0, octets("pump")).abort, Abort::none);
        ASSERT_EQ(download(device.bench, 0x2001, 0, raw({1, 2, 3, 4, 5, 6, 7, 8})).abort, Abort::none);
        EXPECT_EQ(upload(device.bench, 0x1010, 1).number(), 1U) << "saves on command";
        EXPECT_EQ(save(device.bench), Abort::none);
        EXPECT_EQ(upload(device.bench, 0x1010, 1).number(), 1U);
        ASSERT_EQ(download(device.bench, 0x2000, 0, raw({7, 0})).abort, Abort::none);  // not saved
    }
    Powered device(flash);
    EXPECT_TRUE(device.loaded);
    EXPECT_EQ(upload(device.bench, 0x2000).number(), 300U);
    EXPECT_EQ(upload(device.bench, 0x2002).text(), "pump");
    EXPECT_EQ(upload(device.bench, 0x2001).number(), 0x1122334455667788U) << "no backup value";
    EXPECT_EQ(restore(device.bench), Abort::none);
    EXPECT_EQ(upload(device.bench, 0x2000).number(), 100U);
    EXPECT_EQ(upload(device.bench, 0x2002).text(), "none");
    EXPECT_FALSE(Powered(flash).loaded);
}

TEST_F(StoredValuesTest, OtherValuesAndStatesAreRefused) {
    Powered device(flash);
    EXPECT_EQ(download(device.bench, 0x1010, 1, octets("SAVE")).abort, Abort::cannot_store);
    EXPECT_EQ(download(device.bench, 0x1010, 1, octets("load")).abort, Abort::cannot_store);
    EXPECT_EQ(download(device.bench, 0x1010, 1, octets("sav")).abort, Abort::length_too_low);
    EXPECT_EQ(download(device.bench, 0x1011, 1, octets("save")).abort, Abort::cannot_store);
    EXPECT_EQ(flash.blocks, 0U);
    device.bench.request(4);
    ASSERT_EQ(device.bench.esc.al_status().state, AlState::safeop);
    EXPECT_NE(restore(device.bench), Abort::none) << "parameters in use";
    EXPECT_EQ(save(device.bench), Abort::none);
    device.bench.application.stored = nullptr;
    EXPECT_EQ(upload(device.bench, 0x1010, 1).abort, Abort::no_object);
    EXPECT_EQ(upload(device.bench, 0x10F0, 1).abort, Abort::no_object);
}

// The check value of CRC-32 (IEEE 802.3) and this table of values: computed with another program (zlib).
TEST_F(StoredValuesTest, TheChecksumTellsValuesApart) {
    Powered device(flash);
    const auto sum = [&] { return upload(device.bench, 0x10F0, 1).number(); };
    EXPECT_EQ(sum(), 0xD11B4537U);
    ASSERT_EQ(download(device.bench, 0x2000, 0, raw({0x2C, 0x01})).abort, Abort::none);
    EXPECT_NE(sum(), 0xD11B4537U);
    ASSERT_EQ(download(device.bench, 0x2000, 0, raw({100, 0})).abort, Abort::none);
    EXPECT_EQ(sum(), 0xD11B4537U);
    ASSERT_EQ(download(device.bench, 0x2001, 0, raw({1, 2, 3, 4, 5, 6, 7, 8})).abort, Abort::none);
    EXPECT_EQ(sum(), 0xD11B4537U) << "no backup value";
    EXPECT_EQ(download(device.bench, 0x10F0, 1, word(0)).abort, Abort::read_only);
}

// A block that was damaged in any octet, cut, or written by another firmware, changes nothing.
TEST_F(StoredValuesTest, ADamagedBlockIsNotLoaded) {
    {
        Powered device(flash);
        ASSERT_EQ(download(device.bench, 0x2000, 0, raw({0x2C, 0x01})).abort, Abort::none);
        ASSERT_EQ(save(device.bench), Abort::none);
    }
    const auto whole = flash.content;
    ASSERT_EQ(whole.size(), kBytes);
    for (std::size_t n = 0; n < whole.size(); ++n) {
        flash.content = whole;
        flash.content[n] ^= std::byte{0x10};
        Powered device(flash);
        EXPECT_FALSE(device.loaded) << n;
        EXPECT_EQ(upload(device.bench, 0x2000).number(), 100U) << n;
    }
    for (const std::size_t bytes : {std::size_t{1}, kBytes - 1, kBytes + 1}) {
        flash.content = whole;
        flash.content.resize(bytes);
        EXPECT_FALSE(Powered(flash).loaded) << bytes;
    }
    flash.content = whole;
    EXPECT_TRUE(Powered(flash).loaded);
}

// The memory needs a second: the device continues, and the master waits for the reply.
TEST_F(StoredValuesTest, ASlowMemoryDelaysOnlyTheReply) {
    Powered device(flash);
    Bench& bench = device.bench;
    flash.needs = 1s;
    auto message = sdo_request(0x23, 0x1010, 1, kSave);
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, message));
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty());
    bench.request(4);
    EXPECT_EQ(bench.esc.al_status().state, AlState::safeop) << "the device continues";
    bench.esc.time += 1s;
    bench.settle();
    EXPECT_EQ(abort_of(bench.receive()), Abort::none);
    EXPECT_EQ(flash.blocks, 1U);
}

TEST_F(StoredValuesTest, AFailedMemoryIsReported) {
    Powered device(flash);
    flash.broken = true;
    EXPECT_EQ(save(device.bench), Abort::hardware_error);
    ASSERT_EQ(download(device.bench, 0x2000, 0, raw({7, 0})).abort, Abort::none);
    EXPECT_EQ(restore(device.bench), Abort::hardware_error);
    EXPECT_EQ(upload(device.bench, 0x2000).number(), 7U) << "nothing was restored";
    flash.broken = false;
    EXPECT_EQ(save(device.bench), Abort::none);
}

// The master has given up the first command. The second one must not succeed with the values of the first.
TEST_F(StoredValuesTest, ASecondCommandStoresTheValuesOfItsOwnTime) {
    Powered device(flash);
    flash.needs = 1s;
    const Time start{};
    EXPECT_TRUE(device.stored.save(start).waits());
    ASSERT_EQ(download(device.bench, 0x2000, 0, raw({7, 0})).abort, Abort::none);
    HookAnswer answer = device.stored.save(start + 1s);
    ASSERT_TRUE(answer.waits()) << "the block of the first command is stored, the new one is not";
    answer = device.stored.save(start + 2s);
    EXPECT_FALSE(answer.waits());
    EXPECT_EQ(answer.abort, Abort::none);
    EXPECT_EQ(flash.blocks, 2U);
    Powered again(flash);
    EXPECT_EQ(upload(again.bench, 0x2000).number(), 7U);
}

}  // namespace
}  // namespace margay::subdevice::testing
