// ENI files: the whole file.
#include "files/eni_read.hpp"

#include <algorithm>

namespace margay::files {
namespace {

// Assigns the numbers in the way of config_init(): the slaves with a fixed place in the order of the ring, then the
// members of hot connect groups in the order of the file.
void give_numbers(Reader& r, Node config, std::deque<EniSlaveData>& slaves) {
    std::vector<EniSlaveData*> line;
    std::uint8_t group = 0;
    unsigned members = 0;
    for (EniSlaveData& s : slaves) {
        if (const Node hot = s.node.child("HotConnect")) {
            if (group == 255) return r.fail(hot, "there are more than 255 hot connect groups");
            ++group;
            members = r.number<std::uint16_t>(child(hot, "GroupMemberCnt"), 1);
            if (members == 0) members = 1;
        }
        if (members != 0) {
            s.expected.hot_connect = group;
            s.expected.optional = static_cast<bool>(s.node.child("HotConnect"));  // a missing group is no error
            --members;
        } else {
            line.push_back(&s);
        }
    }
    if (members != 0) return r.fail(config, "a hot connect group has more members than the file has slaves");
    std::ranges::stable_sort(line, {}, [](const EniSlaveData* s) { return *s->slave.ring_position; });
    std::uint16_t number = 0;
    for (EniSlaveData* s : line) {
        if (number != 0 && line[number - 1U]->slave.ring_position == s->slave.ring_position)
            return r.fail(s->node, "two slaves have the same AutoIncAddr");
        s->slave.number = s->expected.number = ++number;
    }
    for (EniSlaveData& s : slaves)
        if (s.expected.hot_connect != 0) s.slave.number = ++number;
}

void read_slaves(Reader& r, Node config, const std::vector<EniInit>& master, std::deque<EniSlaveData>& slaves) {
    for (const Node node : config.children("Slave")) {
        if (slaves.size() == 65535) return r.fail(node, "there are more than 65535 slaves");
        slaves.push_back(read_eni_slave(r, node, static_cast<std::uint16_t>(slaves.size())));
        if (r.failed()) return;
    }
    std::map<std::uint16_t, std::uint32_t> lines;  // of station addresses
    for (const EniSlaveData& s : slaves) {
        const auto [first, is_new] = lines.emplace(s.slave.station_address, s.slave.line);
        if (s.slave.station_address != 0 && !is_new)
            return r.fail(s.node.child("Info"),
                          "the slave has the PhysAddr of the slave in line " + std::to_string(first->second));
    }
    for (const EniInit& init : master) {
        if (!r.expand(init.node, slaves.size())) return;
        name_library_register(r, init);
        add_master_command(r, init, slaves);
    }
    for (EniSlaveData& slave : slaves) make_process_data(r, slave);
    if (slaves.empty()) r.fail(config, "the file describes no slave");
}

// Makes the configuration of a slave. All data to which it points is copied into the owner.
void make_configuration(EniSlaveData& s, EniConfiguration& into) {
    std::vector<StartupCommand> commands = s.mail;
    commands.insert(commands.end(), s.registers.begin(), s.registers.end());
    if (!s.uses_clock) s.setup.dc = {};
    s.setup.startup = StartupCommands(Borrowed<StartupCommand>(std::span<const StartupCommand>(commands)));
    s.setup.pdos = PdoLists(Borrowed<SmPdos>(std::span<const SmPdos>(s.lists)));
    s.config.setup = &s.setup;
    into.owner->add(s.expected, s.config);
    into.slaves.push_back(s.slave);
}

bool check_root(Reader& r) {
    const Node root = r.root();
    const std::string_view kind = root.name();
    if (kind == "EncryptedEtherCATConfig")
        r.fail(root,
               "the ENI is locked by its vendor (EncryptedEtherCATConfig): it contains FMMUs that only this vendor's "
               "master can read");
    else if (kind == "EtherCATMailbox")
        r.fail(root,
               "the file is a list of start-up commands (EtherCATMailbox) and not the configuration of a segment");
    else if (kind != "EtherCATConfig")
        r.fail(root, "the root element is " + std::string(kind) + ": an ENI has EtherCATConfig");
    else if (!root.child("Config"))
        r.fail(root, "EtherCATConfig has no Config");
    return !r.failed() && check_eni_once(r);
}

void read_config(Reader& r, EniConfiguration& eni) {
    const Node config = r.root().child("Config");
    eni.master_name = Reader::text(child(config.child("Master").child("Info"), "Name"));
    if (const Node eoe = config.child("Master").child("EoE"))
        eni.eoe = {r.number<std::uint32_t>(child(eoe, "MaxPorts")), r.number<std::uint32_t>(child(eoe, "MaxFrames")),
                   r.number<std::uint32_t>(child(eoe, "MaxMACs"))};
    const std::vector<EniInit> master = read_eni_inits(r, config.child("Master"));
    std::deque<EniSlaveData> slaves;
    read_slaves(r, config, master, slaves);
    if (r.failed()) return;
    give_numbers(r, config, slaves);
    if (r.failed()) return;
    read_eni_cycles(r, config, slaves, eni);
    if (r.failed()) return;
    name_unused(r, master, slaves, eni.clocks.has_value());
    for (EniSlaveData& slave : slaves) {
        if (slave.group < 0 && slave.config.sm_count != 0)
            r.fail(slave.node, "no Cyclic element exchanges the process data of the slave");
        make_configuration(slave, eni);
    }
    read_eni_variables(r, config, slaves, eni);
}

}  // namespace

Limits EniConfiguration::limits() const {
    Limits limits;
    limits.slaves = static_cast<std::uint16_t>(std::max<std::size_t>(slaves.size(), 1));
    limits.groups = static_cast<std::uint16_t>(std::max<std::size_t>(groups.size(), 1));
    const std::size_t frames = groups.size() + image_bytes / 1024 + 4;
    limits.process_frames = static_cast<std::uint16_t>(std::min<std::size_t>(frames, 65535));
    return limits;
}

const EniVariable* EniConfiguration::find(std::string_view name) const {
    const auto found = std::ranges::find(variables, name, &EniVariable::name);
    return found == variables.end() ? nullptr : &*found;
}

Read<EniConfiguration> read_eni(std::string_view octets) {
    Reader r;
    Read<EniConfiguration> result;
    EniConfiguration eni;
    if (r.open(octets) && check_root(r)) read_config(r, eni);
    result.remarks = r.take_remarks();
    if (r.failed())
        result.problem = r.take_problem();
    else
        result.value = std::move(eni);
    return result;
}

}  // namespace margay::files
