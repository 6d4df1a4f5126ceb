// Transfers that wait: objects and drive parameters of a slave, by its position in the ring.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/requests.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <thread>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

int errno_of(const Error& error) {
    switch (error.code) {
        case Errc::unknown_slave: return -EINVAL;
        case Errc::capacity: return -EOVERFLOW;
        case Errc::canceled: return -EINTR;
        case Errc::unsupported: return -EPROTONOSUPPORT;
        default: return -EIO;
    }
}

bool is_of(const ec_slave_config& config, const Slave& slave) {
    return config.number != 0 && config.number == slave.number;
}

// Before activation, the thread that polls brings slaves to PREOP: after a scan, and when their frames were lost.
bool is_ready_before_activation(Bus& bus, std::uint16_t position, Ready wanted) {
    if (bus.scan_busy || bus.dirty) return false;
    Slave slave;
    return wanted == Ready::read || !bus.slave_at(position, slave) || !is_on_its_way_to_preop(slave);
}

// Another thread may end the operation meanwhile.
bool is_ready(Bus& bus, std::uint16_t position, Ready wanted) {
    if (!bus.active) return is_ready_before_activation(bus, position, wanted);
    Slave slave;
    if (bus.slave_at(position, slave) && bus.active && is_unread(slave)) return false;
    const bool stays = slave.al.state >= AlState::safeop || slave.error.code != Errc::none;
    if (wanted == Ready::for_pdos && !stays && is_configured(bus, slave)) return false;
    const std::lock_guard lock(bus.config_mutex);
    if (!bus.active) return true;
    if (bus.operation->scanning() || bus.dirty) return false;
    return wanted == Ready::read || std::ranges::none_of(bus.configs, [&](const auto& config) {
               return is_of(*config, slave) && config->start_up.load(std::memory_order_acquire) != StartUp::over;
           });
}

// Submits the request, waits for its end, and prints the error. The request does not exist afterwards.
template <class Request>
int transfer(Bus& bus, std::uint16_t position, Request& request, Error& error) {
    const Passage passage(bus, position, Ready::for_mail);
    request.slave = bus.number_at(position);
    if (request.slave == 0) {
        say("master %u: there is no slave at position %u", bus.index, position);
        return -EINVAL;
    }
    auto done = submit(*bus.ctx, request);
    if (done) done = wait(*bus.ctx, request);
    if (done) return 0;
    error = done.error();
    error.slave = request.slave;  // also if the error of the library has no slave, because no cycle has sent a datagram
    say_error(bus, "transfer", error);
    return errno_of(error);
}

// The PDOs of the slave may have changed.
void note_download(Bus& bus, std::uint16_t position, std::uint16_t index) {
    if (is_of_pdos(index)) forget_pdos(bus, position);
}

int download(ec_master_t* master, std::uint16_t position, SdoDownload& request, std::uint32_t* abort_code) {
    Error error;
    const int result = transfer(*master->bus, position, request, error);
    if (abort_code != nullptr) *abort_code = error.code == Errc::sdo_abort ? error.detail : 0;
    note_download(*master->bus, position, request.index);
    return result;
}

int upload(ec_master_t* master, std::uint16_t position, SdoUpload& request, std::size_t* result_size,
           std::uint32_t* abort_code) {
    Error error;
    const int result = transfer(*master->bus, position, request, error);
    if (abort_code != nullptr) *abort_code = error.code == Errc::sdo_abort ? error.detail : 0;
    if (result_size != nullptr) *result_size = result == 0 ? request.bytes : 0;
    return result;
}

bool is_drive(const ec_master& master, std::uint16_t position, std::uint8_t drive) {
    if (drive > 7) say("master %u: position %u: there is no drive %u", master.bus->index, position, drive);
    return drive <= 7;
}

Borrowed<std::byte> octets(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const std::byte*>(data), size};
}
std::span<std::byte> room(std::uint8_t* target, std::size_t size) {
    return {reinterpret_cast<std::byte*>(target), size};
}

}  // namespace

