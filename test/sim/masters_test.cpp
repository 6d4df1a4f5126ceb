// The frames of other masters, from the table in the notes "masters on the wire". For each column of that table, the
// test brings a segment from power-up to process data with the frames, start-up writes, SII access and mailbox access
// of that master, and checks the answers of the ESCs.
#include "rig.hpp"

#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

enum class Sii { eight_where_possible, igh, broadcast, four };
enum class Mail { status, whole_sm1, mapped_status, mapped_bit };
enum class Data { lrw_with_frmw, per_domain, lrd_lwr_and_reads, lrw_overlapping };

struct Master {
    const char* name;
    bool padded;
    std::array<std::uint8_t, 6> mac;
    std::uint16_t first_station;
    unsigned indices;  // number of values of the datagram index that the master uses
    bool broadcasts_by_index_0;
    Sii sii;
    Mail mail;
    Data data;
};

constexpr Master kMasters[] = {
    {"SOEM",
     false,
     {1, 1, 1, 1, 1, 1},
     0x1001,
     16,
     false,
     Sii::eight_where_possible,
     Mail::status,
     Data::lrw_with_frmw},
    {"IgH", true, {0x02, 0, 0, 0x11, 0x22, 0x33}, 0x0001, 256, false, Sii::igh, Mail::whole_sm1, Data::per_domain},
    {"KickCAT",
     true,
     {0xCA, 0xDE, 0xCA, 0xDE, 0xDE, 0xFF},
     0x03E9,
     256,
     true,
     Sii::broadcast,
     Mail::mapped_status,
     Data::lrd_lwr_and_reads},
    {"libethercat",
     false,
     {0x00, 0x30, 0x64, 0x0F, 0x83, 0x35},
     0x03E8,
     256,
     false,
     Sii::four,
     Mail::mapped_bit,
     Data::lrw_overlapping},
};

constexpr std::uint16_t kMailSlave = 1;
constexpr std::uint16_t kLamps = 2;

class MastersOnTheWire : public testing::TestWithParam<Master> {
  protected:
    Rig rig;
    void SetUp() override {
        rig.add(et1100(), sii_image(kEmulationWithDc));
        rig.add_with_processor(lan9252());
        rig.add(et1200(), sii_image(kDigitalIo));
        rig.on();
    }

    // Sends one frame as this master builds it, and checks properties that every answer must have.
    std::vector<Reply> frame(const std::vector<Rig::Request>& requests) {
        const auto& m = GetParam();
        std::vector<std::byte> raw(1518);
        wire::FrameBuilder builder(raw, m.mac);
        std::vector<std::uint8_t> indices;
        for (const auto& r : requests) {
            const bool broadcast = r.command == Command::BRD || r.command == Command::BWR;
            indices.push_back(m.broadcasts_by_index_0 && broadcast
                                  ? std::uint8_t{0}
                                  : static_cast<std::uint8_t>(next_index_++ % m.indices));
            const auto data = builder.append(r.command, indices.back(), r.address, r.data.size());
            std::copy(r.data.begin(), r.data.end(), data.begin());
        }
        const auto used = builder.finish().size();
        raw.resize(m.padded ? std::max<std::size_t>(used, 60) : used);
        std::fill(raw.begin() + static_cast<std::ptrdiff_t>(used), raw.end(), std::byte{0xA5});
        const auto sent = raw;
        rig.now += rig.step;
        EXPECT_TRUE(rig.segment.process(raw, rig.now).returned);
        EXPECT_TRUE(std::equal(raw.begin(), raw.begin() + 6, sent.begin())) << "still to everybody";
        EXPECT_EQ(raw[6], sent[6] | std::byte{2});
        EXPECT_TRUE(std::equal(raw.begin() + 7, raw.begin() + 14, sent.begin() + 7));
        EXPECT_TRUE(std::equal(raw.begin() + static_cast<std::ptrdiff_t>(used), raw.end(),
                               sent.begin() + static_cast<std::ptrdiff_t>(used)))
            << "padding comes back as it was";
        std::vector<Reply> replies;
        wire::DatagramReader reader(Bytes(raw).first(used));
        while (const auto d = reader.next()) {
            EXPECT_EQ(d->header.index, indices.at(replies.size()));
            replies.push_back({true, {}, d->header, {d->data.begin(), d->data.end()}, d->wkc, raw[6]});
        }
        EXPECT_EQ(replies.size(), requests.size());
        return replies;
    }
    Reply send(Command command, wire::DatagramAddress address, std::vector<std::byte> data) {
        return frame({{command, address, std::move(data)}}).at(0);
    }
    std::uint16_t broadcast(std::uint16_t address, std::vector<std::byte> data) {
        return send(Command::BWR, {std::uint16_t{0}, address}, std::move(data)).wkc;
    }
    Reply broadcast_read(std::uint16_t address, std::size_t length) {
        return send(Command::BRD, {std::uint16_t{0}, address}, std::vector<std::byte>(length));
    }
    wire::DatagramAddress at(std::uint16_t slave, std::uint16_t address) {
        return {StationAddress{static_cast<std::uint16_t>(GetParam().first_station + slave)}, address};
    }
    void assign_stations() {
        for (std::uint16_t n = 0; n < 3; ++n) {
            std::vector<std::byte> station(2);
            store_le<std::uint16_t>(station, 0, static_cast<std::uint16_t>(GetParam().first_station + n));
            EXPECT_EQ(send(Command::APWR, {RingPosition{n}, 0x0010}, station).wkc, 1);
        }
        EXPECT_EQ(send(Command::FPRD, at(2, 0x0010), bytes({0, 0})).as<std::uint16_t>(), GetParam().first_station + 2);
    }
    void set_mailbox() {
        EXPECT_EQ(send(Command::FPWR, at(kMailSlave, 0x0800),
                       bytes({0x00, 0x10, 0x80, 0, 0x26, 0, 1, 0, 0x80, 0x10, 0x80, 0, 0x22, 0, 1, 0}))
                      .wkc,
                  1);
    }
    void set_fmmu(std::uint16_t slave, unsigned n, const wire::Fmmu& fmmu) {
        std::vector<std::byte> raw(16);
        wire::store_fmmu(raw, fmmu);
        EXPECT_EQ(send(Command::FPWR, at(slave, reg::fmmu(n).address), raw).wkc, 1);
    }
    Reply logical(Command command, std::uint32_t address, std::vector<std::byte> data) {
        return send(command, wire::DatagramAddress(LogicalAddress{address}), std::move(data));
    }

