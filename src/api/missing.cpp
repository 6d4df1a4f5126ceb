#include "api/master.hpp"
#include "network/wanted.hpp"

#include <margay/missing.hpp>

namespace margay {

bool may_be_missing(Context& ctx, std::uint16_t slave) {
    Master* const master = master_of(ctx);
    if (master == nullptr || slave < 1 || slave > master->network.count) return false;
    return may_be_missing(master->network, master->network.slave(slave));
}

}  // namespace margay
