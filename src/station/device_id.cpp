#include "station/device_id.hpp"

#include "station/al_state.hpp"
#include "station/sii_access.hpp"

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr Step kStep = Step::identify;
constexpr Duration kPatience = std::chrono::milliseconds(200);
constexpr Duration kPause = std::chrono::milliseconds(1);

Task<Result<std::uint16_t>> from_memory(Station station, std::uint16_t sii_word) {
    std::array<std::byte, 2> address{};
    SiiReader reader(station);
    co_await required(reader.read(sii_word, address));
    auto id = co_await read<std::uint16_t>(station, {load_le<std::uint16_t>(address), 2}, kStep);
    co_return id;
}

// Reads AL status and AL status code in one datagram until the slave reports its device id.
Task<Result<std::uint16_t>> await_id(Station station) {
    constexpr std::size_t kCodeAt = reg::kAlStatusCode.address - reg::kAlStatus.address;
    const Time give_up = station.engine.now() + kPatience;
    for (;;) {
        std::array<std::byte, kCodeAt + 2> octets{};
        Datagram look(station.engine.link(), wire::Command::FPRD, {station.address, reg::kAlStatus.address},
                      MutableBytes(octets));
        auto reply = co_await look;
        const Error error = error_of_reply(station, reply, kStep, reg::kAlStatus.address);
        if (error.code != Errc::none) co_return error;
        const auto status = load_le<std::uint16_t>(octets);
        const bool answered =
            (status & wire::al::kDeviceIdentification) != 0 && (status & wire::al::kErrorIndication) == 0;
        if (answered) co_return load_le<std::uint16_t>(octets, kCodeAt);
        if (station.engine.now() >= give_up) co_return station.error(Errc::unsupported, kStep);
        co_await station.engine.sleep_for(kPause);
    }
}

Task<Result<std::uint16_t>> from_al_status(Station station) {
    const auto status = co_await required(read<std::uint16_t>(station, reg::kAlStatus, kStep));
    const auto state = static_cast<std::uint16_t>(status & wire::al::kStateMask);
    // A slave with an error indication answers no request: the same write acknowledges the error.
    const unsigned acknowledge = (status & wire::al::kErrorIndication) != 0 ? wire::al::kErrorAcknowledge : 0U;
    const auto request = static_cast<std::uint16_t>(state | wire::al::kDeviceIdentification | acknowledge);
    auto asked = co_await write<std::uint16_t>(station, reg::kAlControl, request, kStep);
    if (does_not_answer(asked.error())) asked = co_await request_again(station, request, kStep, kPatience);
    if (!asked) co_return asked.error();
    auto id = co_await await_id(station);
    auto ended = co_await write<std::uint16_t>(station, reg::kAlControl, state, kStep);
    co_return id && !ended ? Result<std::uint16_t>(ended.error()) : id;
}

}  // namespace

// A slave without a processor mirrors AL control: a set bit 5 would not be an answer.
Task<Result<std::uint16_t>> read_device_id(Station station, const Slave& slave) {
    if (slave.device_id_source == DeviceIdSource::memory)
        co_return co_await required(from_memory(station, slave.device_id_word));
    if (slave.device_emulation) co_return station.error(Errc::unsupported, kStep);
    co_return co_await required(from_al_status(station));
}

}  // namespace margay