  private:
    unsigned next_index_ = 0;
};

// Rows: frame length on the wire, source MAC, frame index; the start-up bursts below the table, in all their lengths.
TEST_P(MastersOnTheWire, StartUpBursts) {
    EXPECT_EQ(broadcast(0x0103, bytes({0})), 3);
    EXPECT_EQ(broadcast(0x0120, bytes({0x11})), 3);
    EXPECT_EQ(broadcast(0x0120, bytes({0x11})), 2) << "the processor has not read the first one yet: full";
    EXPECT_EQ(rig.pdi_get<std::uint8_t>(kMailSlave, 0x0120), 0x11);
    EXPECT_EQ(broadcast(0x0101, bytes({0})), 3);
    EXPECT_EQ(broadcast(0x0200, bytes({4, 0})), 3);
    for (const std::size_t n : {8u, 20u}) EXPECT_EQ(broadcast(0x0300, std::vector<std::byte>(n)), 3) << n;
    for (const std::size_t n : {48u, 128u, 256u}) EXPECT_EQ(broadcast(0x0600, std::vector<std::byte>(n)), 3) << n;
    for (const std::size_t n : {32u, 64u, 128u}) EXPECT_EQ(broadcast(0x0800, std::vector<std::byte>(n)), 3) << n;
    // The DC unit of the terminal is switched off.
    EXPECT_EQ(broadcast(0x0981, bytes({0})), 2);
    EXPECT_EQ(broadcast(0x0910, std::vector<std::byte>(32)), 2);
    EXPECT_EQ(broadcast(0x0930, bytes({0x00, 0x10})), 2);
    EXPECT_EQ(broadcast(0x0934, bytes({0x00, 0x0C})), 2);
    EXPECT_EQ(broadcast(0x0900, bytes({0, 0, 0, 0})), 3);
    EXPECT_EQ(broadcast(0x0010, bytes({0, 0})), 3);
    assign_stations();

    const auto type = broadcast_read(0x0000, 2);
    EXPECT_EQ(type.wkc, 3);
    EXPECT_EQ(type.data[0], std::byte{0x11 | 0xC0 | 0x12});
    EXPECT_EQ(broadcast_read(0x0000, 12).wkc, 3);
    EXPECT_EQ(broadcast_read(0x0007, 2).wkc, 3);
    EXPECT_EQ(send(Command::FPRD, at(0, 0x0007), bytes({0, 0})).as<std::uint16_t>(), 0xFC3B);
    EXPECT_EQ(send(Command::FPRD, at(1, 0x0140), bytes({0, 0})).as<std::uint16_t>(), kProcessor);
    EXPECT_EQ(send(Command::FPRD, at(0, 0x0910), std::vector<std::byte>(28)).wkc, 1);
    EXPECT_EQ(send(Command::FPRD, at(2, 0x0910), std::vector<std::byte>(28)).wkc, 0);
    EXPECT_EQ(broadcast_read(0x092C, 4).wkc, 2);
    EXPECT_EQ(broadcast_read(0x0130, 2).as<std::uint16_t>(), 0x0011) << "the emulated ones mirror the acknowledge bit";
}

