// Random configurations. A small interpreter of FMMUs, written from the standard and without code of the planner,
// executes the datagrams on the slaves. Each slave must get exactly its bits, and the working counters must be the
// expected ones.
#include "network/image_datagrams.hpp"
#include "process_data/slaves.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

namespace margay {
namespace {

using Octets = std::vector<std::uint8_t>;

bool bit_of(const Octets& octets, std::size_t bit) { return ((octets[bit / 8] >> (bit % 8)) & 1) != 0; }
void set_bit(Octets& octets, std::size_t bit, bool value) {
    const auto mask = static_cast<std::uint8_t>(1U << (bit % 8));
    octets[bit / 8] = static_cast<std::uint8_t>(value ? octets[bit / 8] | mask : octets[bit / 8] & ~mask);
}

// An ESC that has only FMMU registers and 64 KiB of memory.
struct Esc {
    Octets memory = Octets(0x10000);
    Octets written = Octets(0x10000);  // bits that a datagram wrote
    std::array<Octets, 16> fmmus;

    struct Mapping {
        std::uint64_t first_bit, end_bit;  // logical address in bits
        std::uint64_t physical_bit;
        bool read, write;
    };
    std::vector<Mapping> mappings() const {
        std::vector<Mapping> all;
        for (const Octets& r : fmmus) {
            if ((r[12] & 1) == 0) continue;
            const std::uint64_t logical =
                r[0] | (std::uint64_t{r[1]} << 8) | (std::uint64_t{r[2]} << 16) | (std::uint64_t{r[3]} << 24);
            const std::uint64_t length = static_cast<std::uint64_t>(r[4] | (r[5] << 8));
            const std::uint64_t physical = static_cast<std::uint64_t>(r[8] | (r[9] << 8));
            all.push_back({logical * 8 + r[6], (logical + length - 1) * 8 + r[7] + 1, physical * 8 + r[10],
                           (r[11] & 1) != 0, (r[11] & 2) != 0});
        }
        return all;
    }

