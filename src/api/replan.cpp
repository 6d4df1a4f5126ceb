// Other frames for a group that is mapped.
#include "network/replan.hpp"

#include "api/master.hpp"
#include "network/group_layout.hpp"

#include <margay/margay.hpp>

namespace margay {

Result<> replan_processdata(Context& ctx, std::uint8_t group) {
    Master* master = master_of(ctx);
    Error error{.step = Step::map_process_data};
    if (master == nullptr)
        error.code = Errc::wrong_state;
    else if (!master->owned_by_caller())
        error.code = Errc::not_owner;
    else if (group >= master->network.process.groups.size())
        error = unmapped_group(master->network, group);
    if (error.code != Errc::none) return error;
    return replan(master->network, group);
}

}  // namespace margay
