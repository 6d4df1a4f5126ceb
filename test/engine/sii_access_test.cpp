// Reading and writing the EEPROM of one slave. The slave has only an SII interface (ETG.1000.4, registers
// 0x0500–0x050F). The slave is busy for a time, returns four or eight octets, does not acknowledge some commands, loses
// frames, and refuses writes.
#include "station/sii_access.hpp"
#include "engine/scripted_nic.hpp"
#include "link/engine.hpp"
#include "wire/sii.hpp"

#include <gtest/gtest.h>

#include <map>
#include <numeric>

namespace margay {
namespace {

using namespace std::chrono_literals;

// The far end. Each frame returns after a fixed time. The slave executes the datagrams at the time of sending.
class SiiSlave final : public Nic {
  public:
    Time now{1s};
    Duration round_trip = 100us;
    Duration read_time = 680us;
    Duration write_busy = 300us;  // busy time after a write command, as recorded on an EK1100
    // Until this time after a write no command is acknowledged, because the word is being stored (same recording).
    Duration write_time = 3800us;
    std::uint32_t dead_word = 0xFFFFFFFF;  // writes to this word are never acknowledged
    int lost_after_writes = -1;            // after this number of written words no frame returns
    std::vector<std::uint32_t> written;
    bool eight_bytes = true;
    bool refuses_writes = false;
    int missing_acknowledges = 0;
    int lose_frame = -1;  // the number of the frame that does not return
    std::vector<std::byte> eeprom = std::vector<std::byte>(4096);
    int lost_of_each = 0;  // this number of frames get no reply, then one frame gets a reply
    int frames = 0;
    std::map<std::uint32_t, int> reads;  // the number of reads of each word

    SendStatus send(std::span<const std::byte> sent) noexcept override {
        Octets frame = reply_to(Octets(sent.begin(), sent.end()), 1);
        wire::DatagramReader reader(sent);
        while (auto d = reader.next()) {
            const auto data = MutableBytes(frame).subspan(d->offset + wire::kDatagramHeaderBytes, d->header.length);
            for (std::size_t i = 0; i < data.size(); ++i)
                if (d->header.command == wire::Command::FPRD)
                    data[i] = read(static_cast<std::uint16_t>(d->header.address.ado() + i));
            if (d->header.command == wire::Command::FPWR && d->header.address.ado() == 0x0502) command(d->data);
        }
        const bool lost = lost_after_writes >= 0 && written.size() >= static_cast<std::size_t>(lost_after_writes);
        const bool late = frames % (lost_of_each + 1) != lost_of_each;
        if (frames++ != lose_frame && !lost && !late) flying_.emplace_back(now + round_trip, std::move(frame));
        return SendStatus::sent;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (flying_.empty() || flying_.front().first > now) return 0;
        const Octets frame = std::move(flying_.front().second);
        flying_.pop_front();
        std::copy(frame.begin(), frame.end(), into.begin());
        return frame.size();
    }
    Time next_arrival() const noexcept override { return flying_.empty() ? kNever : flying_.front().first; }

  private:
    std::byte read(std::uint16_t address) {
        const bool busy = now < busy_until_;
        const std::uint16_t status = static_cast<std::uint16_t>((busy ? 0x8000 : error_) | (eight_bytes ? 0x40 : 0));
        if (address < 0x0504) return static_cast<std::byte>(status >> (8 * (address - 0x0502)));
        if (address < 0x0508) return static_cast<std::byte>(word_ >> (8 * (address - 0x0504)));
        const std::size_t n = address - 0x0508U;
        return busy || n >= (eight_bytes ? 8U : 4U) ? std::byte{0xEE} : eeprom.at(word_ * 2 + n);
    }
    void command(Bytes data) {
        if (now < busy_until_) return;  // blocked
        const auto what = load_le<std::uint16_t>(data) & 0x0700;
        error_ = 0;
        word_ = load_le<std::uint32_t>(data, 2);
        if (now < stored_) {
            busy_until_ = now + 90us;
            error_ = 0x2000;
            return;
        }
        if (what == 0x0100) {
            ++reads[word_];
            busy_until_ = now + read_time;
            if (missing_acknowledges > 0) {
                --missing_acknowledges;
                error_ = 0x2000;
            }
        } else if (what == 0x0200) {
            if (refuses_writes || (load_le<std::uint16_t>(data) & 1) == 0) {
                error_ = 0x4000;
                return;
            }
            busy_until_ = now + write_busy;
            if (word_ == dead_word) {
                error_ = 0x2000;
                return;
            }
            stored_ = now + write_time;
            if (lost_after_writes >= 0 && written.size() >= static_cast<std::size_t>(lost_after_writes)) return;
            written.push_back(word_);
            eeprom[word_ * 2] = data[6];
            eeprom[word_ * 2 + 1] = data[7];
        }
    }