    // An octet belongs to the first FMMU of the direction that contains it.
    unsigned pass(wire::Command command, std::uint64_t address, Octets& data) {
        bool was_read = false;
        bool was_written = false;
        const Octets sent = data;
        const auto all = mappings();
        const auto touches = [](const Mapping& m, std::uint64_t octet) {
            return m.first_bit / 8 <= octet && octet <= (m.end_bit - 1) / 8;
        };
        for (std::size_t i = 0; i < data.size(); ++i) {
            for (const bool reading : {true, false}) {
                if (reading ? command == wire::Command::LWR : command == wire::Command::LRD) continue;
                const auto m = std::find_if(all.begin(), all.end(), [&](const Mapping& one) {
                    return (reading ? one.read : one.write) && touches(one, address + i);
                });
                if (m == all.end()) continue;
                (reading ? was_read : was_written) = true;
                for (std::uint64_t bit = 0; bit < 8; ++bit) {
                    const std::uint64_t logical = (address + i) * 8 + bit;
                    if (logical < m->first_bit || logical >= m->end_bit) continue;
                    const std::uint64_t physical = m->physical_bit + (logical - m->first_bit);
                    if (reading) {
                        set_bit(data, i * 8 + bit, bit_of(memory, physical));
                    } else {
                        set_bit(memory, physical, bit_of(sent, i * 8 + bit));
                        set_bit(written, physical, true);
                    }
                }
            }
        }
        return (was_read ? 1U : 0U) + (was_written ? (command == wire::Command::LRW ? 2U : 1U) : 0U);
    }
};

struct Case {
    std::vector<Slave> slaves;
    GroupConfiguration wanted;
};

Case random_case(std::mt19937& random) {
    const auto below = [&](unsigned n) { return static_cast<unsigned>(random() % n); };
    Case c;
    c.wanted = {.start = {below(2) * 0x12345678U},
                .packing = below(2) ? Packing::bits : Packing::bytes,
                .overlapped = below(3) == 0,
                .block_lrw = below(3) == 0,
                .reserve_bytes = static_cast<std::uint16_t>(below(2) * below(60))};
    const unsigned count = below(40);
    const unsigned largest = below(4) == 0 ? 8000 : below(2) == 0 ? 400 : 20;  // bits
    for (std::uint16_t n = 1; n <= count; ++n) {
        Slave slave = make_slave(n, 16, 16);
        slave.dl.ram_kib = 60;
        slave.config.group = static_cast<std::uint8_t>(below(8) == 0 ? 1 : 0);
        if (below(5) == 0) slave.dl.features = wire::features::kFmmuBitOperationNotSupported;
        slave.config.block_lrw = below(50) == 0;
        slave.config.mailbox_status = below(3) == 0;
        if (below(2) == 0) slave.mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE};
        const unsigned sms = below(5);
        auto start = static_cast<std::uint16_t>(0x1200);
        for (unsigned k = 0; k < sms; ++k) {
            const std::uint32_t bits = below(6) == 0 ? 0 : 1 + below(largest);
            const auto number = static_cast<std::uint8_t>(2 + k);
            slave.config.add(below(2) == 0 ? outputs_sm(number, start, bits) : inputs_sm(number, start, bits));
            start = static_cast<std::uint16_t>(start + (bits + 7) / 8 + (below(2) == 0 ? 0 : 3 * (bits / 8 + 1)));
        }
        c.slaves.push_back(slave);
    }
    return c;
}

// Executes the complete exchange of a case, for the master and for the slaves.
void check(Case& c, std::mt19937& random) {
    std::vector<std::byte> buffer(200000);
    const auto layout = lay_out(c.slaves, 0, c.wanted, buffer);
    ASSERT_TRUE(layout.ok());
    std::vector<DatagramPlan> datagrams(200);
    const auto count = plan_datagrams(c.slaves, 0, c.wanted, *layout, datagrams);
    ASSERT_TRUE(count.ok());
    datagrams.resize(*count);

    std::vector<Esc> escs(c.slaves.size());
    for (std::size_t n = 0; n < escs.size(); ++n) {
        for (auto& octet : escs[n].memory) octet = static_cast<std::uint8_t>(random());
        for (auto& fmmu : escs[n].fmmus) fmmu = Octets(16);
        if (c.slaves[n].config.group != 0) continue;
        const auto fmmus = make_fmmus(c.slaves[n], *layout);
        ASSERT_TRUE(fmmus.ok());
        for (std::size_t i = 0; i < 16; ++i) {
            std::array<std::byte, 16> bytes{};
            wire::store_fmmu(bytes, fmmus->at[i]);
            std::transform(bytes.begin(), bytes.end(), escs[n].fmmus[i].begin(),
                           [](std::byte b) { return static_cast<std::uint8_t>(b); });
        }
    }
    const std::vector<Esc> before = escs;

    // The exchange.
    Octets image(layout->image_bytes());
    for (auto& octet : image) octet = static_cast<std::uint8_t>(random());
    const Octets sent = image;
    std::map<unsigned, std::size_t> frame_bytes;
    for (const DatagramPlan& d : datagrams) {
        Octets data(d.bytes);
        ASSERT_LE(d.output_bytes, d.bytes);
        ASSERT_LE(d.input_at + d.input_bytes, d.bytes);
        std::copy_n(sent.begin() + d.image_output, d.output_bytes, data.begin());
        unsigned wkc = 0;
        for (Esc& esc : escs) wkc += esc.pass(d.command, d.address.value, data);
        EXPECT_EQ(wkc, d.expected_wkc);
        std::copy_n(data.begin() + d.input_at, d.input_bytes, image.begin() + d.image_input);
        frame_bytes[d.frame] += d.bytes + 12U;
    }
    for (const auto& [frame, bytes] : frame_bytes) EXPECT_LE(bytes + (frame == 0 ? c.wanted.reserve_bytes : 0U), 1498U);
    const std::uint32_t status_begin =
        layout->status_bytes == 0 ? 0xFFFF'FFFF : c.wanted.start.value + layout->logical_bytes() - layout->status_bytes;
    // The number of frames is not larger than the data would need if a slave could be divided anywhere.
    if (!datagrams.empty()) {
        std::size_t overheads = c.wanted.reserve_bytes;
        for (std::size_t n = 0; n < datagrams.size(); ++n) {
            const bool begins_a_range = n == 0 || datagrams[n].command != datagrams[n - 1].command ||
                                        datagrams[n].address.value == status_begin;
            overheads += begins_a_range ? 12U : 0U;
        }
        std::size_t octets = 0;
        for (const DatagramPlan& d : datagrams) octets += d.bytes;
        std::size_t frames = 1;
        while (octets + overheads + (frames - 1) * 12 > frames * 1498) ++frames;
        EXPECT_LE(datagrams.back().frame + 1U, frames);
    }

    for (std::size_t n = 0; n < escs.size(); ++n) {
        const Slave& slave = c.slaves[n];
        if (slave.config.group != 0) {
            EXPECT_EQ(escs[n].memory, before[n].memory);
            continue;
        }
        Octets may_write(0x10000);
        for (std::size_t k = 0; k < slave.config.sm_count; ++k) {
            const ProcessSm& sm = slave.config.sms[k];
            if (sm.bits == 0) continue;
            const std::size_t at = sm_offset_bits(slave, c.wanted.packing, k);
            for (std::size_t bit = 0; bit < sm.bits; ++bit) {
                const bool out = sm.direction == Direction::outputs;
                const bool in_slave = bit_of(out ? escs[n].memory : before[n].memory, std::size_t{sm.start} * 8 + bit);
                ASSERT_EQ(in_slave, bit_of(out ? sent : image, at + bit))
                    << "slave " << slave.number << " sm " << k << " bit " << bit;
            }
            if (sm.direction == Direction::outputs)
                for (std::size_t octet = 0; octet < sm.bytes(); ++octet) may_write[sm.start + octet] = 0xFF;
        }
        std::size_t wrong = 0;
        for (std::size_t i = 0; i < 0x10000; ++i) wrong += (escs[n].written[i] & ~may_write[i]) != 0 ? 1 : 0;
        ASSERT_EQ(wrong, 0U) << "slave " << slave.number << ": written beside its SyncManagers";
        if (slave.image.mailbox_status_bit != SlaveImage::kNone) {
            EXPECT_EQ(bit_of(image, slave.image.mailbox_status_bit), (before[n].memory[0x080D] & 8) != 0);
        }
    }
}

class ImageProperty : public testing::TestWithParam<unsigned> {};

TEST_P(ImageProperty, EverySlaveGetsExactlyItsBits) {
    std::mt19937 random(GetParam());
    for (int i = 0; i < 20; ++i) {
        Case c = random_case(random);
        check(c, random);
        if (HasFatalFailure()) FAIL() << "seed " << GetParam() << " case " << i;
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, ImageProperty, testing::Range(1U, 13U));

}  // namespace
}  // namespace margay