// Row: SII access.
TEST_P(MastersOnTheWire, SiiAccess) {
    assign_stations();
    const std::uint64_t words = 0xA00BA00AA009A008;
    switch (GetParam().sii) {
        case Sii::eight_where_possible:
            for (std::uint16_t n = 0; n < 2; ++n) {
                const bool eight = (send(Command::FPRD, at(n, 0x0502), bytes({0, 0})).as<std::uint16_t>() & 0x40) != 0;
                EXPECT_EQ(eight, n == 0) << "0x0502 bit 6";
                EXPECT_EQ(send(Command::FPWR, at(n, 0x0502), bytes({0, 1, 8, 0, 0, 0})).wkc, 1);
                while ((send(Command::FPRD, at(n, 0x0502), bytes({0, 0})).as<std::uint16_t>() & 0x8000) != 0) {
                }
                const auto data = send(Command::FPRD, at(n, 0x0508), std::vector<std::byte>(eight ? 8 : 4));
                EXPECT_EQ(data.as<std::uint32_t>(), static_cast<std::uint32_t>(words));
                if (eight) {
                    EXPECT_EQ(data.as<std::uint64_t>(), words);
                }
            }
            break;
        case Sii::igh:
            for (std::uint16_t n = 0; n < 3; ++n) {
                EXPECT_EQ(send(Command::FPWR, at(n, 0x0502), bytes({0x80, 1, 8, 0})).wkc, 1);
                Reply reply;
                do reply = send(Command::FPRD, at(n, 0x0502), std::vector<std::byte>(10));
                while ((reply.as<std::uint16_t>() & 0x8100) == 0x8100);
                EXPECT_EQ(reply.as<std::uint16_t>() & 0x7800, 0);
                EXPECT_EQ(reply.as<std::uint32_t>(2), 8u) << "the address it wrote";
                EXPECT_EQ(reply.as<std::uint32_t>(6), static_cast<std::uint32_t>(words));
            }
            break;
        case Sii::broadcast:
            EXPECT_EQ(broadcast(0x0502, bytes({0, 1, 8, 0, 0, 0})), 3);
            while ((broadcast_read(0x0502, 2).as<std::uint16_t>() & 0x8000) != 0) {
            }
            for (std::uint16_t n = 0; n < 3; ++n)
                EXPECT_EQ(send(Command::FPRD, at(n, 0x0508), std::vector<std::byte>(4)).as<std::uint32_t>(),
                          static_cast<std::uint32_t>(words));
            break;
        case Sii::four:
            for (std::uint16_t n = 0; n < 3; ++n)
                for (const unsigned word : {8u, 10u}) {
                    EXPECT_EQ(send(Command::FPWR, at(n, 0x0502), bytes({0, 1, word, 0, 0, 0})).wkc, 1);
                    while ((send(Command::FPRD, at(n, 0x0502), bytes({0, 0})).as<std::uint16_t>() & 0x8000) != 0) {
                    }
                    EXPECT_EQ(send(Command::FPRD, at(n, 0x0508), std::vector<std::byte>(4)).as<std::uint32_t>(),
                              static_cast<std::uint32_t>(words >> (word == 8 ? 0 : 32)));
                }
            break;
    }
}

