// The init commands of an ENI for a slave.
#include "files/eni_write.hpp"
#include "files/modules.hpp"
#include "files/transitions.hpp"
#include "wire/esc.hpp"

#include <margay/expected.hpp>

#include <algorithm>

namespace margay::files {
namespace {

namespace reg = wire::reg;

constexpr std::uint8_t kApwr = 2;
constexpr std::uint8_t kFprd = 4;
constexpr std::uint8_t kFpwr = 5;
constexpr std::uint8_t kAprd = 1;

using When = std::initializer_list<const char*>;

class InitWriter {
  public:
    InitWriter(Node parent, const Slave& slave, const SlaveRegisters& registers)
        : parent_(parent), slave_(slave), registers_(registers) {}

    std::vector<std::string> run() {
        state({"IP"}, kApwr, "INIT", 0x11, 0x01, 3000);
        identity();
        command({"IP"}, "set physical address", kApwr, 0x0010, hex_value(registers_.station, 2));
        mailbox_sync_managers();
        registers_of({Transition::init_to_preop});
        command({"IP"}, "assign EEPROM to PDI", kFpwr, 0x0500, "01");
        state({"IP"}, kFpwr, "PREOP", 0x12, 0x02, ms(slave_.config.times().to_preop, 3000));
        sync();
        process_sync_managers();
        fmmus();
        registers_of({Transition::preop_to_safeop});
        for (const auto& [address, value] : registers_.watchdogs)
            command({"PS"}, "set watchdog", kFpwr, address, hex_octets(value));
        state({"PS"}, kFpwr, "SAFEOP", 0x04, 0x04, ms(slave_.config.times().to_safeop, 10000));
        registers_of({Transition::safeop_to_op});
        state({"SO"}, kFpwr, "OP", 0x08, 0x08, ms(slave_.config.times().to_op, 10000));
        registers_of({Transition::op_to_safeop, Transition::op_to_preop, Transition::op_to_init,
                      Transition::safeop_to_preop, Transition::safeop_to_init, Transition::preop_to_init,
                      Transition::init_to_boot, Transition::boot_to_init});
        const auto down = ms(slave_.config.times().down, 5000);
        state({"OS"}, kFpwr, "SAFEOP", 0x04, 0x04, down);
        state({"SP", "OP"}, kFpwr, "PREOP", 0x02, 0x02, down);
        state({"PI", "SI", "OI"}, kApwr, "INIT", 0x01, 0x01, down);
        return std::move(lost_);
    }

  private:
    static std::uint64_t ms(Duration time, std::uint64_t usual) {
        if (time <= Duration{0}) return usual;
        return static_cast<std::uint64_t>(std::chrono::ceil<std::chrono::milliseconds>(time).count());
    }

    Node command(When when, const std::string& comment, std::uint8_t cmd, std::uint16_t ado, const std::string& data) {
        std::vector<std::string> names(when.begin(), when.end());
        return command(names, comment, cmd, ado, data, true, 3);
    }
    Node command(const std::vector<std::string>& when, const std::string& comment, std::uint8_t cmd, std::uint16_t ado,
                 const std::string& data, bool counts, std::uint16_t retries) {
        Node node = add(parent_, "InitCmd");
        for (const std::string& one : when) add(node, "Transition", one);
        add(node, "Comment", comment);
        add(node, "Cmd", std::uint64_t{cmd});
        const bool by_position = cmd == kApwr || cmd == kAprd;
        const auto position = static_cast<std::uint16_t>(1 - slave_.ring_position);
        add(node, "Adp", std::uint64_t{by_position ? position : registers_.station});
        add(node, "Ado", std::uint64_t{ado});
        add(node, "Data", data);
        if (counts) add(node, "Cnt", std::uint64_t{1});
        add(node, "Retries", std::uint64_t{retries});
        return node;
    }
    static void validate(Node node, const std::string& data, const std::string& mask, std::uint64_t timeout_ms,
                         bool at_least = false) {
        Node validate = add(node, "Validate");
        if (at_least) set(validate, "Type", std::string("EQ_OR_G"));
        add(validate, "Data", data);
        if (!mask.empty()) add(validate, "DataMask", mask);
        add(validate, "Timeout", timeout_ms);
    }

    void state(When when, std::uint8_t cmd, const std::string& name, std::uint8_t control, std::uint8_t wanted,
               std::uint64_t timeout_ms) {
        command(when, "set device state to " + name, cmd, reg::kAlControl.address, hex_value(control, 2));
        Node check = command(when, "check device state for " + name, cmd == kApwr ? kAprd : kFprd,
                             reg::kAlStatus.address, hex_value(0, 2));
        validate(check, hex_value(wanted, 2), hex_value(0x0F, 2), timeout_ms);
    }

