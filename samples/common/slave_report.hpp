// What slaveinfo says of a segment, as text for people and as JSON for programs.
#pragma once

#include <margay/context.hpp>

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace margay::samples {

// The sentence that describe() writes.
[[nodiscard]] std::string sentence(const Error& error);

// "PREOP", "SAFEOP + ERROR" …
[[nodiscard]] std::string al_text(const AlStatus& al);

// One slave, several lines.
[[nodiscard]] std::string slave_text(const Slave& slave);

// The segment as a tree, a line a slave: slaves one behind the other share a column, branches are indented.
[[nodiscard]] std::string topology_text(Context& ctx);

[[nodiscard]] nlohmann::ordered_json segment_json(Context& ctx);

}  // namespace margay::samples
