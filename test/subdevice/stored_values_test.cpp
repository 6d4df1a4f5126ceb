// Objects 0x1010, 0x1011 and 0x10F0: values that survive a loss of power.
#include "subdevice/stored_values.hpp"

#include "bench_device.hpp"

#include <functional>

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

TEST_F(StoredValuesTest, ACommandEndsWhenTheApplicationTakesItsStoredValuesAway) {
    Powered device(flash);
    Bench& bench = device.bench;
    flash.needs = std::chrono::seconds(1);
    constexpr std::pair<int, std::string_view> kCommands[] = {{0x1010, "save"}, {0x1011, "load"}};
    for (const auto& [index, word] : kCommands) {
        flash.done = kNever;
        bench.application.stored = &device.stored;
        auto message = sdo_request(0x23, index, 1, load_le<std::uint32_t>(octets(word)));
        ASSERT_TRUE(bench.send(wire::MailboxType::coe, message));
        bench.settle();
        ASSERT_TRUE(bench.fetch().empty()) << "the memory is busy";
        bench.application.stored = nullptr;
        bench.esc.time += std::chrono::seconds(1);
        bench.settle();
        EXPECT_NE(abort_of(bench.receive()), Abort::none) << word;
    }
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

// A block that was damaged in any octet, truncated, or written by another firmware changes no value.
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

// The power fails while the flash memory writes octet `n`: over the old block, or after it has erased the old block.
TEST_F(StoredValuesTest, ALossOfPowerAtEachWriteLeavesTheOldBlockTheNewOneOrNone) {
    const auto block_of = [&](const std::vector<std::byte>& value, std::string_view label) {
        Powered device(flash);
        EXPECT_EQ(download(device.bench, 0x2000, 0, value).abort, Abort::none);
        EXPECT_EQ(download(device.bench, 0x2002, 0, octets(label)).abort, Abort::none);
        EXPECT_EQ(save(device.bench), Abort::none);
        return flash.content;
    };
    const auto before = block_of(raw({0x2C, 0x01}), "pump");
    const auto after = block_of(raw({0x90, 0x01}), "valve");
    ASSERT_EQ(before.size(), after.size());
    for (const bool erases : {false, true}) {
        for (std::size_t n = 0; n <= after.size(); ++n) {
            flash.content = erases ? std::vector<std::byte>(before.size(), std::byte{0xFF}) : before;
            std::copy_n(after.begin(), n, flash.content.begin());
            Powered device(flash);
            const auto setting = upload(device.bench, 0x2000).number();
            const auto label = upload(device.bench, 0x2002).text();
            const auto expected = !device.loaded            ? std::pair{100U, "none"}
                                  : flash.content == before ? std::pair{300U, "pump"}
                                                            : std::pair{400U, "valve"};
            EXPECT_EQ(setting, expected.first) << n;
            EXPECT_EQ(label, expected.second) << n;
            EXPECT_EQ(device.loaded, flash.content == before || flash.content == after) << n;
        }
    }
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

// The master has given up the first command. The second command must not succeed with the values of the first command.
TEST_F(StoredValuesTest, ASecondCommandStoresTheValuesOfItsOwnTime) {
    Powered device(flash);
    flash.needs = 1s;
    const Time start{};
    EXPECT_TRUE(device.stored.save(start).waits());
    ASSERT_EQ(download(device.bench, 0x2000, 0, raw({7, 0})).abort, Abort::none);
    HookAnswer answer = device.stored.save(start + 1s);
    ASSERT_TRUE(answer.waits()) << "the block of the first command is stored, the new one is not";
    answer = device.stored.save(start + 2s, true);
    EXPECT_FALSE(answer.waits());
    EXPECT_EQ(answer.abort, Abort::none);
    EXPECT_EQ(flash.blocks, 2U);
    Powered again(flash);
    EXPECT_EQ(upload(again.bench, 0x2000).number(), 7U);
}

// A value that changes in each cycle is stored once, with the value of the time of the command.
TEST_F(StoredValuesTest, AValueThatChangesAllTheTimeIsStoredOnce) {
    Powered device(flash);
    Bench& bench = device.bench;
    flash.needs = 1s;
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x23, 0x1010, 1, kSave)));
    bench.settle();
    for (int n = 0; n < 15; ++n) {
        Values::setting::store(bench.image, static_cast<std::int16_t>(n));
        bench.esc.time += 100ms;
        (void)bench.step();
    }
    EXPECT_EQ(abort_of(bench.receive()), Abort::none);
    EXPECT_EQ(flash.blocks, 1U);
}

