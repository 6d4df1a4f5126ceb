// The parts of the writer of ENI files.
#pragma once

#include "files/xml_writer.hpp"

#include <margay/context.hpp>

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace margay::files {

// The registers of a slave.
struct SlaveRegisters {
    std::uint16_t station = 0;
    std::vector<std::byte> fmmus{};
    std::vector<std::byte> sms{};
    std::array<std::byte, 2> assign_activate{};
    std::array<std::byte, 8> cycles{};
    bool sync = false;
    // Address and value of the watchdog registers that the configuration sets.
    std::vector<std::pair<std::uint16_t, std::array<std::byte, 2>>> watchdogs{};
};

// The init commands of a slave. Returns a sentence for each part of the configuration that an ENI cannot express.
[[nodiscard]] std::vector<std::string> write_slave_inits(Node parent, const Slave& slave,
                                                         const SlaveRegisters& registers);
// Alias or device id of a slave with a place in the line or in a group, and the hot connect group that begins with the
// slave. `info` and `node`: the elements Info and Slave. Both functions return a sentence for each part that an ENI
// cannot express.
[[nodiscard]] std::vector<std::string> write_identification(Node info, Context& ctx, const Slave& slave);
[[nodiscard]] std::vector<std::string> write_hot_connect(Node node, Context& ctx, const Slave& slave);
// The start-up commands by mailbox, the modules, and the PDOs that are written. Reads the list of configured modules.
void write_mail_commands(Node mailbox, Context& ctx, const Slave& slave);
// The registers of the watchdogs that the configuration sets; config_map() writes them.
[[nodiscard]] std::vector<std::uint16_t> watchdogs_in_use(const Slave& slave);
// Returns a sentence for each part of the mailbox commands and of the states of the slave that an ENI cannot express.
[[nodiscard]] std::vector<std::string> unwritable(const Slave& slave);
// The start-up commands of EoE or AoE in their element, `name`.
void write_message_commands(Node mailbox, const char* name, StartupCommand::Kind kind,
                            const SlaveConfiguration& config);
// The time that a command by mailbox may take, in ms, rounded up. 0: not given.
[[nodiscard]] std::uint64_t mail_timeout_ms(const StartupCommand& command, const SlaveConfiguration& config);
void write_transitions(Node command, Transition transitions);
// Reads the SII up to its end mark; returns an error in words.
[[nodiscard]] std::string read_sii_image(Context& ctx, std::uint16_t slave, std::vector<std::byte>& image);

}  // namespace margay::files
