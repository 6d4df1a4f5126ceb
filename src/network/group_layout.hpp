// The image of a group: its layout, its place among the logical addresses of all groups, and its frames.
#pragma once

#include "network/network.hpp"

namespace margay {

[[nodiscard]] inline Error group_fault(Errc code, std::uint8_t group) {
    return {.code = code, .step = Step::map_process_data, .index = group};
}
// The group is not mapped, or does not exist: then the error has the number of groups.
[[nodiscard]] inline Error unmapped_group(const Network& network, std::uint8_t group) {
    const auto groups = static_cast<std::uint32_t>(network.process.groups.size());
    Error error = group_fault(Errc::unknown_group, group);
    if (group >= groups) error.expected = groups;
    return error;
}

// Lays out the process data of the slaves of the group in `image`, and prepares its frames. No slave takes part yet.
// Errors: the errors of the whole group, see config_map().
[[nodiscard]] Result<> lay_out_group(Network& network, std::uint8_t number, MutableBytes image);

}  // namespace margay
