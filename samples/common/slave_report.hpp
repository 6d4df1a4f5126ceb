// Describes a segment for slaveinfo, as text for people and as JSON for programs.
#pragma once

#include <margay/context.hpp>
#include <margay/event.hpp>

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace margay::samples {

// The sentence of describe() for the user of a program, without names of functions. If a module differs from the ENI
// file, the sentence contains the slot.
[[nodiscard]] std::string sentence(const Error& error);
[[nodiscard]] std::string sentence(const Event& event);
// The same without the number of the slave, for a caller that names the slave itself. (An error without a slave has
// another sentence, which does not name the register or the object.)
[[nodiscard]] std::string sentence_without_slave(const Error& error);

// Removes all errors from errors() and returns their sentences, oldest first, except sentences that are equal to
// `printed`: errors() also has the error that a call has returned, and the program has printed that error already.
[[nodiscard]] std::vector<std::string> take_errors(Context& ctx, const std::string& printed = {});

// "PREOP", "SAFEOP + ERROR" …
[[nodiscard]] std::string al_text(const AlStatus& al);

// The names of the bits of MailboxInfo::protocols ("CoE") and of Slave::coe_details ("SDO information").
[[nodiscard]] std::vector<std::string> protocol_names(unsigned bits);
[[nodiscard]] std::vector<std::string> coe_detail_names(unsigned bits);

// A text that a slave has sent, for a terminal, JSON and XML: in UTF-8 (other octets count as ISO 8859-1), with ?
// in the place of control characters and of invisible characters, for example characters that turn the direction of a
// text.
[[nodiscard]] std::string words_of_slave(std::string_view octets);

// Describes one slave in several lines.
[[nodiscard]] std::string slave_text(const Slave& slave);

// The segment as a tree, one line per slave. Slaves in a line share a column; branches are indented.
[[nodiscard]] std::string topology_text(Context& ctx);

// A sentence about a fault of a ring with two NICs; empty with one NIC, and when the ring is not broken.
[[nodiscard]] std::string ring_remark(Context& ctx);

[[nodiscard]] nlohmann::ordered_json segment_json(Context& ctx);

}  // namespace margay::samples
