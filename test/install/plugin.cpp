// A shared object that has a master in it.
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

extern "C" std::size_t plugin_slaves();
extern "C" std::size_t plugin_slaves() {
    margay::HostContext ctx;
    return ctx.slaves().size();
}
