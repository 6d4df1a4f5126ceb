#include "network/network.hpp"

namespace margay {

void Network::report(const Event& event) {
    Event now = event;
    now.at = engine.now();
    events.add(now);
}

void Network::note(const Error& error) {
    if (error.slave != 0 && error.slave <= count && marks(error.slave).repeating) return;
    (void)(is_warning(error.code) ? warnings : errors).add(error);
}

Task<Result<>> for_each_slave(Network& network, SlaveTask make, const void* what, Error* first) {
    Crew crew(network.tasks);
    for (Slave& slave : network.slaves()) {
        while (crew.full()) co_await crew.one();
        while (!crew.start(make(slave, what))) {
            if (crew.running() == 0) co_return Error{.code = Errc::capacity};
            co_await crew.one();
        }
    }
    co_await crew.all();
    if (first != nullptr) *first = crew.first_error();
    co_return Nothing{};
}

}  // namespace margay