// Tables of firmware versions: the values lie at the same places.
struct Kept {
    using a = Field<std::uint16_t, 0>;
    using b = Field<std::uint16_t, 2>;
    using signed_b = Field<std::int16_t, 2>;
    static constexpr std::size_t text = 4;  // 100 octets
    static constexpr std::size_t bytes = 104;
};
constexpr auto kKeep = od::kReadWrite | od::kBackup;
constexpr Entry kKeptA[] = {value<Kept::a>(0, "A", kKeep, 10)};
constexpr Entry kKeptB[] = {value<Kept::b>(0, "B", kKeep, 20)};
constexpr Entry kKeptSignedB[] = {value<Kept::signed_b>(0, "B", kKeep, -20)};
constexpr Entry kKeptLimitedA[] = {value<Kept::a>(0, "A", kKeep, 10).within(kLimits<0, 50>)};
constexpr Entry kKeptText[] = {octets(0, "Text", DataType::octet_string, kKeep, Kept::text, 100)};
constexpr Object kVersion1[] = {variable(0x2000, "A", kKeptA), variable(0x2001, "B", kKeptB)};
constexpr Object kOtherType[] = {variable(0x2000, "A", kKeptA), variable(0x2001, "B", kKeptSignedB)};
constexpr Object kOtherLimits[] = {variable(0x2000, "A", kKeptLimitedA), variable(0x2001, "B", kKeptB)};
constexpr Object kWithText[] = {variable(0x2000, "A", kKeptA), variable(0x2001, "B", kKeptB),
                                variable(0x2002, "Text", kKeptText)};

struct Version {
    explicit Version(std::span<const Object> objects, Flash& flash)
        : dictionary(objects, image), stored(dictionary, flash, buffer) {}
    std::array<std::byte, Kept::bytes> image{};
    std::array<std::byte, 12 + Kept::bytes> buffer{};
    ObjectDictionary dictionary;
    StoredValues stored;
};

TEST_F(StoredValuesTest, AnotherDataTypeOfTheSameSizeIsAnotherTable) {
    Version first(kVersion1, flash);
    Kept::b::store(first.image, 60'000);
    ASSERT_EQ(first.stored.save(Time{}).abort, Abort::none);
    Version other(kOtherType, flash);
    EXPECT_FALSE(other.stored.load());
    EXPECT_EQ(Kept::signed_b::load(other.image), -20);
    EXPECT_TRUE(Version(kVersion1, flash).stored.load());
}

TEST_F(StoredValuesTest, AStoredValueOutsideTheLimitsIsNotLoaded) {
    Version first(kVersion1, flash);
    Kept::a::store(first.image, 1000);
    Kept::b::store(first.image, 60'000);
    ASSERT_EQ(first.stored.save(Time{}).abort, Abort::none);
    Version limited(kOtherLimits, flash);
    EXPECT_TRUE(limited.stored.load());
    EXPECT_EQ(Kept::a::load(limited.image), 10) << "the initial value";
    EXPECT_EQ(Kept::b::load(limited.image), 60'000);
}

// The lock is held for one value at a time, so an interrupt handler is executed after each value.
struct Lock final : EscAccess {
    void read(std::uint16_t, MutableBytes) noexcept override {}
    void write(std::uint16_t, Bytes) noexcept override {}
    [[nodiscard]] Time now() noexcept override { return {}; }
    [[nodiscard]] std::uint32_t lock() noexcept override { return depth++; }
    void unlock(std::uint32_t before) noexcept override {
        depth = before;
        if (depth != 0) return;
        ++sections;
        if (handler) handler();
    }
    std::uint32_t depth = 0;
    unsigned sections = 0;
    std::function<void()> handler;
};

TEST_F(StoredValuesTest, TheLockIsHeldForOneValue) {
    Version device(kWithText, flash);
    Lock lock;
    device.dictionary.set_lock(&lock);
    Version late(kWithText, flash);
    Kept::b::store(late.image, 1234);
    std::fill_n(late.image.begin() + Kept::text, 100, std::byte{5});
    // All values after the first value change after the copy of the first value.
    lock.handler = [&] { std::copy(late.image.begin() + 2, late.image.end(), device.image.begin() + 2); };
    const auto sum = device.stored.checksum();
    EXPECT_EQ(sum, late.stored.checksum());
    EXPECT_EQ(lock.sections, 4U) << "two numbers, and two pieces of the text";

    device.dictionary.restore_defaults();
    lock.sections = 0;
    ASSERT_EQ(device.stored.save(Time{}).abort, Abort::none);
    EXPECT_EQ(lock.sections, 3U) << "a value as a whole";
    Version loaded(kWithText, flash);
    ASSERT_TRUE(loaded.stored.load());
    EXPECT_EQ(Kept::b::load(loaded.image), 1234);

    lock.sections = 0;
    ASSERT_EQ(device.stored.restore(Time{}).abort, Abort::none);
    EXPECT_EQ(lock.sections, 3U);
}

// The reply is copied under the lock. A CRC of many values under the lock would delay SYNC0.
TEST_F(StoredValuesTest, TheChecksumOfAReadIsComputedWithoutTheLock) {
    Powered device(flash);
    const auto sum = device.stored.checksum();
    Lock lock;
    device.bench.dictionary.set_lock(&lock);
    EXPECT_EQ(upload(device.bench, 0x10F0, 1).number(), sum);
    EXPECT_EQ(lock.sections, 3U) << "two values, and the reply";
    EXPECT_EQ(upload(device.bench, 0x10F0, 0, true).data.size(), 6U);
    device.bench.dictionary.set_lock(nullptr);
}

}  // namespace
}  // namespace margay::subdevice::testing
