// The SPI port of the LAN9252 with a model of the chip's host side, written from its data sheet (DS00001909: "SPI read
// and write", "EtherCAT CSR and process data RAM access"): instructions, busy bits, FIFOs that fill over time,
// unaligned ends.
#include "common/lan9252_spi.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <vector>

namespace margay::samples {
namespace {

class Chip final : public SpiBus {
  public:
    std::vector<std::byte> memory = std::vector<std::byte>(0x3000);
    unsigned busy_for = 0;   // number of reads of a command register that return busy
    unsigned not_ready = 0;  // number of reads until the chip is ready
    bool stuck = false;
    unsigned transfers = 0;
    std::vector<unsigned> csr_sizes;

    void transfer(MutableBytes io) noexcept override {
        ++transfers;
        ASSERT_GE(io.size(), 7u);
        ASSERT_EQ((io.size() - 3) % 4, 0u) << "whole double words";
        const auto address = std::to_integer<unsigned>(io[1]) << 8 | std::to_integer<unsigned>(io[2]);
        ASSERT_LT(address, 0x400u) << "no automatic increment over the FIFO's end";
        for (std::size_t at = 3; at < io.size(); at += 4) {
            if (io[0] == std::byte{0x03})
                store_le<std::uint32_t>(io, at, read(address));
            else if (io[0] == std::byte{0x02})
                write(address, load_le<std::uint32_t>(io, at));
            else
                FAIL() << "no instruction of the chip";
        }
    }
    Time now() noexcept override { return Time{} + std::chrono::microseconds(transfers); }

  private:
    std::uint32_t read(unsigned address) {
        if (address < 0x20) {
            if (fifo_.empty()) {
                ADD_FAILURE() << "the read FIFO is empty";
                return 0;
            }
            const auto word = fifo_.front();
            fifo_.pop_front();
            return word;
        }
        switch (address) {
            case 0x064: return not_ready > 0 ? --not_ready, 0xFFFFFFFF : 0x87654321;
            case 0x074: return 1u << 27;
            case 0x300: return csr_data_;
            case 0x304: return busy();
            case 0x30C: {
                // Each read of the register shows one more double word, as the chip fills its FIFO over time.
                shown_ = std::min(shown_ + 1, fifo_.size());
                return busy() | static_cast<std::uint32_t>(shown_ << 8) | (shown_ != 0 ? 1u : 0u);
            }
            case 0x314: return busy() | (16u << 8 | 1u);
            default: ADD_FAILURE() << "read of 0x" << std::hex << address; return 0;
        }
    }
    std::uint32_t busy() {
        if (stuck) return 1u << 31;
        if (pending_ == 0) return 0;
        --pending_;
        return 1u << 31;
    }
    void write(unsigned address, std::uint32_t value) {
        const auto low = static_cast<unsigned>(value & 0xFFFF);
        const auto high = static_cast<unsigned>(value >> 16);
        if (address >= 0x20 && address < 0x40) return take(value);
        switch (address) {
            case 0x300: csr_data_ = value; return;
            case 0x304: return csr(low, high & 7, (value >> 30 & 1) != 0);
            case 0x308: read_at_ = low, read_bytes_ = high; return;
            case 0x310: write_at_ = low, write_left_ = high; return;
            case 0x30C:
                fifo_.clear();
                shown_ = 0;
                if ((value >> 31) != 0) fill();
                return;
            case 0x314: return;
            case 0x054:
            case 0x05C: return;
            default: ADD_FAILURE() << "write of 0x" << std::hex << address;
        }
    }
    void csr(unsigned address, unsigned size, bool reads) {
        ASSERT_TRUE(size == 1 || size == 2 || size == 4);
        ASSERT_EQ(address % size, 0u) << "a CSR access lies on its own size";
        ASSERT_LT(address, 0x1000u);
        csr_sizes.push_back(size);
        pending_ = busy_for;
        if (reads) csr_data_ = 0xDDDDDDDD;
        for (unsigned i = 0; i < size; ++i) {
            if (reads) {
                csr_data_ = (csr_data_ & ~(0xFFu << (8 * i))) | std::to_integer<std::uint32_t>(memory[address + i])
                                                                    << (8 * i);
            } else {
                memory[address + i] = static_cast<std::byte>(csr_data_ >> (8 * i));
            }
        }
    }
    void fill() {
        ASSERT_GE(read_at_, 0x1000u);
        ASSERT_LE((read_at_ % 4 + read_bytes_ + 3) / 4, 16u) << "sixteen double words are the FIFO's room";
        pending_ = busy_for;
        for (unsigned at = read_at_ & ~3u; at < read_at_ + read_bytes_; at += 4) {
            std::uint32_t word = 0xEEEEEEEE;
            for (unsigned i = 0; i < 4; ++i)
                if (at + i >= read_at_ && at + i < read_at_ + read_bytes_)
                    word = (word & ~(0xFFu << (8 * i))) | std::to_integer<std::uint32_t>(memory[at + i]) << (8 * i);
            fifo_.push_back(word);
        }
    }
    void take(std::uint32_t word) {
        ASSERT_GT(write_left_, 0u) << "more double words than announced";
        const auto skipped = write_at_ % 4;
        for (unsigned i = skipped; i < 4 && write_left_ > 0; ++i, --write_left_)
            memory[write_at_++] = static_cast<std::byte>(word >> (8 * i));
    }

