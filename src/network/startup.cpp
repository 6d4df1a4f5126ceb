#include "network/startup.hpp"

namespace margay {

Task<Result<>> run_startup(Station station, const Slave& slave, Transition transition) {
    for (const RegisterWrite& item : slave.config.startup_registers) {
        if (item.transition != transition) continue;
        if (item.length == 0 || item.length > item.value.size())
            co_return station.error(Errc::invalid_argument, Step::startup, item.address);
        Datagram write(station.engine.link(), wire::Command::FPWR, {station.address, item.address}, Bytes(item.value).first(item.length));
        auto reply = co_await write;
        const Error error = judge(station, reply, Step::startup, item.address);
        if (error.code != Errc::none) co_return error;
    }
    co_return Result<>();
}

}  // namespace margay