    void identity() {
        command({"IP"}, "assign EEPROM to ECAT", kApwr, 0x0500, "00");
        const auto check = [&](const char* comment, std::uint32_t word, std::uint32_t value, bool at_least = false) {
            command({"IP"}, comment, kApwr, 0x0502, "0001" + hex_value(word, 4));
            validate(command({"IP"}, comment, kAprd, 0x0508, hex_value(0, 4)), hex_value(value, 4), {}, 100, at_least);
        };
        check("check vendor id", 0x08, slave_.identity.vendor);
        check("check product code", 0x0A, slave_.identity.product);
        static const ExpectedSlave kNothingExpected{};
        const ExpectedSlave& wanted = slave_.wanted == nullptr ? kNothingExpected : *slave_.wanted;
        check("check revision number", 0x0C, wanted.revision.value_or(slave_.identity.revision), wanted.newer_revision);
        if (wanted.serial) check("check serial number", 0x0E, *wanted.serial);
    }

    void mailbox_sync_managers() {
        for (std::size_t n = 0; n < 2 && (n + 1) * 8 <= registers_.sms.size() && slave_.mailbox.present(); ++n)
            write_sm("IP", n);
    }
    void process_sync_managers() {
        for (const ProcessSm& sm : slave_.config.used_sms())
            if ((sm.number + 1U) * 8 <= registers_.sms.size() && sm.bits != 0) write_sm("PS", sm.number);
    }
    void write_sm(const char* when, std::size_t n) {
        std::array<std::byte, 8> octets{};
        std::copy_n(registers_.sms.begin() + static_cast<std::ptrdiff_t>(n * 8), 8, octets.begin());
        octets[5] = std::byte{0};   // the status
        octets[7] = std::byte{0};   // of the PDI
        octets[6] &= std::byte{1};  // without the repeat request
        command({when}, "set sm " + std::to_string(n), kFpwr, static_cast<std::uint16_t>(0x0800 + 8 * n),
                hex_octets(octets));
    }
    void fmmus() {
        for (std::size_t at = 0; at + 16 <= registers_.fmmus.size(); at += 16) {
            const auto one = std::span(registers_.fmmus).subspan(at, 16);
            if ((one[12] & std::byte{1}) == std::byte{0}) continue;
            command({"PS"}, "set fmmu " + std::to_string(at / 16), kFpwr, static_cast<std::uint16_t>(0x0600 + at),
                    hex_octets(one));
        }
    }
    void sync() {
        if (!registers_.sync) return;
        command({"PS"}, "set dc cycle time", kFpwr, 0x09A0, hex_octets(registers_.cycles));
        command({"PS"}, "set dc start time", kFpwr, 0x0990, hex_value(0, 8));
        command({"PS"}, "set dc activation", kFpwr, 0x0980, hex_octets(registers_.assign_activate));
    }

    // The start-up commands for registers whose first transition is one of these.
    void registers_of(std::initializer_list<Transition> wanted) {
        for (const StartupCommand& one : slave_.config.startup()) {
            const bool writes = one.kind == StartupCommand::Kind::write_register;
            if (!writes && one.kind != StartupCommand::Kind::check_register) continue;
            const auto first =
                std::ranges::find_if(kTransitions, [&](Transition t) { return contains(one.transitions, t); });
            if (first == kTransitions.end() || std::ranges::find(wanted, *first) == wanted.end()) continue;
            if (one.moment == Moment::after || one.may_fail)
                lost_.push_back("slave " + std::to_string(slave_.number) + ": the command for register " +
                                hex(one.index) +
                                " is executed after its transition or may fail, which an ENI cannot say");
            std::vector<std::string> when;
            for (const Transition t : kTransitions)
                if (contains(one.transitions, t)) when.emplace_back(initials(t));
            const std::string data = writes ? hex_octets(one.octets()) : hex_value(0, one.octets().size());
            Node node = command(when, "start-up command", writes ? kFpwr : kFprd, one.index, data, !one.any_counter,
                                one.retries);
            if (!writes)
                validate(node, hex_octets(one.octets()), hex_octets(std::span(one.mask).first(one.length)),
                         ms(one.timeout, 0));
        }
    }

