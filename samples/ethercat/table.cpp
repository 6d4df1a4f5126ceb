#include "ethercat/table.hpp"

#include "ethercat/commands.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace margay::ethercat {
namespace {

constexpr std::string_view kSources =
    "interface (eth0; xdp:eth0 by AF_XDP; try-xdp:eth0 by AF_XDP, or else as eth0), two interfaces at the ends of a "
    "ring "
    "(eth0+eth1), simulated segment (sim:demo, sim:FILE.toml) "
    "or recording of the same call (pcap:FILE); once for each master";

constexpr Option kOptions[] = {
    {'S', "source", "SOURCE", kSources, "SOURCE", true},
    {'m', "master", "LIST", "masters: a number, a list, ranges, - for all [all that have a source]", "", true},
    {0, "json", "", "print JSON for programs", "", true},
    {'v', "verbose", "", "print more", "", true},
    {'q', "quiet", "", "print less, and no warnings", "", true},
    {'f', "force", "", "do what a check would refuse", "", true},
    {0, "take-over", "", "scan also when slaves are in SAFEOP or OP under another master; they go to INIT", "", true},
    {0, "attach", "PATH", "work on the running application that serves this socket", "FILE", true},
    {0, "eni", "FILE", "expect and configure the slaves as this ENI file says", "FILE", true},
    {0, "record", "FILE", "write every frame sent and received to this file, as pcap (two interfaces: as pcapng)",
     "FILE", true},
    {0, "trace", "", "print a line for every datagram to standard error", "", true},
    {'h', "help", "", "print help and exit", "", true},
    {0, "version", "", "print the version and exit", "", true},
    {0, "man", "", "print the manual page and exit", "", true},
    {0, "completion", "", "print the completion for bash and exit", "", true},
    {'a', "alias", "LIST", "slaves by alias", ""},
    {'p', "position", "LIST", "slaves by position", ""},
    {'d', "domain", "LIST", "domains, the first is 0 [all]", ""},
    {'t', "type", "TYPE", "data type",
     "bool int8 int16 int32 int64 uint8 uint16 uint32 uint64 float double string octet_string unicode_string sm8 sm16 "
     "sm32 sm64"},
    {'o', "output-file", "FILE",
     "file for the output, - is standard output; of foe_write: name of the file in the slave", "FILE"},
    {'s', "skin", "SKIN", "form of the output: default or etherlab", "default etherlab"},
    {'e', "emergency", "", "send before all other requests", ""},
    {'w', "watch", "", "go on until a signal ends the command", ""},
    {0, "interval", "MS", "time between two outputs, in ms [1000]", ""},
    {0, "count", "N", "end after this number of outputs", ""},
    {0, "password", "NUMBER", "password of the file [0]", ""},
    {0, "boot", "", "bring the slave to BOOT for the transfer, and to PREOP afterwards", ""},
};

constexpr std::string_view kSelect =
    "Without --alias and --position all slaves are selected; --position alone selects by the place in the ring, from "
    "0; --alias alone selects the slaves with this alias and the slaves behind them, up to the next slave with "
    "another alias; both select by the place behind a slave with this alias.";
constexpr std::string_view kOne = "The selection must leave one slave.";
constexpr std::string_view kTypes =
    "Data types: bool, int8, int16, int32, int64, uint8, uint16, uint32, uint64, float, double, string, octet_string, "
    "unicode_string; with a sign bit and a magnitude: sm8, sm16, sm32, sm64; also int24 to int56 and uint24 to uint56.";
constexpr std::string_view kDictionaryType =
    "Without --type the type is taken from the object dictionary of the slave. --type is necessary where the slave "
    "does not describe the entry.";
constexpr std::string_view kStandaloneMap =
    "On a SOURCE of its own, the command maps the slaves as they describe themselves, or as --eni says. The slaves go "
    "to SAFEOP, where outputs are not applied, and back to PREOP.";

constexpr Argument kIndex{"INDEX", "index of the object, 16 bits"};
constexpr Argument kSubindex{"SUBINDEX",
                             "subindex of the entry, 8 bits; without it the whole object, by complete access"};
constexpr Argument kIdn{"IDN",
                        "IDN: a number of 16 bits (bit 15: P, bits 14 to 12: parameter set, bits 11 to 0: "
                        "number), or its notation, for example P-0-150"};
constexpr Argument kDrive{"DRIVE", "drive in the slave, 0 to 7 [0]"};
constexpr Argument kAddress{"ADDRESS", "address of the register, 16 bits"};

const std::vector<std::string_view> kSlaveOptions{"alias", "position"};

std::vector<std::string_view> with_slaves(std::initializer_list<std::string_view> more) {
    std::vector<std::string_view> all = kSlaveOptions;
    all.insert(all.end(), more);
    return all;
}

std::vector<Command> mailbox_commands() {
    return {
        {.name = "download",
         .summary = "Writes an entry of the object dictionary of a slave.",
         .forms = {"INDEX SUBINDEX VALUE", "INDEX VALUE"},
         .text = {kOne, kDictionaryType,
                  "Without SUBINDEX the whole object is written by complete access; its type is "
                  "octet_string unless --type says otherwise.",
                  kTypes, kSelect},
         .arguments = {kIndex,
                       kSubindex,
                       {"VALUE",
                        "value; - reads it from standard input: the octets as they are for strings, a text "
                        "for numbers"}},
         .options = with_slaves({"type"}),
         .least = 2,
         .most = 3,
         .run = run_download},
        {.name = "upload",
         .summary = "Reads an entry of the object dictionary of a slave.",
         .forms = {"INDEX SUBINDEX", "INDEX"},
         .text = {kOne, kDictionaryType,
                  "Without SUBINDEX the whole object is read by complete access and printed as "
                  "octets; of an object that is one value, this value is read. Integers are printed in hexadecimal and "
                  "in decimal.",
                  kTypes, kSelect},
         .arguments = {kIndex, kSubindex},
         .options = with_slaves({"type", "output-file"}),
         .least = 1,
         .most = 2,
         .run = run_upload},
        {.name = "sdos",
         .summary = "Lists the object dictionaries of slaves.",
         .text = {"An object is printed with its index and its name:", "  SDO 0x1018, \"Identity object\"",
                  "Below it stand its entries: index and subindex, access, data type, size and name:",
                  "  0x1018:01, r-r-r-, uint32, 32 bit, \"Vendor ID\"",
                  "Access has two letters for each of PREOP, SAFEOP and OP: r readable, w writable, - not. --quiet "
                  "leaves out the entries.",
                  kSelect},
         .options = kSlaveOptions,
         .run = run_sdos},
        {.name = "foe_read",
         .summary = "Reads a file of a slave by FoE.",
         .forms = {"NAME"},
         .text = {kOne, kSelect},
         .arguments = {{"NAME", "name of the file in the slave"}},
         .options = with_slaves({"output-file", "password", "boot"}),
         .least = 1,
         .most = 1,
         .run = run_foe_read},
        {.name = "foe_write",
         .summary = "Writes a file to a slave by FoE.",
         .forms = {"FILE"},
         .text = {kOne,
                  "--output-file is the name of the file in the slave. Without it the name is that of FILE without its "
                  "folder.",
                  "Most slaves take firmware in BOOT only: see --boot.", kSelect},
         .arguments = {{"FILE", "file to send; - is standard input and needs --output-file", "FILE"}},
         .options = with_slaves({"output-file", "password", "boot"}),
         .least = 1,
         .most = 1,
         .run = run_foe_write},
        {.name = "soe_read",
         .summary = "Reads a drive parameter by SoE.",
         .forms = {"IDN", "DRIVE IDN"},
         .text = {kOne, "Without --type the value is printed as the attribute of the parameter says.", kTypes, kSelect},
         .arguments = {kDrive, kIdn},
         .options = with_slaves({"type"}),
         .least = 1,
         .most = 2,
         .run = run_soe_read},
        {.name = "soe_write",
         .summary = "Writes a drive parameter by SoE.",
         .forms = {"IDN VALUE", "DRIVE IDN VALUE"},
         .text = {kOne, "--type is necessary.", kTypes, kSelect},
         .arguments = {kDrive, kIdn, {"VALUE", "value; - reads it from standard input"}},
         .options = with_slaves({"type"}),
         .least = 2,
         .most = 3,
         .run = run_soe_write},
    };
}

std::vector<Command> memory_commands() {
    return {
        {.name = "reg_read",
         .summary = "Reads registers of a slave.",
         .forms = {"ADDRESS [SIZE]"},
         .text = {kOne, "Without --type the octets are printed in hexadecimal.", kTypes, kSelect},
         .arguments = {kAddress, {"SIZE", "number of octets; not necessary with a type that has a size"}},
         .options = with_slaves({"type"}),
         .least = 1,
         .most = 2,
         .run = run_reg_read},
        {.name = "reg_write",
         .summary = "Writes registers of a slave.",
         .forms = {"ADDRESS DATA"},
         .text = {kOne, kTypes, kSelect},
         .arguments = {kAddress,
                       {"DATA", "with --type a value; otherwise a file with the octets, or - for standard input",
                        "FILE"}},
         .options = with_slaves({"type", "emergency"}),
         .least = 2,
         .most = 2,
         .run = run_reg_write},
        {.name = "sii_read",
         .summary = "Reads the SII of a slave.",
         .text =
             {kOne,
              "Prints the octets up to the end mark, for a file or a pipe; with --verbose a text with the categories.",
              kSelect},
         .options = with_slaves({"output-file"}),
         .run = run_sii_read},
        {.name = "sii_write",
         .summary = "Writes the SII of a slave.",
         .forms = {"FILE"},
         .text = {kOne,
                  "The content is checked before it is written; --force writes it nevertheless. Each word is read "
                  "back. After an error the "
                  "old content is restored.",
                  kSelect},
         .arguments = {{"FILE", "image: octets or Intel HEX; - is standard input", "FILE"}},
         .options = kSlaveOptions,
         .least = 1,
         .most = 1,
         .run = run_sii_write},
        {.name = "alias",
         .summary = "Writes the alias of slaves into their SII.",
         .forms = {"ALIAS"},
         .text = {"Slaves take the new alias when they are switched on again. --force is necessary for several slaves, "
                  "and for an SII with a "
                  "wrong checksum.",
                  kSelect},
         .arguments = {{"ALIAS", "new alias, 16 bits; 0 removes it"}},
         .options = kSlaveOptions,
         .least = 1,
         .most = 1,
         .run = run_alias},
        {.name = "ip",
         .summary = "Sets the parameters of the IP stack of a slave by EoE.",
         .forms = {"NAME VALUE ..."},
         .text = {kOne, "Parameters:",
                  "  ip_address ADDRESS[/PREFIX]  address, and with PREFIX the subnet mask\n"
                  "  mac_address MAC              address of the virtual interface\n"
                  "  default_gateway ADDRESS      gateway\n"
                  "  dns_address ADDRESS          DNS server\n"
                  "  hostname NAME                name, up to 32 octets",
                  "An ADDRESS of IPv4 is written with dots, or is a host name that this system resolves.", kSelect},
         .arguments = {{"NAME", "name of a parameter", "ip_address mac_address default_gateway dns_address hostname"},
                       {"VALUE", "value of the parameter"}},
         .options = kSlaveOptions,
         .least = 2,
         .most = 10,
         .run = run_ip},
    };
}

std::vector<Command> segment_commands() {
    return {
        {.name = "slaves",
         .summary = "Lists the slaves.",
         .text = {"One line for each slave:", "  2  5555:1  PREOP  +  Name of the slave",
                  "Position in the ring; alias of the slave, or of the last slave before it with an alias, and the "
                  "number of slaves behind "
                  "that one; AL state; + or, after an error of the scan or the configuration, E; name in the SII, or "
                  "vendor ID and product "
                  "code. --verbose prints what is known.",
                  kSelect},
         .options = kSlaveOptions,
         .run = run_slaves},
        {.name = "states",
         .summary = "Brings slaves to an AL state.",
         .forms = {"STATE"},
         .text = {"On a SOURCE of its own, the command maps the slaves for SAFEOP and OP, with outputs of 0. When it "
                  "ends, no process data is sent any more, and the watchdogs of the slaves end OP.",
                  kSelect},
         .arguments = {{"STATE", "INIT, PREOP, BOOT, SAFEOP or OP", "INIT PREOP BOOT SAFEOP OP"}},
         .options = kSlaveOptions,
         .least = 1,
         .most = 1,
         .run = run_states},
        {.name = "rescan",
         .summary = "Scans the segment again.",
         .text =
             {"A running application says what a rescan may do. While it exchanges process data, its slaves stay as "
              "they are: the ring is compared with them, lost slaves are found, and slaves that it does not use are "
              "counted. --verbose prints the number of slaves."},
         .run = run_rescan},
        {.name = "master", .summary = "Shows the masters and their interfaces.", .run = run_master},
        {.name = "debug",
         .summary = "Sets the messages of the master.",
         .forms = {"LEVEL"},
         .text = {"On a SOURCE of its own, the command scans at this level. Attached, it sets the level of the "
                  "application; "
                  "margayd has the key `debug` for it, and writes the counters of frames once a second at level 2."},
         .arguments = {{"LEVEL", "0 none, 1 errors and warnings, 2 also every datagram (of margayd: every repetition)",
                        "0 1 2"}},
         .least = 1,
         .most = 1,
         .run = run_debug},
        {.name = "crc",
         .summary = "Shows the error counters of the ports.",
         .forms = {"", "reset"},
         .text = {"For each port: CRC invalid frames (registers 0x0300, 0x0302, 0x0304, 0x0306), PHY physical errors "
                  "(0x0301, 0x0303, 0x0305, "
                  "0x0307), FWD errors that an earlier slave has seen (0x0308 to 0x030B), NXT the slave at the other "
                  "end. A counter ends at 255.",
                  kSelect},
         .arguments = {{"reset", "set all counters to 0", "reset"}},
         .options = with_slaves({"watch", "interval", "count"}),
         .most = 1,
         .run = run_crc},
        {.name = "graph",
         .summary = "Prints the topology as a graph in the language DOT.",
         .forms = {"", "INFO"},
         .text = {"A picture of it: ethercat graph | dot -Tsvg > bus.svg",
                  "The colour of a link follows the counters of its two ports: green without errors, orange up to 9 "
                  "errors or after a lost link, "
                  "red from 10 errors on."},
         .arguments = {{"INFO", "DC: times of the clocks; CRC: error counters", "DC CRC"}},
         .most = 1,
         .run = run_graph},
        {.name = "eoe",
         .summary = "Shows the Ethernet over EtherCAT traffic of the slaves.",
         .text =
             {"One line for each port: the interface; position of the slave; up while its mailbox takes frames; octets "
              "from the slave (Rx) and to the slave (Tx), and octets per second of both in the time of --interval; "
              "frames that were dropped. Octets count modulo 2^32.",
              "On a SOURCE of its own, the command exchanges frames for --interval and counts them. Attached, it "
              "shows the ports of the application since they began."},
         .options = {"interval"},
         .run = run_eoe},
        {.name = "analyse",
         .summary = "Says what a recording of EtherCAT traffic shows.",
         .forms = {"FILE"},
         .text =
             {"The recording may be of any master. Nothing is asked of the segment, and no SOURCE is needed.",
              "Shown are the slaves with identity, names and PDOs as far as the recording has them; AL states over "
              "time; mailbox conversations; cycle times; lost and late frames; working counters that fell short; "
              "distributed clocks; and the master where the recording proves it.",
              "Several masters in one file are distinguished by their source addresses, and by their interfaces where "
              "the addresses are alike; each has a part of its own. Packets that are not in order of time are sorted. "
              "A recorder on the interface of a Margay program sees only the replies where PACKET_QDISC_BYPASS is in "
              "use.",
              "Times count from the first packet. Numbers behind # are those of packets, as in Wireshark. "
              "--verbose shows long lists in full."},
         .arguments =
             {{"FILE",
               "recording, - for standard input: pcap or pcapng, of Ethernet, also with VLAN tags or EtherCAT over UDP",
               "FILE"}},
         .least = 1,
         .most = 1,
         .run = run_analyse,
         .without_master = true},
        {.name = "version", .summary = "Prints the version.", .run = run_version, .without_master = true},
    };
}

std::vector<Command> process_data_commands() {
    return {
        {.name = "config",
         .summary = "Lists the configurations of slaves.",
         .text = {"One line for each configuration:", "  1001:0  0x0000003b/0x02010000  3  OP",
                  "Alias and relative position; vendor ID and product code; position and AL state of the slave, or - "
                  "where it is missing. "
                  "--verbose prints PDOs and SDOs.",
                  kStandaloneMap, "--position without --alias selects by alias 0."},
         .options = kSlaveOptions,
         .run = run_config},
        {.name = "domains",
         .summary = "Lists the domains.",
         .text = {"One line for each domain:", "  Domain0: LogBaseAddr 0x00000000, Size   6, WorkingCounter 1/1",
                  "--verbose prints the data of each slave.", kStandaloneMap},
         .options = {"domain"},
         .run = run_domains},
        {.name = "data",
         .summary = "Prints the process data of domains as octets.",
         .text = {"The data of several domains follow each other. With --watch or --count a line in hexadecimal is "
                  "printed for each domain again and "
                  "again.",
                  kStandaloneMap},
         .options = {"domain", "output-file", "watch", "interval", "count"},
         .run = run_data},
        {.name = "pdos",
         .summary = "Lists SyncManagers, PDOs and entries of PDOs.",
         .text = {"Three levels:",
                  "  SM3: PhysAddr 0x1100, DefaultSize    0, ControlRegister 0x20, Enable 1\n"
                  "    TxPDO 0x1a00 \"Channel 1\"\n"
                  "      PDO entry 0x3101:01,  8 bit, \"Status\"",
                  "The PDOs are those of the object dictionary, or else those of the SII. --skin etherlab prints a "
                  "template for the generic "
                  "slave block of EtherLab.",
                  kSelect},
         .options = with_slaves({"skin"}),
         .run = run_pdos},
        {.name = "cstruct",
         .summary = "Prints the PDOs of slaves in C, for ecrt_slave_config_pdos().",
         .text = {kSelect},
         .options = kSlaveOptions,
         .run = run_cstruct},
        {.name = "xml",
         .summary = "Prints the slaves as an ESI file.",
         .text = {"The description has what the SII and the object dictionary of the slaves say. An ESI file has one "
                  "vendor.",
                  kSelect},
         .options = with_slaves({"output-file"}),
         .run = run_xml},
    };
}

std::vector<Command> all_commands() {
    std::vector<Command> all;
    for (auto part : {mailbox_commands(), memory_commands(), segment_commands(), process_data_commands()})
        for (auto& command : part) all.push_back(std::move(command));
    std::ranges::sort(all, {}, &Command::name);
    return all;
}

}  // namespace

std::span<const Command> commands() {
    static const std::vector<Command> all = all_commands();
    return all;
}

std::span<const Option> options() { return kOptions; }

bool Command::has_option(const Option& option) const {
    if (!option.common) return std::ranges::find(options, option.name) != options.end();
    constexpr std::array<std::string_view, 8> kOfSegment{"source", "master", "force",  "take-over",
                                                         "attach", "eni",    "record", "trace"};
    const bool for_file = without_master && !arguments.empty();
    return !for_file || std::ranges::find(kOfSegment, option.name) == kOfSegment.end();
}

const Command* find_command(std::string_view name) {
    const auto all = commands();
    const auto found = std::ranges::find(all, name, &Command::name);
    return found == all.end() ? nullptr : &*found;
}

const Option* find_option(std::string_view name) {
    const auto* found = std::ranges::find(kOptions, name, &Option::name);
    return found == std::end(kOptions) ? nullptr : found;
}

}  // namespace margay::ethercat