    std::uint32_t csr_data_ = 0;
    unsigned pending_ = 0;
    unsigned read_at_ = 0;
    unsigned read_bytes_ = 0;
    unsigned write_at_ = 0;
    unsigned write_left_ = 0;
    std::deque<std::uint32_t> fifo_;
    std::size_t shown_ = 0;
};

std::vector<std::byte> pattern(std::size_t bytes, unsigned seed) {
    std::vector<std::byte> out(bytes);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = static_cast<std::byte>(seed + i * 31);
    return out;
}

TEST(Lan9252, WaitsForTheChip) {
    Chip chip;
    chip.not_ready = 10;
    Lan9252 esc(chip);
    EXPECT_FALSE(esc.begin(5));
    EXPECT_TRUE(esc.begin(20));
}

TEST(Lan9252, EveryAddressAndLengthOfRegisters) {
    for (unsigned start = 0x0110; start < 0x0118; ++start)
        for (std::size_t bytes = 1; bytes <= 17; ++bytes) {
            Chip chip;
            chip.busy_for = 3;
            Lan9252 esc(chip);
            const auto data = pattern(bytes, start);
            esc.write(static_cast<std::uint16_t>(start), data);
            EXPECT_TRUE(std::equal(data.begin(), data.end(), chip.memory.begin() + start));
            EXPECT_EQ(chip.memory[start - 1], std::byte{0});
            EXPECT_EQ(chip.memory[start + bytes], std::byte{0});
            std::vector<std::byte> back(bytes);
            esc.read(static_cast<std::uint16_t>(start), back);
            EXPECT_EQ(back, data);
            EXPECT_FALSE(esc.failed());
        }
}

TEST(Lan9252, EveryAddressAndLengthOfProcessMemory) {
    for (unsigned start = 0x1000; start < 0x1004; ++start)
        for (std::size_t bytes = 1; bytes <= 200; bytes += bytes < 70 ? 1 : 13) {
            Chip chip;
            chip.busy_for = 2;
            Lan9252 esc(chip);
            const auto data = pattern(bytes, start);
            esc.write(static_cast<std::uint16_t>(start), data);
            EXPECT_TRUE(std::equal(data.begin(), data.end(), chip.memory.begin() + start)) << start << " " << bytes;
            EXPECT_EQ(chip.memory[start + bytes], std::byte{0});
            std::vector<std::byte> back(bytes);
            esc.read(static_cast<std::uint16_t>(start), back);
            EXPECT_EQ(back, data) << start << " " << bytes;
            EXPECT_FALSE(esc.failed());
        }
}

TEST(Lan9252, DoubleWordsWhereTheyFit) {
    Chip chip;
    Lan9252 esc(chip);
    std::vector<std::byte> sync_manager(8);
    esc.read(0x0800, sync_manager);
    EXPECT_EQ(chip.csr_sizes, (std::vector<unsigned>{4, 4}));
}

TEST(Lan9252, AChipThatHangsIsToldAndNotWaitedForForEver) {
    Chip chip;
    chip.stuck = true;
    Lan9252 esc(chip);
    std::vector<std::byte> data(100, std::byte{1});
    esc.read(0x0130, MutableBytes(data).first(2));
    EXPECT_TRUE(esc.failed());
    EXPECT_LT(chip.transfers, 5000u);
}

}  // namespace
}  // namespace margay::samples
