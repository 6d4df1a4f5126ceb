// EoE layouts: octets by hand from ETG.1000.6 "Ethernet over EtherCAT coding", and from tshark. Fragments put together,
// right and wrong.
#include "wire/eoe_assembly.hpp"
#include "wire/mailbox_pcap.hpp"

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <filesystem>

namespace margay::wire::eoe {
namespace {

using Octets = std::vector<std::byte>;

Octets octets_from(std::initializer_list<unsigned> values) {
    Octets out;
    for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

Octets eoe_counted(std::size_t bytes) {
    Octets out(bytes);
    for (std::size_t n = 0; n < bytes; ++n) out[n] = static_cast<std::byte>(n * 5 + n / 256);
    return out;
}

EoeIp whole_ip() {
    EoeIp ip{.mac = MacAddress{1, 2, 3, 4, 5, 6},
             .address = Ipv4Address{192, 168, 0, 1},
             .subnet_mask = Ipv4Address{255, 255, 255, 0},
             .default_gateway = Ipv4Address{10, 11, 12, 13},
             .dns_server = Ipv4Address{8, 9, 10, 11}};
    EXPECT_TRUE(ip.set_host_name("press-7"));
    return ip;
}

TEST(EoeWire, TheHeaderHasItsBits) {
    Octets at(4);
    store_header(at, Header{.port = 3,
                            .last = true,
                            .time_appended = true,
                            .time_requested = true,
                            .fragment = 5,
                            .blocks = 46,
                            .frame_number = 9});
    // 0x0730: type 0, port 3, last, appended, requested. 0x9B85: fragment 5, 46 << 6, 9 << 12.
    EXPECT_EQ(at, octets_from({0x30, 0x07, 0x85, 0x9B}));
    EXPECT_EQ(load_header(at), (Header{.port = 3,
                                       .last = true,
                                       .time_appended = true,
                                       .time_requested = true,
                                       .fragment = 5,
                                       .blocks = 46,
                                       .frame_number = 9}));
    store_header(at, Type::set_ip_response, EoeResult::no_ip_support);
    EXPECT_EQ(at, octets_from({0x03, 0x01, 0x01, 0x02}));
}

// Addresses are numbers: least significant octet first.
TEST(EoeWire, IpParametersHaveTheirPlaces) {
    Octets at(kIpBytes, std::byte{0xEE});
    EXPECT_EQ(store_ip(at, whole_ip()), kIpBytes);
    Octets expected = octets_from({0x3F, 0,  0,  0,  1,  2,  3,  4, 5, 6,   1,   0,   168, 192, 0,   255, 255,
                                   255,  13, 12, 11, 10, 11, 10, 9, 8, 'p', 'r', 'e', 's', 's', '-', '7'});
    expected.resize(kIpBytes);
    EXPECT_EQ(at, expected);
    EXPECT_EQ(load_ip(at), whole_ip());
    // One parameter, in its place and packed.
    EoeIp one{.subnet_mask = Ipv4Address{255, 255, 0, 0}, .append_time_stamp = true};
    EXPECT_EQ(store_ip(at, one), kIpBytes);
    expected = octets_from({4, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255});
    expected.resize(kIpBytes);
    EXPECT_EQ(at, expected);
    EXPECT_EQ(load_ip(at), one);
    EXPECT_EQ(store_ip(at, one, true), 8U);
    EXPECT_EQ(Octets(at.begin(), at.begin() + 8), octets_from({4, 0, 1, 0, 0, 0, 255, 255}));
    EXPECT_EQ(load_ip(Bytes(at).first(8)), one);
}

TEST(EoeWire, IpParametersThatAreCutAreNotRead) {
    Octets at(kIpBytes);
    (void)store_ip(at, whole_ip());
    for (std::size_t n = 0; n < kIpBytes; ++n) EXPECT_FALSE(load_ip(Bytes(at).first(n)).has_value()) << n;
    EoeIp name;
    ASSERT_TRUE(name.set_host_name(std::string(32, 'x')));
    EXPECT_FALSE(name.set_host_name(std::string(33, 'y')));
    (void)store_ip(at, name);
    EXPECT_EQ(load_ip(at)->host_name(), std::string(32, 'x'));
}

TEST(EoeWire, AFilterHasItsPlaces) {
    EoeFilter filter{.address_count = 2, .mask_count = 1, .no_broadcasts = true};
    filter.addresses[0] = {1, 2, 3, 4, 5, 6};
    filter.addresses[1] = {0x21, 0x22, 0x23, 0x24, 0x25, 0x26};
    filter.masks[0] = {0xFF, 0xFF, 0xFF, 0, 0, 0};
    Octets at(kFilterBytes, std::byte{0xEE});
    store_filter(at, filter);
    Octets expected = octets_from({0x92, 0, 1, 2, 3, 4, 5, 6, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26});
    expected.resize(kFilterBytes);
    for (std::size_t n = 98; n < 101; ++n) expected[n] = std::byte{0xFF};
    EXPECT_EQ(at, expected);
    EXPECT_EQ(load_filter(at), filter);
    for (std::size_t n = 0; n < kFilterBytes; ++n) EXPECT_FALSE(load_filter(Bytes(at).first(n)).has_value());
}

TEST(EoeWire, AFilterSelectsByAddressMaskAndBroadcast) {
    EoeFilter filter;
    const MacAddress broadcast{255, 255, 255, 255, 255, 255};
    EXPECT_TRUE(filter.passes({1, 2, 3, 4, 5, 6}));
    EXPECT_TRUE(filter.passes(broadcast));
    filter.no_broadcasts = true;
    EXPECT_FALSE(filter.passes(broadcast));
    filter.address_count = 1;
    filter.addresses[0] = {1, 2, 3, 4, 5, 6};
    EXPECT_TRUE(filter.passes({1, 2, 3, 4, 5, 6}));
    EXPECT_FALSE(filter.passes({1, 2, 3, 4, 5, 7}));
    filter.mask_count = 1;
    filter.masks[0] = {255, 255, 255, 255, 255, 0};
    EXPECT_TRUE(filter.passes({1, 2, 3, 4, 5, 7}));
    EXPECT_FALSE(filter.passes({1, 2, 3, 4, 6, 6}));
}

// For every size of frame and room: blocks of 32 octets, and no octet too much.
TEST(EoeWire, FragmentsFitTheirRoom) {
    for (std::size_t room = kLeastRoom + kTimeStampBytes; room < 200; ++room)
        for (std::size_t whole = kLeastFrameBytes; whole < 700; ++whole)
            for (const std::size_t appended : {std::size_t{0}, kTimeStampBytes}) {
                std::size_t left = whole;
                while (left != 0) {
                    const std::size_t bytes = fragment_bytes(left, room, appended);
                    ASSERT_TRUE(bytes > 0 && bytes <= left) << room << " " << whole;
                    const bool last = bytes == left;
                    ASSERT_LE(bytes + (last ? appended : 0), room - kHeaderBytes) << room << " " << whole;
                    if (!last) {
                        ASSERT_EQ(bytes % kBlockBytes, 0U);
                    }
                    left -= bytes;
                }
            }
}

// ------------------------------------------------------------------ fragments put together

using Took = Assembly::Took;

class EoeAssemblyTest : public testing::Test {
  protected:
    Octets memory = Octets(256 + 16, std::byte{0xA5});
    Assembly assembly;
    EoeAssemblyTest() { assembly.use(MutableBytes(memory).first(256)); }
    ~EoeAssemblyTest() override {
        EXPECT_TRUE(std::all_of(memory.begin() + 256, memory.end(), [](std::byte b) { return b == std::byte{0xA5}; }));
    }
    Took add(unsigned fragment, unsigned blocks, const Octets& data, bool last = false, unsigned number = 1,
             bool stamped = false) {
        return assembly.add(Header{.last = last,
                                   .time_appended = stamped,
                                   .fragment = static_cast<std::uint8_t>(fragment),
                                   .blocks = static_cast<std::uint8_t>(blocks),
                                   .frame_number = static_cast<std::uint8_t>(number)},
                            data);
    }
};

TEST_F(EoeAssemblyTest, FragmentsInOrderAreAFrame) {
    const auto frame = eoe_counted(150);
    EXPECT_EQ(add(0, 5, Octets(frame.begin(), frame.begin() + 64)), Took::more);
    EXPECT_TRUE(assembly.busy());
    EXPECT_EQ(add(1, 2, Octets(frame.begin() + 64, frame.begin() + 128)), Took::more);
    EXPECT_EQ(add(2, 4, Octets(frame.begin() + 128, frame.end()), true), Took::whole);
    EXPECT_EQ(Octets(assembly.frame().begin(), assembly.frame().end()), frame);
    EXPECT_FALSE(assembly.time_stamp().has_value());
    EXPECT_FALSE(assembly.busy());
}

// The size may count the time stamp or not, and the last fragment may be a time stamp alone.
TEST_F(EoeAssemblyTest, ATimeStampIsNoPartOfTheFrame) {
    auto data = eoe_counted(64);
    const auto stamp = octets_from({4, 3, 2, 1});
    Octets stamped = data;
    stamped.insert(stamped.end(), stamp.begin(), stamp.end());
    for (const unsigned blocks : {2U, 3U}) {
        EXPECT_EQ(add(0, blocks, stamped, true, 1, true), Took::whole);
        EXPECT_EQ(assembly.frame().size(), 64U);
        EXPECT_EQ(assembly.time_stamp(), 0x01020304U);
        EXPECT_EQ(add(0, blocks, data), Took::more);
        EXPECT_EQ(add(1, 2, stamp, true, 1, true), Took::whole);
        EXPECT_EQ(assembly.frame().size(), 64U);
        EXPECT_EQ(assembly.time_stamp(), 0x01020304U);
    }
    EXPECT_EQ(add(0, 1, octets_from({1, 2, 3}), true, 1, true), Took::malformed);
}

TEST_F(EoeAssemblyTest, AMissingFragmentDropsTheFrame) {
    const auto part = eoe_counted(32);
    EXPECT_EQ(add(1, 1, part), Took::out_of_order);  // without a beginning
    EXPECT_EQ(add(0, 4, part), Took::more);
    EXPECT_EQ(add(2, 2, part), Took::out_of_order);  // number
    EXPECT_EQ(add(1, 1, part), Took::out_of_order);  // the frame was dropped
    EXPECT_EQ(add(0, 4, part), Took::more);
    EXPECT_EQ(add(1, 2, part), Took::out_of_order);  // offset
    EXPECT_EQ(add(0, 4, part), Took::more);
    EXPECT_EQ(add(1, 1, part, false, 2), Took::out_of_order);  // another frame
    EXPECT_EQ(add(0, 4, part), Took::more);
    EXPECT_EQ(add(0, 1, part, true), Took::whole);  // a new beginning
}

TEST_F(EoeAssemblyTest, SizesThatLieDropTheFrame) {
    const auto part = eoe_counted(32);
    EXPECT_EQ(add(0, 0, part, true), Took::malformed);             // no block announced
    EXPECT_EQ(add(0, 2, part, true), Took::malformed);             // less than announced
    EXPECT_EQ(add(0, 1, eoe_counted(33), true), Took::malformed);  // more than announced
    EXPECT_EQ(add(0, 4, eoe_counted(31)), Took::malformed);        // no whole block
    EXPECT_EQ(add(0, 4, {}), Took::malformed);                     // no octets, and more fragments follow
    EXPECT_EQ(add(0, 1, eoe_counted(13), true), Took::malformed);  // shorter than an Ethernet header
    EXPECT_EQ(add(0, 9, part), Took::too_long);                    // longer than the memory
    EXPECT_EQ(add(0, 8, eoe_counted(288)), Took::too_long);
    // Fragments after the announced size are refused.
    EXPECT_EQ(add(0, 2, part), Took::more);
    EXPECT_EQ(add(1, 1, part), Took::more);
    EXPECT_EQ(add(2, 2, part), Took::malformed);
    EXPECT_EQ(add(3, 3, part), Took::out_of_order);
}

// ------------------------------------------------------------------ tshark

TEST(EoeTshark, DecodesTheSameValues) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    const auto file = std::filesystem::temp_directory_path() / ("margay-eoe-" + std::to_string(::getpid()) + ".pcap");
    {
        testing_tshark::MailboxPcap pcap(file.string());
        const auto add = [&](const Octets& data) {
            Octets message(kMailboxHeaderBytes);
            store_mailbox_header(
                message, {.length = static_cast<std::uint16_t>(data.size()), .type = MailboxType::eoe, .counter = 1});
            message.insert(message.end(), data.begin(), data.end());
            pcap.add(message);
        };
        Octets set_ip(kHeaderBytes + kIpBytes);
        store_header(set_ip, Type::set_ip_request, EoeResult::success);
        (void)store_ip(MutableBytes(set_ip).subspan(kHeaderBytes), whole_ip());
        add(set_ip);
        Octets fragment(kHeaderBytes + 64);
        store_header(fragment, Header{.last = false, .fragment = 21, .blocks = 44, .frame_number = 11});
        add(fragment);
        store_header(fragment, Header{.last = true, .time_appended = true, .blocks = 2, .frame_number = 3});
        for (std::size_t n = 0; n < 14; ++n) fragment[kHeaderBytes + n] = std::byte{0x88};  // type 0x8888
        add(fragment);
        Octets time(kHeaderBytes + kTimeStampBytes);
        store_header(time, {.type = Type::time_stamp_response});
        add(time);
    }
    const auto packets = testing_tshark::fields_of(
        file.string(),
        {"ecat_mailbox.eoe.type", "ecat_mailbox.eoe.init.macaddr", "ecat_mailbox.eoe.init.ipaddr",
         "ecat_mailbox.eoe.init.subnetmask", "ecat_mailbox.eoe.init.defaultgateway", "ecat_mailbox.eoe.init.dnsserver",
         "ecat_mailbox.eoe.init.dnsname", "ecat_mailbox.eoe.fragno", "ecat_mailbox.eoe.offset",
         "ecat_mailbox.eoe.frame", "ecat_mailbox.eoe.last", "ecat_mailbox.eoe.timestampapp", "_ws.malformed"});
    ASSERT_EQ(packets.size(), 4U);
    using Row = std::vector<std::string>;
    EXPECT_EQ(packets[0], (Row{"2", "01:02:03:04:05:06", "192.168.0.1", "255.255.255.0", "10.11.12.13", "8.9.10.11",
                               "press-7", "", "", "", "", "", ""}));
    EXPECT_EQ(packets[1], (Row{"0", "", "", "", "", "", "", "21", "1408", "11", "0", "", ""}));
    EXPECT_EQ(packets[2][8], "64") << "the size of the frame, which tshark shows in the column of the offset";
    EXPECT_EQ(packets[2][11], "1");
    EXPECT_EQ(packets[3][0], "1");
    std::error_code ignored;
    if (!testing::Test::HasFailure()) std::filesystem::remove(file, ignored);
}

}  // namespace
}  // namespace margay::wire::eoe