    std::deque<std::pair<Time, Octets>> flying_;
    Time busy_until_ = Time::min();
    Time stored_ = Time::min();
    std::uint32_t word_ = 0;
    std::uint16_t error_ = 0;
};

class SiiAccess : public testing::Test {
  protected:
    SiiAccess() {
        std::iota(reinterpret_cast<unsigned char*>(&*slave.eeprom.begin()),
                  reinterpret_cast<unsigned char*>(&*slave.eeprom.begin()) + 4096, 0);
    }

    SiiSlave slave;
    std::vector<FrameSlot> slots = std::vector<FrameSlot>(4);
    std::vector<std::byte> memory = std::vector<std::byte>(64 * 1024);
    Engine engine{slave, slots, memory};
    Station station{engine, {0x1001}, 1};
    Duration took{0};

    Result<> finish(OwnedTask<> task) {
        const Time start = slave.now;
        engine.poll(slave.now);
        task.start();
        for (int i = 0; i < 100000 && !task.done(); ++i) {
            const Time next = engine.poll(slave.now);
            if (!task.done()) slave.now = std::max(slave.now, next);
        }
        EXPECT_TRUE(task.done());
        took = slave.now - start;
        return task.result();
    }
    void expect_whole_image_is_read() {
        SiiReader reader(station);
        std::vector<std::byte> image(2048);
        const auto result = finish(reader.read(0, image));
        ASSERT_TRUE(result) << static_cast<int>(result.error().code);
        EXPECT_TRUE(std::equal(image.begin(), image.end(), slave.eeprom.begin()));
    }
};

TEST_F(SiiAccess, ReadsEachBlockOnce) {
    expect_whole_image_is_read();
    for (const auto& [word, times] : slave.reads) EXPECT_EQ(times, 1) << word;
    EXPECT_EQ(slave.reads.size(), 256U);
}

TEST_F(SiiAccess, NearTheTimeOfTheEepromAndNearOneRoundTripABlock) {
    for (const Duration read_time : {30us, 300us, 310us, 680us, 2000us}) {
        slave.read_time = read_time;
        slave.frames = 0;
        expect_whole_image_is_read();
        const Duration floor = 256 * std::max(read_time, slave.round_trip);
        EXPECT_LE(took, floor * 5 / 4) << read_time.count();
        EXPECT_LE(slave.frames, 256 * 5 / 4) << read_time.count();
    }
}

// A machine under load: some replies arrive after the timeout of their frames. The link sends these frames again, so
// the slave executes their datagrams twice. A frame can contain a reading of the status and a read command: when the
// frame is sent again, the slave returns the status after the command.
TEST_F(SiiAccess, RepliesBehindTheTimeoutOfTheirFrames) {
    engine.link().settings.frame_timeout = 10ms;
    for (const int lost : {1, 2})
        for (const Duration round_trip : {1ms, 5ms, 9ms})
            for (const Duration read_time : {100us, 680us, 3000us, 12000us}) {
                SCOPED_TRACE(testing::Message() << lost << ' ' << round_trip.count() << ' ' << read_time.count());
                slave.lost_of_each = lost;
                slave.round_trip = round_trip;
                slave.read_time = read_time;
                expect_whole_image_is_read();
            }
}

TEST_F(SiiAccess, FourOctetsAtATime) {
    slave.eight_bytes = false;
    expect_whole_image_is_read();
    EXPECT_EQ(slave.reads.size(), 512U);
}

TEST_F(SiiAccess, MissingAcknowledgeIsTriedUntilATimeIsOver) {
    slave.missing_acknowledges = 30;
    expect_whole_image_is_read();
    EXPECT_GE(took, 30 * 500us) << "a pause between two tries";
    slave.missing_acknowledges = 100000;
    SiiReader reader(station);
    std::array<std::byte, 8> block{};
    const auto result = finish(reader.read(0x40, block));
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::sii_nack);
    EXPECT_EQ(result.error().index, 0x40);
    EXPECT_EQ(result.error().slave, 1);
    EXPECT_GE(took, 100ms);
    EXPECT_LT(took, 110ms);
}

// The two retries also happen when the program polls rarely.
TEST_F(SiiAccess, MissingAcknowledgeIsTriedTwiceMoreHoweverRarelyItIsPolled) {
    slave.missing_acknowledges = 2;
    SiiReader reader(station);
    std::array<std::byte, 8> block{};
    OwnedTask task = reader.read(0x40, block);
    engine.poll(slave.now);
    task.start();
    for (int polls = 0; polls < 100 && !task.done(); ++polls) {
        engine.poll(slave.now);
        slave.now += 60ms;
    }
    ASSERT_TRUE(task.done());
    EXPECT_TRUE(task.result());
}

TEST_F(SiiAccess, BusyForeverEndsInAnError) {
    slave.read_time = 10s;
    SiiReader reader(station);
    std::array<std::byte, 8> block{};
    const auto result = finish(reader.read(0, block));
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::sii_busy);
    EXPECT_LT(took, 1s);
}

