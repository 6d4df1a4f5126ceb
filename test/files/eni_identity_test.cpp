// How an ENI identifies slaves: station addresses, aliases, device ids, hot connect groups. The tests write an ENI,
// read it again and bring the slaves up by it: the slaves have the same registers.
#include "files/examples.hpp"
#include "files/machine.hpp"

#include <margay/files/eni.hpp>

#include <gtest/gtest.h>

namespace margay::files {
namespace {

// Slaves 1, 2 and 3 are the line. The groups {alias 5, drive} and {device id 9} are connected within the line.
const std::vector<std::string> kLine{"coupler", "digital_in_8", "digital_io_16@5", "drive", "digital_out_8", "io#9"};
const ExpectedSlave kPlaces[] = {
    {.number = 1, .station_address = 1001},
    {.number = 2},
    {.number = 3, .station_address = 0x1002},  // the library would give this address to slave 2
    {.alias = std::uint16_t{5}, .hot_connect = 1, .station_address = 2001},
    {.hot_connect = 1},
    {.device_id = std::uint16_t{9}, .hot_connect = 2, .station_address = 3},
};

struct ExpectedMachine : Machine {
    explicit ExpectedMachine(const std::vector<std::string>& devices = kLine) : Machine(devices) {
        EXPECT_TRUE(expect(ctx, kPlaces));
    }
    void map() {
        const auto found = config_init(ctx);
        ASSERT_TRUE(found) << words(found.error());
        const auto mapped = config_map(ctx, image);
        ASSERT_TRUE(mapped) << words(mapped.error());
    }
    [[nodiscard]] Read<EniConfiguration> eni(std::size_t remarks = 0) {
        const Written written = write_eni(ctx);
        EXPECT_TRUE(written) << written.error;
        EXPECT_EQ(written.remarks.size(), remarks);
        auto read = read_eni(written.text);
        EXPECT_TRUE(read) << to_text(read.problem) << "\n" << written.text;
        for (const Remark& remark : read.remarks) ADD_FAILURE() << to_text(remark);
        return read;
    }
};

TEST(EniIdentity, TheListIsTheSameAfterwards) {
    ExpectedMachine first;
    first.map();
    const auto eni = first.eni();
    const auto list = eni->expected();
    ASSERT_EQ(list.size(), std::size(kPlaces));
    for (std::size_t n = 0; n < list.size(); ++n) {
        const Slave& slave = first.ctx.slave(n + 1);
        EXPECT_EQ(list[n].number, kPlaces[n].number) << n;
        EXPECT_EQ(list[n].alias, kPlaces[n].alias) << n;
        EXPECT_EQ(list[n].device_id, kPlaces[n].device_id) << n;
        EXPECT_EQ(list[n].hot_connect, kPlaces[n].hot_connect) << n;
        EXPECT_EQ(list[n].station_address, slave.station_address.value) << n;
        EXPECT_EQ(list[n].vendor, slave.identity.vendor) << n;
        EXPECT_EQ(list[n].product, slave.identity.product) << n;
        EXPECT_EQ(list[n].revision, slave.identity.revision) << n;
        EXPECT_EQ(eni->slaves[n].number, n + 1);
    }
    EXPECT_EQ(first.ctx.slave(1).station_address.value, 1001);
    EXPECT_EQ(first.ctx.slave(3).station_address.value, 0x1002);
    EXPECT_EQ(first.ctx.slave(6).station_address.value, 3);
}

TEST(EniIdentity, TheSameRegistersWithHotConnectGroups) {
    ExpectedMachine first;
    first.map();
    const auto eni = first.eni();
    // The groups are first connected at the same places, then at other places: the devices of the line have other
    // positions there.
    const std::vector<std::string> moved{"coupler",       "digital_in_8",    "io#9",
                                         "digital_out_8", "digital_io_16@5", "drive"};
    for (const auto& devices : {kLine, moved}) {
        Machine second(devices, eni->limits());
        const auto up = bring_up(second.ctx, *eni, second.image);
        ASSERT_TRUE(up) << words(up.error());
        for (std::uint32_t n = 0; n < kLine.size(); ++n) {
            const auto there = static_cast<std::uint32_t>(std::ranges::find(devices, kLine[n]) - devices.begin());
            EXPECT_EQ(first.registers(n), second.registers(there)) << kLine[n];
        }
        EXPECT_EQ(first.ctx.group(0).expected_wkc, second.ctx.group(0).expected_wkc);
        EXPECT_TRUE(second.to_op(1ms));
    }
}

TEST(EniIdentity, AGroupMayBeMissingAndComesLater) {
    ExpectedMachine first;
    first.map();
    const auto eni = first.eni();
    Machine second(kLine, eni->limits());
    second.segment.set_power(5, false, second.osal.now());
    const auto up = bring_up(second.ctx, *eni, second.image);
    ASSERT_TRUE(up) << words(up.error());
    EXPECT_EQ(second.ctx.slave(6).ring_position, 0);
    // A file that is written now has the expected working counters (Cnt) of the slaves that are in the file.
    const Written without = write_eni(second.ctx);
    EXPECT_EQ(without.remarks, std::vector<std::string>{"slave 6 is missing and is left out"});
    const auto read = read_eni(without.text);
    ASSERT_TRUE(read) << to_text(read.problem);
    for (const Remark& remark : read.remarks) EXPECT_FALSE(remark.text.starts_with("Cnt is")) << to_text(remark);
    SuperviseRequest supervise;
    ASSERT_TRUE(submit(second.ctx, supervise));
    ASSERT_TRUE(second.to_op(1ms));
    second.segment.set_power(5, true, second.osal.now());
    const auto seen = run_cycle(second.ctx, {.period = 1ms}, [&](const CycleInfo& info) {
        return second.ctx.slave(6).al.state != AlState::op && info.number < 20'000;
    });
    ASSERT_TRUE(seen) << words(seen.error());
    EXPECT_EQ(second.ctx.slave(6).al.state, AlState::op);
    EXPECT_EQ(first.registers(5), second.registers(5)) << "also its station address";
}

TEST(EniIdentity, ALeftOutGroupIsSaid) {
    ExpectedMachine first;
    first.segment.set_power(5, false, first.osal.now());
    first.map();
    const auto eni = first.eni(1);
    EXPECT_EQ(eni->slaves.size(), 5U);
}

TEST(EniIdentity, AliasSerialNumberAndNewerRevisionOfTheLine) {
    const std::vector<std::string> devices{"coupler", "digital_out_8@77"};
    const ExpectedSlave expected[] = {{.number = 1, .revision = 0, .newer_revision = true},
                                      {.number = 2, .alias = std::uint16_t{77}, .serial = 0}};
    Machine first(devices);
    ASSERT_TRUE(expect(first.ctx, expected));
    ASSERT_TRUE(config_init(first.ctx));
    ASSERT_TRUE(config_map(first.ctx, first.image));
    const Written written = write_eni(first.ctx);
    const auto eni = read_eni(written.text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    for (const Remark& remark : eni.remarks) ADD_FAILURE() << to_text(remark);
    const auto list = eni->expected();
    EXPECT_EQ(list[0].revision, 0U);
    EXPECT_TRUE(list[0].newer_revision);
    EXPECT_FALSE(list[1].newer_revision);
    EXPECT_EQ(list[1].alias, 77);
    EXPECT_EQ(list[1].serial, 0U);
    EXPECT_EQ(list[1].number, 2);
    EXPECT_EQ(list[1].hot_connect, 0);
    Machine other({"coupler", "digital_out_8@78"});
    const auto up = bring_up(other.ctx, *eni, other.image);
    ASSERT_FALSE(up);
    EXPECT_EQ(up.error().code, Errc::other_slave);
    EXPECT_EQ(up.error().slave, 2);
}

// The alias identifies the slave at any place. The nearest element of an ENI is a group of one slave.
TEST(EniIdentity, ASlaveAtAnyPlaceBecomesAGroup) {
    Machine first({"coupler", "digital_out_8@77", "digital_in_8"});
    const ExpectedSlave expected[] = {{.number = 1}, {.alias = std::uint16_t{77}}, {.number = 2, .optional = true}};
    ASSERT_TRUE(expect(first.ctx, expected));
    ASSERT_TRUE(config_init(first.ctx));
    ASSERT_TRUE(config_map(first.ctx, first.image));
    const Written written = write_eni(first.ctx);
    const auto eni = read_eni(written.text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_EQ(eni->expected().size(), 3U);
    EXPECT_EQ(eni->expected()[2].alias, 77);
    EXPECT_NE(eni->expected()[2].hot_connect, 0);
    EXPECT_EQ(written.remarks,
              (std::vector<std::string>{
                  "slave 2 may be missing, which an ENI can only say of a hot connect group",
                  "slave 3 may be at any place: it is written as a hot connect group, which may be missing"}));
}

TEST(EniIdentity, WrongStationAddressesAreNamed) {
    std::string text = kExampleEni;
    auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    std::vector<std::uint16_t> addresses;
    for (const EniSlave& slave : eni->slaves) addresses.push_back(slave.station_address);
    ASSERT_EQ(addresses.size(), 2U);
    for (std::size_t n = 0; n < 2; ++n) EXPECT_EQ(eni->expected()[n].station_address, addresses[n]);

    const auto replace = [&](const std::string& from, const std::string& to) {
        std::string changed = text;
        for (std::size_t at = 0; (at = changed.find(from, at)) != std::string::npos; at += to.size())
            changed.replace(at, from.size(), to);
        return changed;
    };
    const std::string second = ">" + std::to_string(addresses[1]) + "<";
    const auto twice = read_eni(replace("<PhysAddr" + second, "<PhysAddr>" + std::to_string(addresses[0]) + "<"));
    ASSERT_FALSE(twice);
    EXPECT_NE(to_text(twice.problem).find("the slave has the PhysAddr of the slave in line"), std::string::npos)
        << to_text(twice.problem);
    const auto reserved = read_eni(replace(second, ">3500<"));
    ASSERT_TRUE(reserved) << to_text(reserved.problem);
    EXPECT_EQ(reserved->expected()[1].station_address, 0);
    EXPECT_TRUE(std::ranges::any_of(reserved.remarks, [](const Remark& remark) {
        return to_text(remark).find("gets another PhysAddr than 0x0dac") != std::string::npos;
    }));
}

// ------------------------------------------------------------------ files of other tools

std::string changed(const std::string& what, const std::string& by) {
    std::string text = kExampleEni;
    const auto at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

bool says(const Read<EniConfiguration>& eni, const std::string& text) {
    return std::ranges::any_of(eni.remarks,
                               [&](const Remark& one) { return to_text(one).find(text) != std::string::npos; });
}

struct SiiCheck {
    std::string word;  // two hexadecimal digits
    std::string wanted;
    std::string mask = {};
};

// The example with init commands of the second slave that read these words of its SII and compare them.
Read<EniConfiguration> with_checks(const std::vector<SiiCheck>& checks) {
    const std::string begin = "<InitCmd><Transition>IP</Transition>";
    std::string all;
    for (const auto& [word, wanted, mask] : checks)
        all += begin + "<Cmd>5</Cmd><Adp>1002</Adp><Ado>1282</Ado><Data>0001" + word + "000000</Data></InitCmd>" +
               begin + "<Cmd>4</Cmd><Adp>1002</Adp><Ado>1288</Ado><DataLength>" + std::to_string(wanted.size() / 2) +
               "</DataLength><Validate><Data>" + wanted + "</Data>" +
               (mask.empty() ? "" : "<DataMask>" + mask + "</DataMask>") + "</Validate></InitCmd>";
    const std::string second = "<InitCmd><Transition>PS</Transition><Cmd>5</Cmd><Adp>1002</Adp>";
    return read_eni(changed(second, all + second));
}

TEST(EniIdentity, ACheckOfTheSiiComparesEightOctetsToo) {
    const auto eni = with_checks({{"0c", "0100000007000000"}});
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(eni->expected()[1].revision, 1U);
    EXPECT_EQ(eni->expected()[1].serial, 7U);
    const auto part = with_checks({{"0c", "010000000700"}});
    EXPECT_NE(to_text(part.problem).find("the check of SII word 0x000e compares a part of the value"),
              std::string::npos)
        << to_text(part.problem);
    const auto half = with_checks({{"0c", "0100000007000000", "ffffffff00000000"}});
    ASSERT_TRUE(half) << to_text(half.problem);
    EXPECT_EQ(half->expected()[1].revision, 1U);
    EXPECT_FALSE(half->expected()[1].serial);
    const auto masked = with_checks({{"0c", "0100000007000000", "ffffffff0000ffff"}});
    EXPECT_NE(to_text(masked.problem).find("the check of SII word 0x000e compares a part of the value"),
              std::string::npos)
        << to_text(masked.problem);
    EXPECT_TRUE(says(with_checks({{"0c", "01000000"}, {"0c", "02000000"}}),
                     "the check of SII word 0x000c wants 0x00000002, and one before it wants 0x00000001"));
}

// A check that is not supported does not replace the comparison with Info.
TEST(EniIdentity, InfoCountsWhereNoCheckOfTheIdentityIsSupported) {
    const auto eni = with_checks({{"04", "00000000"}});
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_TRUE(says(eni, "the check of SII word 0x0004 is not supported"));
    EXPECT_EQ(eni->expected()[1].product, 78U);
}

TEST(EniIdentity, IdentificationByAnotherRegisterIsNamedAndNotCompared) {
    const auto with = [](const std::string& ado) {
        return read_eni(
            changed("</RevisionNo>", "</RevisionNo><Identification Value=\"5\">" + ado + "</Identification>"));
    };
    const auto alias = with("<Ado>#x12</Ado>");
    const auto id = with("<Ado>308</Ado>");
    ASSERT_TRUE(alias && id);
    EXPECT_EQ(alias->expected()[0].alias, 5);
    EXPECT_EQ(id->expected()[0].device_id, 5);
    const auto other = with("<Ado>4096</Ado>");
    const auto none = with("");
    ASSERT_TRUE(other && none);
    EXPECT_TRUE(says(other, "Identification by the register 0x1000 is not supported"));
    EXPECT_TRUE(says(none, "Identification without Ado is not supported"));
    EXPECT_FALSE(other->expected()[0].device_id || other->expected()[0].alias);
    EXPECT_FALSE(none->expected()[0].device_id || none->expected()[0].alias);
}

TEST(EniIdentity, AGroupIsIdentifiedByTheWholeRegister) {
    const auto with = [](const std::string& data, const std::string& mask) {
        return read_eni(changed("</Slave>\n<Cyclic>",
                                "<HotConnect><GroupName>G</GroupName><GroupMemberCnt>1</GroupMemberCnt><IdentifyCmd>"
                                "<Cmd>1</Cmd><Adp>0</Adp><Ado>18</Ado><Data>0000</Data><Validate><Data>" +
                                    data + "</Data>" + mask +
                                    "</Validate></IdentifyCmd></HotConnect></Slave>\n<Cyclic>"));
    };
    EXPECT_TRUE(with("0710", "<DataMask>ffff</DataMask>"));
    EXPECT_NE(to_text(with("0710", "<DataMask>ff00</DataMask>").problem)
                  .find("IdentifyCmd compares a part of the register 0x0012, by DataMask, which is not supported"),
              std::string::npos);
    EXPECT_TRUE(says(with("07", ""), "IdentifyCmd compares 1 octet of the register 0x0012, which has 2"));
}

TEST(EniIdentity, WithoutPhysAddrTheInitCommandGivesTheStationAddress) {
    const std::string first = "<InitCmd><Transition>IP</Transition><Cmd>2</Cmd>";
    const std::string write =
        "<InitCmd><Transition>IP</Transition><Cmd>2</Cmd><Adp>0</Adp><Ado>16</Ado><Data>0120</Data></InitCmd>";
    const auto other = read_eni(changed(first, write + first));
    ASSERT_TRUE(other) << to_text(other.problem);
    EXPECT_EQ(other->expected()[0].station_address, 1001);
    EXPECT_TRUE(
        says(other, "an init command gives the slave the station address 0x2001: it gets 0x03e9, its PhysAddr"));
    std::string text = changed(first, write + first);
    for (std::size_t n = 0; (n = text.find("<Adp>1001<", n)) != std::string::npos; n += 5)
        text.replace(n, 10, "<Adp>8193<");
    const std::string phys = "<PhysAddr>1001</PhysAddr>";
    text.erase(text.find(phys), phys.size());
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(eni->expected()[0].station_address, 0x2001);
    EXPECT_EQ(eni->slaves[0].station_address, 0x2001);
    EXPECT_FALSE(says(eni, "addresses another slave"));
}

}  // namespace
}  // namespace margay::files
