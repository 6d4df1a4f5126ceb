// tshark decodes the frames of the clients and of the gateway: EtherCAT over UDP and TCP at port 34980, and the mailbox
// messages.
#include "gateway/gateway_bench.hpp"
#include "wire/mailbox_pcap.hpp"

#include <filesystem>
#include <fstream>

namespace margay {
namespace {

using testing_tshark::number;

std::string big_endian(std::uint32_t value, int bytes) {
    auto out = number(value, bytes);
    std::ranges::reverse(out);
    return out;
}

// A pcap file of these frames, in IPv4 with UDP or TCP.
class IpPcap {
  public:
    explicit IpPcap(const std::string& path) : file_(path, std::ios::binary) {
        file_ << number(0xA1B2C3D4, 4) << number(2, 2) << number(4, 2) << number(0, 8) << number(65535, 4)
              << number(1, 4);
    }
    void add(const Traffic::One& one) {
        const std::string payload(reinterpret_cast<const char*>(one.frame.data()), one.frame.size());
        const std::size_t head = one.udp ? 8 : 20;
        const auto ports =
            one.to_gateway ? big_endian(50000, 2) + big_endian(34980, 2) : big_endian(34980, 2) + big_endian(50000, 2);
        std::string transport = ports;
        if (one.udp) {
            transport += big_endian(static_cast<std::uint32_t>(head + payload.size()), 2) + number(0, 2);
        } else {
            auto& sent = sent_[one.to_gateway ? 0 : 1];
            transport += big_endian(sent, 4) + big_endian(sent_[one.to_gateway ? 1 : 0], 4) +
                         std::string("\x50\x18\x10\x00\x00\x00\x00\x00", 8);
            sent += static_cast<std::uint32_t>(payload.size());
        }
        std::string packet(12, '\x02');
        packet += std::string("\x08\x00", 2) + std::string("\x45\x00", 2) +
                  big_endian(static_cast<std::uint32_t>(20 + head + payload.size()), 2) + number(0, 4) +
                  std::string(1, '\x40') + std::string(1, one.udp ? '\x11' : '\x06') + number(0, 2) +
                  std::string("\x7F\x00\x00\x01\x7F\x00\x00\x01", 8) + transport + payload;
        file_ << number(++count_, 4) << number(0, 4) << number(packet.size(), 4) << number(packet.size(), 4) << packet;
    }

  private:
    std::ofstream file_;
    std::uint32_t count_ = 0;
    std::array<std::uint32_t, 2> sent_{1, 1};
};

class GatewayTshark : public GatewayTest {};

TEST_F(GatewayTshark, DecodesEveryFrameOverUdpAndTcp) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    Traffic::all().clear();
    const auto talk = [&](Over over) {
        GatewayClient client(gateway->port(), over, true);
        EXPECT_FALSE(upload(client, kOdd, 0x2002, 0).empty());
        EXPECT_TRUE(download(client, kOdd, 0x2003, 0, Octets(1024), kRoom));
        EXPECT_FALSE(upload(client, 0, 0xF020, 1).empty());
        (void)client.ask(kOdd, kCoe, sdo(0x40, 0x5FFF, 0));
        (void)client.ask(kOdd, kCoe, octets({0x00, 0x80, 0x03, 0, 0, 0, 0x00, 0x10}));
        (void)client.ask(kAxes, kSoe, octets({0x21, 0x40, 0x01, 0x00}));
        (void)client.ask(kPort, kEoe, octets({0x06, 0x00, 0x00, 0x00}));
        (void)client.ask(0x1FFF, kCoe, sdo(0x40, 0x1000, 0));
    };
    EXPECT_EQ(run({[&] {
                  talk(Over::udp);
                  talk(Over::tcp);
              }}),
              0);
    const auto file =
        std::filesystem::temp_directory_path() / ("margay-gateway-" + std::to_string(::getpid()) + ".pcap");
    {
        IpPcap pcap(file.string());
        for (const auto& one : Traffic::all()) pcap.add(one);
    }
    const auto packets = testing_tshark::fields_of(
        file.string(), {"frame.number", "_ws.malformed", "frame.protocols", "ecatf.type", "ecatf.length",
                        "ecat_mailbox.length", "ecat_mailbox.address", "ecat_mailbox.coe.type",
                        "ecat_mailbox.soe_opcode", "ecat_mailbox.eoe.type", "ecat_mailbox.coe.sdoidx"});
    ASSERT_EQ(packets.size(), Traffic::all().size());
    std::array<std::size_t, 2> coe{};
    std::size_t soe = 0;
    std::size_t eoe = 0;
    std::size_t errors = 0;
    std::set<std::string> indices;
    for (std::size_t n = 0; n < packets.size(); ++n) {
        const auto& columns = packets[n];
        const auto& one = Traffic::all()[n];
        ASSERT_EQ(columns.size(), 11U);
        EXPECT_EQ(columns[1], "") << "malformed: packet " << columns[0];
        const std::string path = one.udp ? "udp:ecatf:ecat_mailbox" : "tcp:ecatf:ecat_mailbox";
        EXPECT_NE(columns[2].find(path), std::string::npos) << columns[0] << ": " << columns[2];
        EXPECT_EQ(std::stoul(columns[3], nullptr, 0), 5U);
        EXPECT_EQ(std::stoul(columns[4], nullptr, 0), one.frame.size() - 2);
        EXPECT_EQ(std::stoul(columns[5], nullptr, 0), one.frame.size() - 8);
        EXPECT_EQ(std::stoul(columns[6], nullptr, 0), testing_gateway::number(one.frame, 4, 2));
        coe[one.udp ? 0 : 1] += columns[7].empty() ? 0 : 1;
        soe += columns[8].empty() ? 0 : 1;
        indices.insert(columns[10]);
        eoe += columns[9].empty() ? 0 : 1;
        errors += columns[7].empty() && columns[8].empty() && columns[9].empty() ? 1 : 0;
    }
    EXPECT_GT(coe[0], 40U);
    EXPECT_EQ(coe[0], coe[1]);
    EXPECT_EQ(soe, 4U);
    for (const char* index : {"0x2002", "0x2003", "0xf020", "0x5fff"}) EXPECT_EQ(indices.count(index), 1U) << index;
    EXPECT_EQ(eoe, 4U);
    EXPECT_EQ(errors, 2U) << "tshark shows an error reply as plain data";
    std::error_code ignored;
    if (!HasFailure()) std::filesystem::remove(file, ignored);
}

}  // namespace
}  // namespace margay