TEST_F(SiiAccess, AnyOneFrameMayBeLost) {
    for (int lost = 0; lost < 40; ++lost) {
        slave.frames = 0;
        slave.lose_frame = lost;
        SiiReader reader(station);
        std::array<std::byte, 64> part{};
        const auto result = finish(reader.read(8, part));
        ASSERT_TRUE(result) << lost;
        EXPECT_TRUE(std::equal(part.begin(), part.end(), slave.eeprom.begin() + 16)) << lost;
    }
}

TEST_F(SiiAccess, WritesWordsAndReadsThemBack) {
    const std::array<std::byte, 6> data{std::byte{1}, std::byte{2}, std::byte{3},
                                        std::byte{4}, std::byte{5}, std::byte{6}};
    ASSERT_TRUE(finish(sii_write(station, 0x10, data)));
    EXPECT_TRUE(std::equal(data.begin(), data.end(), slave.eeprom.begin() + 0x20));
    EXPECT_EQ(slave.eeprom[0x26], std::byte{0x26}) << "nothing behind it";
}

TEST_F(SiiAccess, ReadErrorsNameTheWordWhateverTheCause) {
    slave.lost_after_writes = 0;
    SiiReader reader(station);
    std::array<std::byte, 8> block{};
    const auto result = finish(reader.read(0x40, block));
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::no_frame);
    EXPECT_EQ(result.error().index, 0x40);
}

// ETG.1000.6 "Slave information interface area": words 0–7 of this slave, and other values for them.
class SiiAreaWrite : public SiiAccess {
  protected:
    using Area = std::array<std::byte, 16>;

    SiiAreaWrite() { std::copy(old.begin(), old.end(), slave.eeprom.begin()); }
    static Area area(unsigned seed) {
        Area words{};
        for (std::size_t i = 0; i < 14; ++i)
            words[i] = static_cast<std::byte>((seed = seed * 1103515245 + 12345) >> 16);
        words[14] = static_cast<std::byte>(wire::sii::checksum(words));
        return words;
    }
    [[nodiscard]] Area now() const {
        Area words{};
        std::copy_n(slave.eeprom.begin(), words.size(), words.begin());
        return words;
    }

