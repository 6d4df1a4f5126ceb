// The commands of ethercat that access slaves: SDO, FoE, SoE, EoE, registers, SII.
#include "ethercat/ethercat_fixture.hpp"

namespace margay::process {
namespace {

using EthercatAccess = EthercatTest;

TEST_F(EthercatAccess, UploadsByTheTypeOfTheDictionary) {
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x1018 1"), "0x00004d47 19783\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x1008 0"), "Servo drive\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 -t uint16 0x6041 0"), "0x0250 592\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x1018"),
              "0x04 0x00 0x47 0x4d 0x00 0x00 0x02 0x54 0x00 0x00 0x01 0x00 0x00 0x00 0x00 0x00 0x00 0x00\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 -t octet_string 0x1018 1"), "0x47 0x4d 0x00 0x00\n");
    // An object of one value has no complete access.
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x1000"), "0x00020192 131474\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x6061"), "0x00 0\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x1008"), "Servo drive\n");
    EXPECT_EQ(out("sim:drives", "upload -p 0 0x1c13"), "0x01 0x00 0x00 0x1a\n");
    const auto json = out("sim:drives", "upload -p 0 0x1018 1 --json");
    EXPECT_TRUE(contains(json, "\"type\": \"uint32\",\n  \"value\": 19783,\n  \"octets\": \"474d0000\"")) << json;
    fails("sim:drives", "upload -p 0 0x1018 9", 1, "position 0: ");
    fails("sim:drives", "upload -p 0 -t uint32 0x7777 0", 1, "position 0: SDO upload of 0x7777:0: the slave aborted");
    fails("sim:drives", "upload -p 0 -t uint16 0x1018 1", 1,
          "the value has 4 octets, and type uint16 has 2: 0x47 0x4d");
    fails("sim:drives", "upload -p 0 -t number 0x1018 1", 2, "there is no data type 'number'");
    fails("sim:drives", "upload 0x1018 1", 2, "upload works on one slave, and 8 are selected");
    fails("sim:drives", "upload -p 0 0x10000 1", 2, "INDEX: '0x10000' is no whole number from 0 to 65535");
    fails("sim:demo", "upload -p 1 -t uint32 0x1018 1", 1, "position 1: ");
}

TEST_F(EthercatAccess, DownloadsNumbersTextsAndStandardInput) {
    const std::string source = "--source sim:drives --record r.pcap -p 0 ";
    EXPECT_EQ(out("", "download " + source + "0x6060 0 8"), "");
    EXPECT_EQ(out("", "download " + source + "0x607A 0 -100"), "") << "a negative number is no option";
    EXPECT_TRUE(contains(out("", "download " + source + "0x607A 0 -100 --json"), "\"written\": \"9cffffff\""));
    const auto piped = folder.run("echo 8 | " + program + " download --source sim:drives -p 0 0x6060 0 - --json");
    EXPECT_TRUE(contains(piped.out, "\"written\": \"08\"")) << piped.err;
    fails("sim:drives", "download -p 0 0x6060 0 300", 2,
          "'300' is no value of type int8: a whole number from -128 to 127");
    fails("sim:drives", "download -p 0 0x607A 0 1.5", 2, "'1.5' is no value of type int32");
    fails("sim:drives", "download -p 0 0x1018 1 5", 1, "position 0: SDO download of 0x1018:1: the slave aborted");
    fails("sim:drives", "download -p 0 0x6060", 2,
          "arguments are missing: download INDEX SUBINDEX VALUE or download INDEX VALUE");
}

TEST_F(EthercatAccess, ListsDictionaries) {
    const auto text = out("sim:drives", "sdos -p 0");
    EXPECT_TRUE(contains(text, "SDO 0x1018, \"Identity\"\n  0x1018:00, r-r-r-, uint8, 8 bit, ")) << text;
    EXPECT_TRUE(contains(text, "\n  0x607a:00, rwrwrw, int32, 32 bit, \"Target position\"\n")) << text;
    EXPECT_TRUE(contains(text, "\n  0x1008:00, r-r-r-, string, 88 bit, \"Device name\"\n")) << text;
    const auto quiet = out("sim:drives", "sdos -p 0 -q");
    EXPECT_TRUE(quiet.starts_with("SDO 0x1000, \"Device type\"\nSDO 0x1001, ")) << quiet;
    EXPECT_FALSE(contains(quiet, "  0x")) << quiet;
    EXPECT_TRUE(contains(out("sim:drives", "sdos -p 0-1 -q"), "=== Master 0, Slave 1 ===\n"));
    EXPECT_TRUE(contains(out("sim:drives", "sdos -p 0 --json"), "\"access\": \"rwrwrw\""));
    fails("sim:demo", "sdos -p 1", 1, "position 1: ");
}

