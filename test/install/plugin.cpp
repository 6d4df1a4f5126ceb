// A shared object that contains a master.
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

extern "C" std::size_t plugin_slaves();
extern "C" std::size_t plugin_slaves() {
    margay::HostContext ctx;
    return ctx.slaves().size();
}
