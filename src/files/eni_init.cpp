// Init commands of ENI files, and the start-up commands that they become.
#include "files/eni_read.hpp"
#include "files/esi_read.hpp"
#include "wire/esc.hpp"

#include <algorithm>

namespace margay::files {
namespace {

constexpr std::size_t kMostOctets = 1486;

// Registers that the library sets or reads by itself: station address, AL control and status, SII, FMMUs, SyncManagers,
// clocks and SYNC.
struct Range {
    std::uint16_t first;
    std::uint16_t end;
};
constexpr Range kOfLibrary[] = {{0x0010, 0x0012}, {0x0103, 0x0104}, {0x0120, 0x0122}, {0x0130, 0x0136},
                                {0x0500, 0x0510}, {0x0600, 0x0700}, {0x0800, 0x0880}, {0x0900, 0x09B0}};

bool is_of_library(std::uint16_t ado) {
    return std::ranges::any_of(kOfLibrary, [&](const Range& r) { return r.first <= ado && ado < r.end; });
}

// Whether a range of octets begins at another register and reaches one of these. Files write DL control (0x0100) as a
// whole, which contains 0x0103.
bool reaches_library(std::uint32_t ado, std::size_t octets) {
    const std::uint32_t end = ado + static_cast<std::uint32_t>(octets);
    if (ado >= 0x0100 && end == 0x0104) return false;
    return std::ranges::any_of(kOfLibrary, [&](const Range& r) { return ado < r.first && r.first < end; });
}

void read_validation(Reader& r, Node node, EniInit& init) {
    const Node validate = node.child("Validate");
    init.timeout = read_eni_time(r, child(node, "Timeout"));
    if (!validate) return;
    init.validates = true;
    init.wanted = r.octets(child(validate, "Data"));
    init.mask = r.octets(child(validate, "DataMask"));
    const Value type = attribute(validate, "Type");
    init.at_least = type.there && same_word(type.text, "EQ_OR_G");
    if (type.there && !init.at_least && !same_word(type.text, "EQ"))
        r.fail(validate, "Type '" + Reader::text(type) + "' of Validate is neither EQ nor EQ_OR_G");
    if (const Value timeout = child(validate, "Timeout"); timeout.there) init.timeout = read_eni_time(r, timeout);
    if (init.wanted.empty()) r.fail(validate, "Validate has no Data");
    if (init.wanted.size() > init.data.size()) r.fail(validate, "Validate compares more octets than the command reads");
    if (init.mask.empty()) init.mask.assign(init.wanted.size(), std::byte{0xFF});
    if (init.mask.size() == init.wanted.size()) return;
    r.fail(validate, "DataMask of Validate has another size than Data");
    init.mask.assign(init.wanted.size(), std::byte{0xFF});  // the reader continues, in order to report further faults
}

EniInit read_init(Reader& r, Node node) {
    EniInit init{.node = node};
    init.transitions = read_transitions(r, node);
    const auto cmd = r.required<std::uint8_t>(node, "Cmd");
    if (cmd > static_cast<std::uint8_t>(EniCmd::frmw))
        r.fail(node.child("Cmd"), "Cmd is " + std::to_string(cmd) + ", which is no EtherCAT command");
    init.cmd = static_cast<EniCmd>(cmd);
    init.adp = r.number<std::uint16_t>(child(node, "Adp"));
    init.ado = r.number<std::uint16_t>(child(node, "Ado"));
    if (init.cmd != EniCmd::nop && !child(node, "Ado").there && !child(node, "Addr").there)
        r.fail(node, "InitCmd has neither Ado nor Addr");
    init.data = r.octets(child(node, "Data"));
    if (const Value length = child(node, "DataLength"); length.there && init.data.empty()) {
        const auto octets = r.number<std::uint16_t>(length);
        if (octets > kMostOctets)
            r.fail(length.at, "DataLength is more than a datagram has room for");
        else
            init.data.resize(octets);
    }
    if (init.data.size() > kMostOctets) r.fail(node, "Data has more octets than a datagram has room for");
    if (const Value counter = child(node, "Cnt"); counter.there) init.counter = r.number<std::uint16_t>(counter);
    init.retries = r.number<std::uint16_t>(child(node, "Retries"));
    read_validation(r, node, init);
    return init;
}

std::string named(const EniInit& init) {
    if (init.cmd == EniCmd::lrd || init.cmd == EniCmd::lwr || init.cmd == EniCmd::lrw)
        return "an init command for a logical address is not supported: ";
    return "the init command for register " + hex(init.ado) + " is not supported: ";
}

// Sets the value of a command. A longer value stays in the data of the slave.
void set_value(StartupCommand& command, const std::vector<std::byte>& octets, EniSlaveData& slave) {
    if (octets.size() <= command.value.size()) {
        std::ranges::copy(octets, command.value.begin());
        command.length = static_cast<std::uint8_t>(octets.size());
    } else {
        command.data = Borrowed<std::byte>(std::span<const std::byte>(slave.octets.emplace_back(octets)));
    }
}

}  // namespace

bool EniInit::is_zero() const {
    return std::ranges::all_of(data, [](std::byte octet) { return octet == std::byte{0}; });
}

std::uint64_t EniInit::value(std::size_t at, std::size_t octets) const {
    std::uint64_t result = 0;
    for (std::size_t n = 0; n < octets && at + n < data.size(); ++n)
        result |= std::to_integer<std::uint64_t>(data[at + n]) << (8 * n);
    return result;
}

Duration read_eni_time(Reader& r, const Value& value) {
    constexpr std::uint32_t kUsual_ms = 600'000;
    const auto ms = r.number<std::uint32_t>(value);
    if (ms > kUsual_ms)
        r.remark(value.at, value.name + " is " + std::to_string(ms) + " ms: a slave that does not answer as the file " +
                               "wants may keep the start waiting for " + std::to_string(ms / 60'000) + " minutes");
    return std::chrono::milliseconds(ms);
}

std::vector<EniInit> read_eni_inits(Reader& r, Node parent) {
    std::vector<EniInit> inits;
    for (const Node node : parent.child("InitCmds").children("InitCmd")) inits.push_back(read_init(r, node));
    return inits;
}

void name_library_register(Reader& r, const EniInit& init) {
    if (init.transitions == Transition::none) return;
    // Every file checks the AL status, and reads the SII for the identity.
    const bool usual = init.ado == 0x0130 || init.ado == 0x0131 || (init.ado >= 0x0500 && init.ado < 0x0510);
    if (is_of_library(init.ado) && init.reads() && init.validates && !usual)
        r.remark(init.node, named(init) + "it checks a register that the library sets or reads by itself");
    if (init.writes() && reaches_library(init.ado, init.data.size()))
        r.remark(init.node, named(init) + "it writes registers behind it that the library sets or reads by itself");
}

void add_register_command(Reader& r, const EniInit& init, EniSlaveData& slave) {
    if (init.transitions == Transition::none || is_of_library(init.ado)) return;
    if (init.writes() && reaches_library(init.ado, init.data.size())) return;  // named
    if (!init.writes() && !init.reads()) {
        r.remark(init.node, named(init) + "only commands that read or write a register become start-up commands");
        return;
    }
    StartupCommand command{.any_counter = !init.counter,
                           .transitions = init.transitions,
                           .index = init.ado,
                           .retries = init.retries,
                           .timeout = init.timeout};
    const bool broadcast = init.cmd == EniCmd::bwr || init.cmd == EniCmd::brd;
    if (init.counter && *init.counter != 1 && !broadcast)
        r.remark(init.node, "the expected working counter " + std::to_string(*init.counter) +
                                " of an init command is not used: one slave counts 1");
    if (init.writes()) {
        if (init.data.empty() || init.data.size() > 1024) {
            r.remark(init.node, named(init) + "it writes no octet, or more than 1024");
            return;
        }
        command.kind = StartupCommand::Kind::write_register;
        set_value(command, init.data, slave);
    } else {
        // A command that only reads has no effect. But if it has a working counter, the slave must answer.
        if (!init.validates && (!init.counter || init.data.empty())) return;
        if (init.wanted.size() > command.value.size() || init.at_least) {
            r.remark(init.node, named(init) + "it compares more than 8 octets, or with EQ_OR_G");
            return;
        }
        command.kind = StartupCommand::Kind::check_register;
        const std::vector<std::byte> nothing(std::min(init.data.size(), command.value.size()));  // no bit is compared
        set_value(command, init.validates ? init.wanted : nothing, slave);
        std::ranges::copy(init.mask, command.mask.begin());
    }
    if (init.ado + command.octets().size() > 0x10000) {
        r.fail(init.node, "the init command ends behind address 0xffff");
        return;
    }
    slave.registers.push_back(command);
}

void add_master_command(Reader& r, const EniInit& init, std::deque<EniSlaveData>& slaves) {
    if (init.transitions == Transition::none || is_of_library(init.ado)) return;
    if (init.cmd == EniCmd::brd && !init.validates) return;
    if (init.cmd == EniCmd::bwr) {
        for (EniSlaveData& slave : slaves) add_register_command(r, init, slave);
        return;
    }
    const bool by_position = init.cmd == EniCmd::aprd || init.cmd == EniCmd::apwr;
    const bool by_station = init.cmd == EniCmd::fprd || init.cmd == EniCmd::fpwr;
    for (EniSlaveData& slave : slaves) {
        const auto position = static_cast<std::uint16_t>(-init.adp);
        const bool here = (by_position && slave.slave.ring_position == position) ||
                          (by_station && slave.slave.station_address == init.adp && init.adp != 0);
        if (!here) continue;
        add_register_command(r, init, slave);
        return;
    }
    r.remark(init.node, named(init) +
                            "of the master, only BWR, and commands that address one slave, become commands "
                            "of slaves");
}

}  // namespace margay::files