    const Area old = area(1);
};

TEST_F(SiiAreaWrite, WritesOnlyTheWordsThatDifferAndTheChecksumLast) {
    auto wanted = old;
    wanted[8] = std::byte{0x11};
    wanted[14] = static_cast<std::byte>(wire::sii::checksum(wanted));
    ASSERT_TRUE(finish(sii_write(station, 0, wanted)));
    EXPECT_EQ(now(), wanted);
    EXPECT_EQ(slave.written, (std::vector<std::uint32_t>{4, 7}));
}

// When any word fails, the old content is restored, and the error names the word.
TEST_F(SiiAreaWrite, AWordThatFailsIsNamedAndTheOldContentComesBack) {
    std::vector<std::byte> image(64);
    const Area head = area(2);
    std::copy(head.begin(), head.end(), image.begin());
    for (std::uint32_t word = 0; word < 8; ++word) {
        slave.dead_word = word;
        const auto result = finish(sii_write(station, 0, image));
        ASSERT_FALSE(result) << word;
        EXPECT_EQ(result.error().code, Errc::sii_nack) << word;
        EXPECT_EQ(result.error().step, Step::write_sii) << word;
        EXPECT_EQ(result.error().index, word);
        EXPECT_EQ(now(), old) << word;
    }
    slave.dead_word = 0x10;
    slave.written.clear();
    const auto result = finish(sii_write(station, 0, image));
    EXPECT_EQ(result.error().index, 0x10);
    EXPECT_EQ(now(), old) << "the area comes last";
}

// The connection or the power fails after any number of words. The EEPROM then has the old content, the new content,
// or a wrong checksum.
TEST_F(SiiAreaWrite, AnEndAtAnyWordIsOldOrNewOrSeen) {
    std::vector<std::byte> image(64);
    const Area head = area(3);
    std::copy(head.begin(), head.end(), image.begin());
    const auto blank = slave.eeprom;
    bool all_written = false;
    for (int words = 0; !all_written; ++words) {
        slave.eeprom = blank;
        slave.written.clear();
        slave.lost_after_writes = words;
        const auto result = finish(sii_write(station, 0, image));
        all_written = now() == head;
        ASSERT_FALSE(result) << "the last word is not read back";
        EXPECT_EQ(result.error().index, words == 0 ? 8 : slave.written.back()) << "written, and not known to be";
        EXPECT_TRUE(words > 24 || now() == old) << words;
        EXPECT_TRUE(now() == old || all_written || !wire::sii::checksum_right(now())) << words;
        ASSERT_LT(words, 64);
    }
}

TEST_F(SiiAccess, ATimeoutOfTheWriteNamesTheWord) {
    slave.write_busy = 10s;
    const std::array<std::byte, 2> data{};
    const auto result = finish(sii_write(station, 0x17, data));
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::sii_busy);
    EXPECT_EQ(result.error().index, 0x17);
}

// Slow EEPROMs: 10 ms per word.
TEST_F(SiiAccess, WaitsForSlowParts) {
    slave.write_time = 10ms;
    const std::array<std::byte, 8> data{std::byte{1}};
    ASSERT_TRUE(finish(sii_write(station, 0x20, data)));
    EXPECT_TRUE(std::equal(data.begin(), data.end(), slave.eeprom.begin() + 0x40));
    EXPECT_GE(took, 4 * 10ms);
    EXPECT_LT(took, 4 * 12ms);
}

TEST_F(SiiAccess, RefusedWriteNamesTheWord) {
    slave.refuses_writes = true;
    const std::array<std::byte, 2> data{};
    const auto result = finish(sii_write(station, 0x04, data));
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::sii_write_denied);
    EXPECT_EQ(result.error().index, 0x04);
}

}  // namespace
}  // namespace margay
