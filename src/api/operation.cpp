#include "api/operation.hpp"

#include "network/doubt.hpp"
#include "network/newcomer.hpp"
#include "network/search.hpp"

namespace margay {

Error invalid(Argument argument, Step step, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex) {
    return {.code = Errc::invalid_argument,
            .step = step,
            .slave = slave,
            .index = index,
            .subindex = subindex,
            .detail = static_cast<std::uint32_t>(argument)};
}

Error check_slave(Network& network, std::uint16_t slave, Step step) {
    if (slave >= 1 && slave <= network.count) return {};
    return {.code = Errc::unknown_slave, .step = step, .slave = slave, .expected = network.count};
}

Error check_same_slave(Network& network, std::uint16_t slave, Step step) {
    Error error = check_slave(network, slave, step);
    if (error.code != Errc::none) return error;
    const Slave& one = network.slave(slave);
    const bool silent = note_silence(network) && is_known(one);
    error = {.step = step, .slave = slave};
    if (one.al.state == AlState::none && is_known(one))
        error.code = Errc::missing_slave;
    else if (silent || is_identity_unread(network, one))
        error.code = Errc::identity_unread;  // another device may answer at its address
    return error.code == Errc::none ? Error{} : error;
}

Error check_slave_or_all(Network& network, std::uint16_t slave, Step step) {
    return slave == 0 ? Error{} : check_slave(network, slave, step);
}

}  // namespace margay
