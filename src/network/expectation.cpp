#include "network/expectation.hpp"

#include <algorithm>

namespace margay {
namespace {

Slave* find(Network& network, const ExpectedSlave& wanted) {
    if (wanted.position != 0) return wanted.position <= network.count ? &network.slave(wanted.position) : nullptr;
    for (Slave& slave : network.slaves())
        if (slave.alias == wanted.alias) return &slave;
    return nullptr;
}

// The first thing that is not as expected; code none when all is.
Error difference(const Slave& slave, const ExpectedSlave& wanted) {
    Error error{.code = Errc::other_slave, .step = Step::identify, .slave = slave.position};
    error.detail = slave.identity.vendor;
    const auto differs = [&](const auto& expected, std::uint32_t actual, IdentityField what) {
        if (!expected.has_value() || *expected == actual) return false;
        error.expected = *expected;
        error.actual = actual;
        error.subindex = static_cast<std::uint8_t>(what);
        return true;
    };
    const Identity& id = slave.identity;
    if (differs(wanted.product, id.product, IdentityField::product) || differs(wanted.vendor, id.vendor, IdentityField::vendor) ||
        differs(wanted.revision, id.revision, IdentityField::revision) || differs(wanted.serial, id.serial, IdentityField::serial) ||
        differs(wanted.alias, slave.alias, IdentityField::alias))
        return error;
    return {};
}

}  // namespace

void compare_with_expected(Network& network) {
    if (network.expected.empty()) return;
    for (Slave& slave : network.slaves()) slave.expected = false;
    for (const ExpectedSlave& wanted : network.expected) {
        Slave* slave = find(network, wanted);
        if (slave == nullptr) {
            Error missing{.code = Errc::missing_slave, .step = Step::identify, .slave = wanted.position};
            missing.actual = wanted.alias.value_or(0);
            if (!wanted.optional) network.errors.add(missing);
            continue;
        }
        slave->expected = true;
        const Error error = difference(*slave, wanted);
        if (error.code != Errc::none) {
            network.note(*slave, error);
            continue;
        }
        if (wanted.config != nullptr) slave->config = *wanted.config;
        slave->config.optional |= wanted.optional;
    }
    for (Slave& slave : network.slaves())
        if (!slave.expected) network.note(slave, {.code = Errc::unexpected_slave, .step = Step::identify, .slave = slave.position});
}

}  // namespace margay