TEST_F(EthercatAccess, ASlaveWithoutObjectsIsNamedAsThat) {
    const std::string none = "position 3: the slave has no object dictionary: its mailbox does not support CoE";
    for (const char* call : {"sdos -p 3", "upload -p 3 0x1018 1", "download -p 3 0x6060 0 8 -t int8"})
        fails("sim:demo", call, 1, none);
    fails("", "sdos -p 5 --source sim:drives", 1, "does not support CoE\n");
    fails("", "sdos -p 3 --source sim:demo", 1, none + "; --source sim:drives has slaves with one");
    const auto all = ethercat("sim:demo", "sdos");
    EXPECT_EQ(all.status, 0);
    EXPECT_EQ(all.out, "");
    EXPECT_TRUE(contains(all.err, "warning: no slave of master 0 has an object dictionary (CoE)")) << all.err;
    // The segment that the message names has slaves with an object dictionary.
    EXPECT_TRUE(contains(out("sim:drives", "sdos -p 0"), "SDO 0x1018"));
}

TEST_F(EthercatAccess, TransfersFiles) {
    const std::string slave = " -p 1 --password 0x4d47 --boot ";
    EXPECT_EQ(out("sim:bootloader", "foe_read firmware -o old.bin" + slave), "");
    const auto old = content_of(folder.path() / "old.bin");
    EXPECT_GT(old.size(), 100U);
    EXPECT_EQ(out("sim:bootloader", "foe_read firmware" + slave), old) << "standard output";
    EXPECT_EQ(out("sim:bootloader", "foe_write old.bin -o firmware -v" + slave),
              "firmware: " + std::to_string(old.size()) + " octets written\n");
    const auto piped = folder.run(program + " foe_write - -o firmware -S sim:bootloader" + slave + " < old.bin");
    EXPECT_EQ(piped.status, 0) << piped.err;
    fails("sim:bootloader", "foe_write -" + slave, 2, "standard input has no name: --output-file is the name");
    fails("sim:bootloader", "foe_write nothing" + slave, 3, "nothing: cannot be read: No such file or directory");
    fails("sim:bootloader", "foe_write old.bin" + slave, 1, "the slave stays in BOOT");
    fails("sim:bootloader", "foe_read other" + slave, 1, "(the slave: \"");
    fails("sim:demo", "foe_read x -p 1", 1, "position 1: ");
}

TEST_F(EthercatAccess, AccessesDriveParameters) {
    EXPECT_EQ(out("sim:servodrives", "soe_read -p 1 S-0-15"), "0x0007 7\n");
    EXPECT_EQ(out("sim:servodrives", "soe_read -p 1 1 15"), "0x0007 7\n");
    EXPECT_TRUE(out("sim:servodrives", "soe_read -p 1 17").starts_with("0x01 0x00 0x0b 0x00 "));
    EXPECT_TRUE(contains(out("sim:servodrives", "soe_read -p 1 S-0-15 --json"), "\"idn\": \"S-0-0015\""));
    EXPECT_EQ(out("sim:servodrives", "soe_write -p 1 S-0-15 -t uint16 7"), "");
    EXPECT_FALSE(contains(out("sim:servodrives", "sii_read -v -p 1"), "faults"))
        << "what is read ends behind the last category: the EEPROM is larger";
    EXPECT_EQ(out("sim:servodrives", "soe_read -p 1 S-0-30 -t string"), out("sim:servodrives", "soe_read -p 1 S-0-30"))
        << "the lengths at the head of a list are no text";
    fails("sim:servodrives", "soe_read -p 1 S-0-2", 1, "position 1: ");
    fails("sim:demo", "reg_write -p 0 0xF80 /dev/zero", 3, "/dev/zero: has more than 67108864 octets");
    fails("sim:servodrives", "soe_read -p 1 8 S-0-15", 2, "DRIVE: '8' is no whole number from 0 to 7");
    fails("sim:servodrives", "soe_read -p 1 P-x", 2,
          "IDN: 'P-x' is neither a number up to 65535 nor written like P-0-150");
    fails("sim:servodrives", "soe_write -p 1 S-0-15 7", 2, "soe_write needs --type");
}

TEST_F(EthercatAccess, AccessesRegisters) {
    EXPECT_EQ(out("sim:demo", "reg_read -p 1 0x130 -t uint16"), "0x0002 2\n");
    EXPECT_EQ(out("sim:demo", "reg_read -p 1 0x130 2 -t uint16"), "0x0002 2\n");
    fails("sim:demo", "reg_read -p 1 0x130 4 -t uint16", 2, "SIZE is 4, and uint16 has 2 octets");
    EXPECT_EQ(out("sim:demo", "reg_read -p 2 0x10 2"), "0x03 0x10\n");
    EXPECT_TRUE(contains(out("sim:demo", "reg_read -p 2 0x10 2 --json"), "\"octets\": \"0310\""));
    EXPECT_EQ(out("sim:demo", "reg_write -p 1 0x0F80 -t uint32 0x12345678"), "");
    EXPECT_EQ(out("sim:demo", "reg_write -p 1 0x0F80 -e -t uint32 1"), "");
    EXPECT_TRUE(contains(out("sim:demo", "reg_write -p 1 0x0F80 -t sm16 -3 --json"), "\"written\": \"0380\""));
    folder.write("four", "abcd");
    EXPECT_TRUE(contains(out("sim:demo", "reg_write -p 1 0x0F80 four --json"), "\"written\": \"61626364\""));
    fails("sim:demo", "reg_read -p 1 0x130", 2, "SIZE is missing");
    fails("sim:demo", "reg_read -p 1 0xFFFF 2", 2, "2 octets from 0xffff on");
    fails("sim:demo", "reg_write -p 1 0x0 -t uint8 1", 1,
          "position 1: writing at register 0x0000: wrong working counter");
    fails("sim:demo", "reg_write -p 1 0x0F80 nothing", 3, "nothing: cannot be read");
    fails("sim:demo", "reg_write -p 1 0x0F80 -t uint8 256", 2,
          "'256' is no value of type uint8: a whole number from 0 to 255");
}