namespace margay::compat::ecrt {

bool is_configured(Bus& bus, const Slave& slave) {
    const std::lock_guard lock(bus.config_mutex);
    if (!bus.active) return false;
    return bus.operation->scanning() || std::ranges::any_of(bus.configs, [&](const auto& config) {
               return is_of(*config, slave) && config->vendor == slave.identity.vendor &&
                      config->product == slave.identity.product;
           });
}

bool await_start(Bus& bus, std::uint16_t position, Ready wanted) {
    for (int n = 0; n < (bus.active && !bus.cycling ? 3000 : 10000); ++n) {
        if (bus.active && bus.cycling && bus.is_owner()) return false;  // the call would wait for ever
        if (is_ready(bus, position, wanted)) return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return !bus.active && !bus.scan_busy;
}

Passage::Passage(Bus& bus, std::uint16_t position, Ready wanted) : bus_(bus) {
    using std::chrono::steady_clock;
    const auto give_up = steady_clock::now() + std::chrono::seconds(15);
    for (;;) {
        const unsigned turns = bus.turns;
        const bool ready = await_start(bus, position, wanted);
        ++bus.transfers;
        const bool may_begin = turns == bus.turns && (!ready || !bus.is_changing());
        if (may_begin || steady_clock::now() >= give_up) return;
        --bus.transfers;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
}

}  // namespace margay::compat::ecrt

extern "C" {

int ecrt_master_sdo_download(ec_master_t* master, uint16_t slave_position, uint16_t index, uint8_t subindex,
                             const uint8_t* data, size_t data_size, uint32_t* abort_code) {
    if (!may_have(*master, slave_position, data_size)) return -ENOMEM;
    SdoDownload request;
    request.index = index;
    request.subindex = subindex;
    request.data = octets(data, data_size);
    return download(master, slave_position, request, abort_code);
}

int ecrt_master_sdo_download_complete(ec_master_t* master, uint16_t slave_position, uint16_t index, const uint8_t* data,
                                      size_t data_size, uint32_t* abort_code) {
    if (!may_have(*master, slave_position, data_size)) return -ENOMEM;
    SdoDownload request;
    request.index = index;
    request.complete_access = true;
    request.data = octets(data, data_size);
    return download(master, slave_position, request, abort_code);
}

int ecrt_master_sdo_upload(ec_master_t* master, uint16_t slave_position, uint16_t index, uint8_t subindex,
                           uint8_t* target, size_t target_size, size_t* result_size, uint32_t* abort_code) {
    SdoUpload request;
    request.index = index;
    request.subindex = subindex;
    request.data = room(target, target_size);
    return upload(master, slave_position, request, result_size, abort_code);
}

int ecrt_master_sdo_upload_complete(ec_master_t* master, uint16_t slave_position, uint16_t index, uint8_t* target,
                                    size_t target_size, size_t* result_size, uint32_t* abort_code) {
    SdoUpload request;
    request.index = index;
    request.complete_access = true;
    request.data = room(target, target_size);
    return upload(master, slave_position, request, result_size, abort_code);
}

int ecrt_master_write_idn(ec_master_t* master, uint16_t slave_position, uint8_t drive_no, uint16_t idn,
                          const uint8_t* data, size_t data_size, uint16_t* error_code) {
    if (!is_drive(*master, slave_position, drive_no)) return -EINVAL;
    if (!may_have(*master, slave_position, data_size)) return -ENOMEM;
    SoeWrite request;
    request.drive = drive_no;
    request.idn = Idn{idn};
    request.data = octets(data, data_size);
    Error error;
    const int result = transfer(*master->bus, slave_position, request, error);
    if (error_code != nullptr)
        *error_code = error.code == Errc::soe_error ? static_cast<std::uint16_t>(error.detail) : std::uint16_t{0};
    return result;
}

int ecrt_master_read_idn(ec_master_t* master, uint16_t slave_position, uint8_t drive_no, uint16_t idn, uint8_t* target,
                         size_t target_size, size_t* result_size, uint16_t* error_code) {
    if (!is_drive(*master, slave_position, drive_no)) return -EINVAL;
    SoeRead request;
    request.drive = drive_no;
    request.idn = Idn{idn};
    request.data = room(target, target_size);
    Error error;
    const int result = transfer(*master->bus, slave_position, request, error);
    if (error_code != nullptr)
        *error_code = error.code == Errc::soe_error ? static_cast<std::uint16_t>(error.detail) : std::uint16_t{0};
    if (result_size != nullptr) *result_size = result == 0 ? request.bytes : 0;
    return result;
}

}  // extern "C"
