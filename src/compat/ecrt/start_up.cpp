// Flags of a configuration, and what they and the IP parameters do at the start-up of a slave.
#include "compat/ecrt/start_up.hpp"

#include "compat/ecrt/log.hpp"

#include <cerrno>
#include <chrono>
#include <string_view>

namespace margay::compat::ecrt {
namespace {

Task<> before_safeop(HookedSlave slave, void* user) {
    const auto& config = *static_cast<const ec_slave_config*>(user);
    if (!(config.ip == EoeIp{})) {
        co_await completion(set_ip(slave, config));
    }
    if (config.wait_before_safeop > Duration{0}) {
        co_await completion(slave.sleep(config.wait_before_safeop));
    }
    co_return {};
}

}  // namespace

void prepare_start_up(const Slave& slave, ec_slave_config& config) {
    if (config.ip == EoeIp{} && config.wait_before_safeop == Duration{0}) return;
    slave.hooks.preop_to_safeop = before_safeop;
    slave.hooks.user = &config;
}

}  // namespace margay::compat::ecrt

using namespace margay;
using namespace margay::compat::ecrt;

// The interface stores any key, and reads those that it knows.
int ecrt_slave_config_flag(ec_slave_config_t* sc, const char* key, int32_t value) {
    if (key == nullptr) return -EINVAL;
    if (refuse_active(*sc)) return -EBUSY;
    const std::string_view flag(key);
    if (flag == "WaitBeforeSAFEOPms") {
        if (value < 0) return -EINVAL;
        sc->wait_before_safeop = std::chrono::milliseconds(value);
    } else if (flag != "AssignToPdi") {  // each slave has its EEPROM from before PREOP on
        say("configuration %u:%u: the flag %s has no effect", sc->alias, sc->position, key);
    }
    return 0;
}
