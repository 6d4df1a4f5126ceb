// The parts of the reader of ENI files.
#pragma once

#include "files/xml.hpp"

#include <margay/files/eni.hpp>

#include <deque>
#include <map>
#include <span>

namespace margay::files {

[[nodiscard]] constexpr std::uint64_t up_to_octet(std::uint64_t bits) { return (bits + 7) / 8 * 8; }

// EtherCAT commands by their numbers (ETG.1000.4, table of the commands).
enum class EniCmd : std::uint8_t { nop, aprd, apwr, aprw, fprd, fpwr, fprw, brd, bwr, brw, lrd, lwr, lrw, armw, frmw };

// An init command: of the master, of a slave, or that identifies a slave of a hot connect group.
struct EniInit {
    Node node{};
    Transition transitions = Transition::none;
    EniCmd cmd = EniCmd::nop;
    std::uint16_t adp = 0;
    std::uint16_t ado = 0;
    std::vector<std::byte> data{};
    std::optional<std::uint16_t> counter{};  // expected working counter
    std::uint16_t retries = 0;
    bool validates = false;
    bool at_least = false;  // the value read is compared as a number, and may be greater
    std::vector<std::byte> wanted{};
    std::vector<std::byte> mask{};
    Duration timeout{0};  // of Validate, otherwise of the command
    [[nodiscard]] bool writes() const { return cmd == EniCmd::apwr || cmd == EniCmd::fpwr || cmd == EniCmd::bwr; }
    [[nodiscard]] bool reads() const { return cmd == EniCmd::aprd || cmd == EniCmd::fprd || cmd == EniCmd::brd; }
    [[nodiscard]] bool is_zero() const;
    // The value, least significant octet first, of at most 8 octets from `at` on.
    [[nodiscard]] std::uint64_t value(std::size_t at, std::size_t octets) const;
};
[[nodiscard]] std::vector<EniInit> read_eni_inits(Reader& reader, Node parent);

// A range of logical address space in bits, and the memory to which it is mapped.
struct EniFmmu {
    Node node{};
    std::uint64_t begin_bit = 0;
    std::uint64_t end_bit = 0;
    std::uint64_t physical_bit = 0;
    bool reads = false;
    bool writes = false;
};

struct EniSm {
    Node node{};
    std::uint8_t number = 0;
    std::uint16_t start = 0;
    std::uint16_t bytes = 0;
    std::uint8_t control = 0;
    std::uint8_t activate = 0;
};

// The place of a slave's data in the image of the file.
struct EniBits {
    std::uint32_t begin = 0;
    std::uint32_t bits = 0;
    Node node{};
};

// The data of a slave that the reader keeps until the configuration is made.
struct EniSlaveData {
    Node node{};
    EniSlave slave{};
    ExpectedSlave expected{};
    SlaveConfiguration config{};
    SlaveSetup setup{};
    std::vector<EniInit> inits{};         // the init commands that address this slave
    bool has_inits = false;               // without init commands the file describes only mailbox commands
    std::map<unsigned, EniFmmu> fmmus{};  // of process data, by number
    std::vector<EniFmmu> status_fmmus{};  // of the status of its mailbox
    std::map<unsigned, EniSm> sms{};
    std::vector<StartupCommand> mail{};
    std::vector<StartupCommand> registers{};
    std::deque<std::vector<std::byte>> octets{};  // data of the commands
    std::deque<std::vector<PdoEntry>> entries{};
    std::deque<std::vector<Pdo>> pdos{};
    std::vector<SmPdos> lists{};
    std::vector<EniBits> outputs{};  // Send
    std::vector<EniBits> inputs{};   // Recv
    bool reference_clock = false;
    bool uses_clock = false;
    int group = -1;
};

// False: an element occurs twice that an ENI has only once. Then the reader has failed.
[[nodiscard]] bool check_eni_once(Reader& reader);
[[nodiscard]] EniSlaveData read_eni_slave(Reader& reader, Node node, std::uint16_t position);
// Reads a time in milliseconds. An unusually long time is used, with a remark.
[[nodiscard]] Duration read_eni_time(Reader& reader, const Value& value);
// Reads the SYNC signals from the init commands of the slave.
void read_eni_sync(Reader& reader, EniSlaveData& slave);
// The commands of EoE and AoE.
void read_eni_mail(Reader& reader, Node mailbox, EniSlaveData& slave);
// An init command of the master becomes a command of the slaves that it addresses.
void add_master_command(Reader& reader, const EniInit& init, std::deque<EniSlaveData>& slaves);
void add_register_command(Reader& reader, const EniInit& init, EniSlaveData& slave);
// Adds a remark about a command that both functions above leave out, because its registers belong to the library.
void name_library_register(Reader& reader, const EniInit& init);
// The SyncManagers of process data with their FMMUs, and the PDOs: fills config.sms and the lists.
void make_process_data(Reader& reader, EniSlaveData& slave);
// The Cyclic elements: groups, places in the images, clocks.
void read_eni_cycles(Reader& reader, Node config, std::deque<EniSlaveData>& slaves, EniConfiguration& into);
// Adds remarks about contents that the library applies in another way or not at all, and reads the mailboxes. `clocks`:
// the file uses clocks.
void name_unused(Reader& reader, const std::vector<EniInit>& master, std::deque<EniSlaveData>& slaves, bool clocks);
// Adds remarks about invalid values in unused elements, and about process data that the file describes in two different
// ways.
void name_nonsense(Reader& reader, const std::deque<EniSlaveData>& slaves);
// Adds remarks about variables of one direction with wrong sizes or places. `nodes`: the elements of the variables.
void name_odd_variables(Reader& reader, std::span<const EniVariable> variables, std::span<const Node> nodes);
void read_eni_variables(Reader& reader, Node config, const std::deque<EniSlaveData>& slaves, EniConfiguration& into);

}  // namespace margay::files
