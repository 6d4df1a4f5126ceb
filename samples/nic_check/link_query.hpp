// Data about an interface that only rtnetlink provides.
#pragma once

#include <optional>
#include <string>

namespace margay::nic_check {

struct LinkQuery {
    std::optional<std::string> qdisc{};
    std::string kind{};    // of a virtual interface
    std::string master{};  // name of the bridge or bond
    std::string problem{};
};

// Uses the network namespace of the calling thread.
[[nodiscard]] LinkQuery query_link(int index);

}  // namespace margay::nic_check
