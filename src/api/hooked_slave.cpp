// The functions of HookedSlave: access of a hook to its slave.
#include "api/mail.hpp"
#include "mailbox/coe_sdo.hpp"
#include "mailbox/soe.hpp"
#include "network/hooks.hpp"
#include "network/pdos.hpp"
#include "station/register_access.hpp"

#include <algorithm>

namespace margay {
namespace {

Network& network_of(const HookedSlave& slave) { return HookAccess::network(slave); }

Task<Result<std::size_t>> read_object(HookedSlave hooked, SdoObject object, MutableBytes into) {
    const HookCall call(hooked);
    Network& network = network_of(hooked);
    Result<std::size_t> read = check_coe(network, hooked.number(), Step::sdo_upload, object.index, object.subindex);
    if (read)
        read = co_await sdo_upload(network.mailbox(hooked.slave()), object, into, startup_patience(hooked.slave()));
    co_await call.pause_after(read.error());
    co_return read;
}

Task<> write_object(HookedSlave hooked, SdoObject object, Bytes value) {
    const HookCall call(hooked);
    Network& network = network_of(hooked);
    Result<> written = check_coe(network, hooked.number(), Step::sdo_download, object.index, object.subindex);
    if (written)
        written =
            co_await sdo_download(network.mailbox(hooked.slave()), object, value, startup_patience(hooked.slave()));
    co_await call.pause_after(written.error());
    co_return written;
}

SoeTarget target(std::uint8_t drive, Idn idn) { return {.idn = idn, .drive = drive, .elements = soe_element::kValue}; }

Task<Result<std::size_t>> read_parameter(HookedSlave hooked, std::uint8_t drive, Idn idn, MutableBytes into) {
    const HookCall call(hooked);
    Network& network = network_of(hooked);
    Result<std::size_t> read = check_soe(network, hooked.number(), Step::soe_read, drive, idn);
    if (read)
        read = co_await soe_read(network.mailbox(hooked.slave()), target(drive, idn), into,
                                 startup_patience(hooked.slave()));
    co_await call.pause_after(read.error());
    co_return read;
}

Task<> write_parameter(HookedSlave hooked, std::uint8_t drive, Idn idn, Bytes value) {
    const HookCall call(hooked);
    Network& network = network_of(hooked);
    Result<> written = check_soe(network, hooked.number(), Step::soe_write, drive, idn);
    if (written)
        written = co_await soe_write(network.mailbox(hooked.slave()), target(drive, idn), value,
                                     startup_patience(hooked.slave()));
    co_await call.pause_after(written.error());
    co_return written;
}

Task<> execute(HookedSlave hooked, std::uint8_t drive, Idn idn) {
    const HookCall call(hooked);
    Network& network = network_of(hooked);
    Result<> done = check_soe(network, hooked.number(), Step::soe_command, drive, idn);
    if (done)
        done =
            co_await soe_execute(network.mailbox(hooked.slave()), target(drive, idn), startup_patience(hooked.slave()));
    co_await call.pause_after(done.error());
    co_return done;
}

// Data of a datagram: the destination of a read, or the source of a write.
template <class Data>
Task<> access_register(HookedSlave hooked, wire::Command command, std::uint16_t address, Data data, Step step) {
    const HookCall call(hooked);
    const Station station = network_of(hooked).station(hooked.slave());
    Error error;
    if (step == Step::write_register) error = check_same_slave(network_of(hooked), hooked.number(), step);
    if (error.code != Errc::none) {
        error.index = address;
    } else if (is_register_range(address, data.size())) {
        Datagram datagram(station.engine.link(), command, {station.address, address}, data);
        auto reply = co_await datagram;
        error = error_of_reply(station, reply, step, address);
    } else {
        error = invalid(Argument::register_octets, step, hooked.number(), address);
    }
    co_await call.pause_after(error);
    co_return error;
}

Task<> sleep_for(HookedSlave hooked, Duration duration) {
    Engine& engine = network_of(hooked).engine;
    // Also without a time to wait, poll() comes first: other slaves and the cycle continue.
    co_await engine.sleep_for(std::max<Duration>(duration, std::chrono::microseconds(1)));
    co_return Nothing{};
}

}  // namespace

const Slave& HookedSlave::slave() const { return network_->slave(number_); }
Arena& HookedSlave::arena() const { return network_->arena(); }

Task<Result<std::size_t>> HookedSlave::sdo_read(std::uint16_t index, std::uint8_t subindex, std::span<std::byte> into,
                                                bool complete_access) const {
    return read_object(*this, {index, subindex, complete_access}, into);
}
Task<> HookedSlave::sdo_write(std::uint16_t index, std::uint8_t subindex, std::span<const std::byte> value,
                              bool complete_access) const {
    return write_object(*this, {index, subindex, complete_access}, value);
}
Task<Result<std::size_t>> HookedSlave::soe_read(std::uint8_t drive, Idn idn, std::span<std::byte> into) const {
    return read_parameter(*this, drive, idn, into);
}
Task<> HookedSlave::soe_write(std::uint8_t drive, Idn idn, std::span<const std::byte> value) const {
    return write_parameter(*this, drive, idn, value);
}
Task<> HookedSlave::soe_command(std::uint8_t drive, Idn idn) const { return execute(*this, drive, idn); }
Task<> HookedSlave::register_read(std::uint16_t address, std::span<std::byte> into) const {
    return access_register(*this, wire::Command::FPRD, address, into, Step::read_register);
}
Task<> HookedSlave::register_write(std::uint16_t address, std::span<const std::byte> value) const {
    return access_register(*this, wire::Command::FPWR, address, value, Step::write_register);
}
Task<> HookedSlave::sleep(Duration duration) const { return sleep_for(*this, duration); }

}  // namespace margay