TEST_F(EthercatAccess, ReadsAndWritesTheSii) {
    EXPECT_EQ(out("sim:demo", "sii_read -p 1 -o image"), "");
    const auto image = content_of(folder.path() / "image");
    ASSERT_GT(image.size(), 128U);
    EXPECT_EQ(image.substr(16, 4), std::string("GM\0\0", 4)) << "vendor ID, word 8";
    EXPECT_EQ(out("sim:demo", "sii_read -p 1"), image);
    EXPECT_TRUE(contains(out("sim:demo", "sii_read -p 1 -v"), "8-channel digital input"));
    EXPECT_EQ(out("sim:demo", "sii_write -p 1 image -v"),
              std::to_string(image.size() / 2) + " words, 0 of them changed\n");
    auto wrong = image;
    wrong[2] = static_cast<char>(wrong[2] ^ 1);  // the checksum does not fit any more
    folder.write("wrong", wrong);
    fails("sim:demo", "sii_write -p 1 wrong", 1, "checksum");
    EXPECT_EQ(out("sim:demo", "sii_write -p 1 wrong -f -v"),
              std::to_string(image.size() / 2) + " words, 1 of them changed\n");
    const std::size_t bytes = (static_cast<unsigned char>(image[124]) + 1U) * 128U;  // word 0x3e: KiBit - 1
    std::string large = image + std::string(bytes + 128 - image.size(), '\xff');
    ++large[124];
    folder.write("large", large);
    fails("sim:demo", "sii_write -p 1 large", 1, "octets, the EEPROM of position 1 has " + std::to_string(bytes));
    folder.write("odd", "abc");
    fails("sim:demo", "sii_write -p 1 odd -f", 1, "odd: 3 octets are not a whole number of words");
    fails("sim:demo", "sii_write -p 1 nothing", 3, "nothing: cannot be read");
    fails("sim:demo", "sii_read", 2, "sii_read works on one slave, and 5 are selected");
}

TEST_F(EthercatAccess, SetsIpParametersAndCountsFrames) {
    EXPECT_EQ(out("sim:eoe",
                  "ip -p 1 ip_address 192.168.4.5/24 mac_address 02:00:00:00:00:07 default_gateway 192.168.4.1 "
                  "dns_address 192.168.4.2 hostname gateway"),
              "");
    EXPECT_TRUE(contains(out("sim:eoe", "ip -p 1 hostname gateway --json"), "\"hostname\": \"gateway\""));
    EXPECT_EQ(out("sim:eoe", "eoe --interval 50"),
              "Interface  Slave  State  RxBytes  RxRate  TxBytes  TxRate  Dropped\n"
              "eoe0s1         1  up           0       0        0       0        0\n"
              "eoe0s2         2  up           0       0        0       0        0\n");
    fails("sim:eoe", "ip -p 1 ip_address 192.168.4.5/33", 2, "the prefix is a number from 0 to 32");
    for (const char* shorter : {"1.2.3", "010.0.0.1", "1.2.3.256", "7", "0x01020304"})  // a resolver accepts most
        fails("sim:eoe", std::string("ip -p 1 default_gateway ") + shorter, 2,
              std::string("'") + shorter + "' is no IPv4 address: four numbers from 0 to 255 without leading zeros");
    fails("sim:eoe", "ip -p 1 mac_address 02:00", 2, "'02:00' is no MAC address");
    for (const char* nobody : {"ff:ff:ff:ff:ff:ff", "01:00:5e:00:00:01", "00:00:00:00:00:00"})
        fails("sim:eoe", std::string("ip -p 1 mac_address ") + nobody, 2, "is no address of one device");
    fails("sim:eoe", "ip -p 1 hostname a hostname b", 2, "'hostname' is there twice");
    fails("sim:eoe", "ip -p 1 address 1.2.3.4", 2, "there is no parameter 'address'");
    fails("sim:eoe", "ip -p 1 hostname", 2, "arguments are missing");
    fails("sim:eoe", "ip -p 1 hostname a ip_address", 2, "'ip_address' has no value");
    fails("sim:demo", "ip -p 1 hostname a", 1, "position 1: ");
    fails("sim:eoe", "eoe --interval 0", 2, "--interval: 0 ms are no time to count in");
}

}  // namespace
}  // namespace margay::process