// Row: mailbox check.
TEST_P(MastersOnTheWire, MailboxCheck) {
    assign_stations();
    set_mailbox();
    const auto full = [&]() -> bool {
        switch (GetParam().mail) {
            case Mail::status: {
                EXPECT_EQ(send(Command::FPRD, at(kMailSlave, 0x0805), bytes({0})).data[0], std::byte{0})
                    << "room to write";
                const auto status = send(Command::FPRD, at(kMailSlave, 0x080D), bytes({0, 0}));
                return (status.data[0] & std::byte{8}) != std::byte{0};
            }
            case Mail::whole_sm1: {
                const auto sm = send(Command::FPRD, at(kMailSlave, 0x0808), std::vector<std::byte>(8));
                EXPECT_EQ(sm.as<std::uint16_t>(), 0x1080);
                return (sm.data[5] & std::byte{8}) != std::byte{0};
            }
            case Mail::mapped_status: {
                set_fmmu(kMailSlave, 2, {{0x2000}, 1, 0, 7, 0x080D, 0, true, false, true});
                const auto status = logical(Command::LRD, 0x2000, bytes({0}));
                EXPECT_EQ(status.wkc, 1);
                return (status.data[0] & std::byte{8}) != std::byte{0};
            }
            case Mail::mapped_bit: {
                set_fmmu(kMailSlave, 2, {{0x09000000}, 1, 0, 0, 0x080D, 3, true, false, true});
                const auto bit = logical(Command::LRD, 0x09000000, bytes({0}));
                EXPECT_EQ(bit.wkc, 1);
                return bit.data[0] == std::byte{1};
            }
        }
        return false;
    };
    EXPECT_FALSE(full());
    EXPECT_EQ(send(Command::FPRD, at(kMailSlave, 0x1080), std::vector<std::byte>(0x80)).wkc, 0) << "nothing to fetch";
    rig.slave(kMailSlave).write(0x1080, std::vector<std::byte>(0x80, std::byte{0x42}));
    EXPECT_TRUE(full());
    const auto mail = send(Command::FPRD, at(kMailSlave, 0x1080), std::vector<std::byte>(0x80));
    EXPECT_EQ(mail.wkc, 1);
    EXPECT_EQ(mail.data, std::vector<std::byte>(0x80, std::byte{0x42}));
    EXPECT_FALSE(full());
    EXPECT_EQ(send(Command::FPWR, at(kMailSlave, 0x1000), std::vector<std::byte>(0x80)).wkc, 1);
    EXPECT_EQ(send(Command::FPWR, at(kMailSlave, 0x1000), std::vector<std::byte>(0x80)).wkc, 0) << "full";
}