    Node parent_;
    const Slave& slave_;
    const SlaveRegisters& registers_;
    std::vector<std::string> lost_;
};

void coe_command(Node inits, Transition transitions, std::uint16_t index, std::uint8_t subindex,
                 const std::string& data, std::uint64_t timeout_ms, bool complete) {
    Node node = add(inits, "InitCmd");
    if (complete) set(node, "CompleteAccess", true);
    write_transitions(node, transitions);
    add(node, "Timeout", timeout_ms);
    add(node, "Ccs", std::uint64_t{1});
    add(node, "Index", std::uint64_t{index});
    add(node, "SubIndex", std::uint64_t{subindex});
    add(node, "Data", data);
}

// The PDOs that the library writes, in the order that the standard requires: counts of 0, the lists, the counts.
void pdo_commands(Node inits, const Slave& slave) {
    constexpr Transition kWhen = Transition::preop_to_safeop;
    const bool assign = (slave.coe_details & coe_detail::kPdoAssignment) != 0;
    const bool configure = (slave.coe_details & coe_detail::kPdoConfiguration) != 0;
    const auto write = [&](std::uint16_t index, std::size_t subindex, std::uint32_t value, std::size_t octets) {
        coe_command(inits, kWhen, index, static_cast<std::uint8_t>(subindex), hex_value(value, octets),
                    mail_timeout_ms({}, slave.config), false);
    };
    for (const SmPdos& list : slave.config.pdos()) {
        const auto assignment = static_cast<std::uint16_t>(0x1C10 + list.sync_manager);
        if (assign) write(assignment, 0, 0, 1);
        for (const Pdo& pdo : list.pdos) {
            if (!configure || pdo.entries.empty()) continue;
            write(pdo.index, 0, 0, 1);
            for (std::size_t n = 0; n < pdo.entries.size(); ++n)
                write(pdo.index, n + 1,
                      std::uint32_t{pdo.entries[n].index} << 16 | std::uint32_t{pdo.entries[n].subindex} << 8 |
                          pdo.entries[n].bits,
                      4);
            write(pdo.index, 0, static_cast<std::uint32_t>(pdo.entries.size()), 1);
        }
        if (!assign) continue;
        for (std::size_t n = 0; n < list.pdos.size(); ++n) write(assignment, n + 1, list.pdos[n].index, 2);
        write(assignment, 0, static_cast<std::uint32_t>(list.pdos.size()), 1);
    }
}

// Writes the list of configured modules, if the slave has such a list and no start-up command writes it. It is written
// before the PDOs, which depend on the modules.
void module_commands(Node inits, Context& ctx, const Slave& slave) {
    if ((slave.mailbox.protocols & mailbox_protocol::kCoE) == 0) return;
    if (!configured_modules(slave.config.startup()).empty()) return;
    const std::vector<std::uint32_t> idents = modules_in_use(ctx, slave.number);
    if (idents.empty()) return;
    const auto write = [&](std::size_t subindex, std::uint64_t value, std::size_t octets) {
        coe_command(inits, Transition::init_to_preop, kConfiguredModules, static_cast<std::uint8_t>(subindex),
                    hex_value(value, octets), mail_timeout_ms({}, slave.config), false);
    };
    write(0, 0, 1);
    for (std::size_t n = 0; n < idents.size(); ++n) write(n + 1, idents[n], 4);
    write(0, idents.size(), 1);
}

}  // namespace

std::vector<std::string> write_slave_inits(Node parent, const Slave& slave, const SlaveRegisters& registers) {
    return InitWriter(parent, slave, registers).run();
}

void write_mail_commands(Node mailbox, Context& ctx, const Slave& slave) {
    Node coe = add(mailbox, "CoE");
    Node inits = add(coe, "InitCmds");
    module_commands(inits, ctx, slave);
    if (!slave.config.fixed_pdos) pdo_commands(inits, slave);
    write_message_commands(mailbox, "EoE", StartupCommand::Kind::send_eoe, slave.config);
    Node soe = add(mailbox, "SoE");
    Node parameters = add(soe, "InitCmds");
    for (const StartupCommand& one : slave.config.startup()) {
        if (one.kind == StartupCommand::Kind::write_object)
            coe_command(inits, one.transitions, one.index, one.subindex, hex_octets(one.octets()),
                        mail_timeout_ms(one, slave.config), one.complete_access);
        if (one.kind != StartupCommand::Kind::write_parameter) continue;
        Node node = add(parameters, "InitCmd");
        write_transitions(node, one.transitions);
        add(node, "Timeout", mail_timeout_ms(one, slave.config));
        add(node, "OpCode", std::uint64_t{3});
        add(node, "DriveNo", std::uint64_t{one.subindex});
        add(node, "IDN", std::uint64_t{one.index});
        add(node, "Elements", std::uint64_t{0x40});  // the value
        add(node, "Data", hex_octets(one.octets()));
    }
    write_message_commands(mailbox, "AoE", StartupCommand::Kind::send_aoe, slave.config);
    if (!inits.first_child()) coe.remove_child(inits);
    if (!coe.first_child()) mailbox.remove_child(coe);
    if (!parameters.first_child()) mailbox.remove_child(soe);
}

}  // namespace margay::files
