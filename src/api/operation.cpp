#include "api/operation.hpp"

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

Error check_slave_or_all(Network& network, std::uint16_t slave, Step step) {
    return slave == 0 ? Error{} : check_slave(network, slave, step);
}

}  // namespace margay