// Row: process data. The slave with the processor has two octets each way, the lamps have one octet of outputs.
TEST_P(MastersOnTheWire, ProcessData) {
    assign_stations();
    // SyncManager control 0x64 and 0x24: with the watchdog bit set by the master, or as in the SII.
    const unsigned control = GetParam().padded ? 0x24 : 0x64;
    EXPECT_EQ(send(Command::FPWR, at(kMailSlave, 0x0810),
                   bytes({0x00, 0x11, 2, 0, control, 0, 1, 0, 0x80, 0x11, 2, 0, 0x20, 0, 1, 0}))
                  .wkc,
              1);
    EXPECT_EQ(send(Command::FPWR, at(kLamps, 0x0800), bytes({0x00, 0x0F, 1, 0, 0x44, 0, 1, 0})).wkc, 1);
    rig.slave(kMailSlave).write(0x1180, bytes({0x51, 0x52}));
    const auto outputs = [&] {
        std::vector<std::byte> all(2);
        rig.slave(kMailSlave).read(0x1100, all);
        all.push_back(rig.slave(kLamps).peek(0x0F00, 1)[0]);
        return all;
    };
    switch (GetParam().data) {
        case Data::lrw_with_frmw: {  // outputs, then inputs; the clock's datagram in the same frame
            set_fmmu(kMailSlave, 0, {{0x10000}, 2, 0, 7, 0x1100, 0, false, true, true});
            set_fmmu(kLamps, 0, {{0x10002}, 1, 0, 7, 0x0F00, 0, false, true, true});
            set_fmmu(kMailSlave, 1, {{0x10003}, 2, 0, 7, 0x1180, 0, true, false, true});
            const auto replies =
                frame({{Command::LRW, wire::DatagramAddress(LogicalAddress{0x10000}), bytes({1, 2, 3, 0, 0})},
                       {Command::FRMW, at(0, 0x0910), std::vector<std::byte>(8)}});
            EXPECT_EQ(replies.at(0).wkc, 2 + 1 + 2);
            EXPECT_EQ(replies.at(0).data, bytes({1, 2, 3, 0x51, 0x52}));
            EXPECT_EQ(replies.at(1).wkc, 2) << "one reads its time, the other takes it; the terminal has none";
            EXPECT_EQ(logical(Command::LRD, 0x10003, bytes({0, 0})).wkc, 1) << "or apart: LRD …";
            EXPECT_EQ(logical(Command::LWR, 0x10000, bytes({1, 2, 3})).wkc, 2) << "… and LWR";
            break;
        }
        case Data::per_domain: {  // a domain of outputs only, a domain of inputs only, a domain of both
            set_fmmu(kMailSlave, 0, {{0x0000}, 2, 0, 7, 0x1100, 0, false, true, true});
            set_fmmu(kMailSlave, 1, {{0x0002}, 2, 0, 7, 0x1180, 0, true, false, true});
            set_fmmu(kLamps, 0, {{0x0100}, 1, 0, 7, 0x0F00, 0, false, true, true});
            const auto replies = frame({{Command::LRW, wire::DatagramAddress(LogicalAddress{0}), bytes({1, 2, 0, 0})},
                                        {Command::LWR, wire::DatagramAddress(LogicalAddress{0x100}), bytes({3})}});
            EXPECT_EQ(replies.at(0).wkc, 3);
            EXPECT_EQ(replies.at(0).data, bytes({1, 2, 0x51, 0x52}));
            EXPECT_EQ(replies.at(1).wkc, 1);
            EXPECT_EQ(logical(Command::LRD, 0x0002, bytes({0, 0})).data, bytes({0x51, 0x52}));
            break;
        }
        case Data::lrd_lwr_and_reads: {  // both at one logical address, and many FPRD in a frame
            set_fmmu(kMailSlave, 0, {{0x1000}, 2, 0, 7, 0x1100, 0, false, true, true});
            set_fmmu(kMailSlave, 1, {{0x1000}, 2, 0, 7, 0x1180, 0, true, false, true});
            set_fmmu(kLamps, 0, {{0x1002}, 1, 0, 7, 0x0F00, 0, false, true, true});
            const auto replies = frame({{Command::LWR, wire::DatagramAddress(LogicalAddress{0x1000}), bytes({1, 2, 3})},
                                        {Command::LRD, wire::DatagramAddress(LogicalAddress{0x1000}), bytes({0, 0, 0})},
                                        {Command::FPRD, at(0, 0x0130), bytes({0, 0})},
                                        {Command::FPRD, at(1, 0x0130), bytes({0, 0})},
                                        {Command::FPRD, at(2, 0x0130), bytes({0, 0})},
                                        {Command::FPRD, at(1, 0x0300), std::vector<std::byte>(20)}});
            EXPECT_EQ(replies.at(0).wkc, 2);
            EXPECT_EQ(replies.at(1).wkc, 1);
            EXPECT_EQ(replies.at(1).data, bytes({0x51, 0x52, 0}));
            for (std::size_t i = 2; i < 6; ++i) EXPECT_EQ(replies.at(i).wkc, 1) << i;
            break;
        }
        case Data::lrw_overlapping: {
            set_fmmu(kMailSlave, 0, {{0x8000}, 2, 0, 7, 0x1100, 0, false, true, true});
            set_fmmu(kMailSlave, 1, {{0x8000}, 2, 0, 7, 0x1180, 0, true, false, true});
            set_fmmu(kLamps, 0, {{0x8002}, 1, 0, 7, 0x0F00, 0, false, true, true});
            const auto reply = logical(Command::LRW, 0x8000, bytes({1, 2, 3}));
            EXPECT_EQ(reply.wkc, 5);
            EXPECT_EQ(reply.data, bytes({0x51, 0x52, 3}));
            break;
        }
    }
    EXPECT_EQ(outputs(), bytes({1, 2, 3}));
}

INSTANTIATE_TEST_SUITE_P(Each, MastersOnTheWire, testing::ValuesIn(kMasters),
                         [](const auto& master) { return std::string(master.param.name); });

// TwinCAT sends several frames in sequence and expects them in order: the second reads what the first writes.
TEST(TwinCat, FramesBackToBack) {
    Rig rig;
    rig.add(et1100(), sii_image(kEmulationWithDc));
    rig.on();
    rig.step = 0ns;
    for (unsigned i = 1; i <= 20; ++i) {
        EXPECT_EQ(rig.put<std::uint16_t>(0, 0x0010, static_cast<std::uint16_t>(i)), 1);
        EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0010), i);
    }
}

}  // namespace
}  // namespace margay::sim::test
