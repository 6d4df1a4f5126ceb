// Asynchronous requests for objects (SDO), drive parameters (SoE) and registers.
#include "compat/ecrt/requests.hpp"

#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

// Room for values that are longer than the program has announced.
constexpr std::size_t kLeastRoom = 512;

std::chrono::milliseconds ms(std::uint32_t timeout) { return std::chrono::milliseconds(timeout); }

template <class Wish>
int start(Wish& wish, SlaveRequest& request, Transfer what) {
    begin_or_later(wish, request, what);
    return 0;
}

template <class Wish>
bool busy(const Wish& wish, const Request& one, const Request& other) {
    if (is_waiting(wish.last)) return true;
    return (wish.last == Transfer::read || wish.last == Transfer::write) && (one.busy() || other.busy());
}

bool busy(const ec_reg_request& request) {
    if (request.last == Transfer::exchange) return request.exchange.busy();
    return busy(request, request.read, request.write);
}

// The working counter of a slave that was read and written.
constexpr std::uint16_t kExchanged = 3;

// One datagram reads the registers and writes them.
void exchange_or_later(ec_reg_request& request) {
    const Beginning beginning(request.config);
    if (too_early(request.config)) {
        request.last = Transfer::exchange_later;
        note_waiting(request.config);
        return;
    }
    const std::uint16_t number = slave_number(request.config);
    if (number == 0) return refuse(request, Errc::missing_slave);
    Context& ctx = *request.config.bus.ctx;
    request.exchange.adp = ctx.slave(number).station_address.value;
    const auto submitted = submit(ctx, request.exchange);
    if (!submitted) return refuse(request, submitted.error().code);
    request.last = Transfer::exchange;
}

// Texts for requests.
std::array<char, 80> words(const char* format, unsigned first, unsigned second) {
    std::array<char, 80> text{};
    (void)std::snprintf(text.data(), text.size(), format, first, second);
    return text;
}

void begin_registers_if_due(ec_reg_request& request) {
    Transfer later = Transfer::exchange_later;
    if (request.last.compare_exchange_strong(later, Transfer::beginning))
        exchange_or_later(request);
    else
        begin_if_due(request, request.read, request.write);
}

bool fits(ec_reg_request& request, std::size_t size) {
    const bool right = size <= request.memory.size();
    if (!right)
        note_failure(request.config, request, {.code = Errc::capacity},
                     words("register request, %u octets of %u", static_cast<unsigned>(size),
                           static_cast<unsigned>(request.memory.size()))
                         .data());
    return right;
}

std::uint8_t* memory_of(const std::vector<std::byte>& memory) {
    return reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(memory.data()));
}

// The octets that the program sees: the octets of the last upload, or of a write if there was no upload.
template <class Read>
std::size_t size_of(Transfer last, const Read& read, std::size_t size) {
    return last == Transfer::read && read.state() == RequestState::success ? read.bytes : size;
}

}  // namespace

namespace margay::compat::ecrt {

namespace {

constexpr std::size_t kMostOctets = std::size_t{1} << 30U;

}  // namespace

bool may_have(const ec_slave_config& config, std::size_t octets) {
    if (octets > kMostOctets)
        say("configuration %u:%u: a request of %zu octets: %zu are possible", config.alias, config.position, octets,
            kMostOctets);
    return octets <= kMostOctets;
}

bool may_have(const ec_master& master, std::uint16_t position, std::size_t octets) {
    if (octets > kMostOctets)
        say("master %u: position %u: a request of %zu octets: %zu are possible", master.bus->index, position, octets,
            kMostOctets);
    return octets <= kMostOctets;
}

void note_failure(ec_slave_config& config, RequestLog& log, const Error& error, const char* what) {
    const std::uint64_t reason = std::uint64_t{static_cast<std::uint32_t>(error.code)} << 32U | error.detail;
    if (log.said == reason) return;
    Bus::Failures& failures = config.bus.failures;
    std::unique_lock lock(failures.mutex, std::try_to_lock);
    constexpr unsigned kTries = 1000;  // another thread has the lock only while it writes a reason or copies the list
    for (unsigned n = 0; n < kTries && !lock.owns_lock(); ++n) (void)lock.try_lock();
    if (!lock.owns_lock()) return;
    log.said = reason;
    if (failures.count == failures.list.size()) {
        ++failures.more;
        return;
    }
    Failure& failure = failures.list[failures.count++];
    failure.error = error;
    (void)std::snprintf(failure.what.data(), failure.what.size(), "configuration %u:%u: %s", config.alias,
                        config.position, what);
}

Beginning::Beginning(ec_slave_config& config) : bus_(config.bus) { ++bus_.transfers; }
Beginning::~Beginning() { --bus_.transfers; }

bool too_early(const ec_slave_config& config) {
    const Bus& bus = config.bus;
    if (bus.turns % 2 != 0) return true;
    if (!bus.active) return bus.scan_busy;
    return bus.operation->scanning() || (!bus.operation->running() && bus.dirty) ||
           config.start_up.load(std::memory_order_acquire) != StartUp::over;
}

bool before_preop(const ec_slave_config& config) {
    if (!config.bus.active) {
        Slave slave;
        return config.bus.slave_of(config, slave) && is_on_its_way_to_preop(slave);
    }
    constexpr std::uint32_t kOnlineInInit = 1U | static_cast<std::uint32_t>(AlState::init) << 4;
    return config.state.load(std::memory_order_relaxed) == kOnlineInInit;
}

Time time_now(const ec_slave_config& config) { return config.bus.source->osal().now(); }

Time time_to_give_up(const ec_slave_config& config, std::uint32_t timeout_ms) {
    return timeout_ms == 0 ? kNever : time_now(config) + ms(timeout_ms);
}

std::uint16_t slave_number(ec_slave_config& config) {
    Bus& bus = config.bus;
    if (bus.active) {
        // If the slave is offline, another device may have its number.
        const bool online = (config.state.load(std::memory_order_relaxed) & 1U) != 0;
        return online ? config.number.load(std::memory_order_relaxed) : std::uint16_t{0};
    }
    Slave slave;
    return bus.slave_of(config, slave) ? slave.number : std::uint16_t{0};
}

bool begin(ec_slave_config& config, SlaveRequest& request, RequestLog& log) {
    request.slave = slave_number(config);
    if (request.slave == 0)
        log.refusal = {.code = Errc::missing_slave};
    else if (const auto submitted = submit(*config.bus.ctx, request); submitted)
        return true;
    else
        log.refusal = submitted.error();
    return false;
}

void note_waiting(ec_slave_config& config) { config.bus.requests_wait = true; }

bool are_under_way(const Bus& bus) {
    const auto any = [](const auto& requests, const auto& is_busy) { return std::ranges::any_of(requests, is_busy); };
    const auto transfers = [](const auto& one) { return one->read.busy() || one->write.busy(); };
    return bus.transfers != 0 || std::ranges::any_of(bus.configs, [&](const auto& config) {
               return any(config->sdo_requests,
                          [](const auto& one) { return one->upload.busy() || one->download.busy(); }) ||
                      any(config->soe_requests, transfers) || any(config->foe_requests, transfers) ||
                      any(config->reg_requests,
                          [&](const auto& one) { return transfers(one) || one->exchange.busy(); });
           });
}

void begin_waiting(Bus& bus) {
    if (!bus.requests_wait.load(std::memory_order_relaxed)) return;
    const std::unique_lock lock(bus.config_mutex, std::try_to_lock);
    if (!lock.owns_lock()) return;  // the next call does it
    bus.requests_wait = false;
    for (const auto& config : bus.configs) {
        for (const auto& one : config->sdo_requests) begin_if_due(*one, one->upload, one->download);
        for (const auto& one : config->soe_requests) begin_if_due(*one, one->read, one->write);
        for (const auto& one : config->foe_requests) begin_if_due(*one, one->read, one->write);
        for (const auto& one : config->reg_requests) begin_registers_if_due(*one);
    }
}

}  // namespace margay::compat::ecrt

extern "C" {

// ------------------------------------------------------------------ SDO

ec_sdo_request_t* ecrt_slave_config_create_sdo_request(ec_slave_config_t* sc, uint16_t index, uint8_t subindex,
                                                       size_t size) {
    if (!may_have(*sc, size)) return nullptr;
    const std::lock_guard lock(sc->bus.config_mutex);
    auto request = std::make_unique<ec_sdo_request>(*sc);
    request->index = index;
    request->subindex = subindex;
    request->memory.resize(std::max(size, kLeastRoom));
    request->size = size;
    sc->sdo_requests.push_back(std::move(request));
    return sc->sdo_requests.back().get();
}

ec_sdo_request_t* ecrt_slave_config_create_sdo_request_complete(ec_slave_config_t* sc, uint16_t index, size_t size) {
    ec_sdo_request_t* request = ecrt_slave_config_create_sdo_request(sc, index, 0, size);
    if (request != nullptr) request->complete = true;
    return request;
}

int ecrt_sdo_request_index(ec_sdo_request_t* req, uint16_t index, uint8_t subindex) {
    if (busy(*req, req->upload, req->download)) return -EBUSY;
    req->index = index;
    req->subindex = subindex;
    req->complete = false;
    return 0;
}

void ecrt_sdo_request_index_complete(ec_sdo_request_t* req, uint16_t index) {
    if (ecrt_sdo_request_index(req, index, 0) == 0) req->complete = true;
}

int ecrt_sdo_request_timeout(ec_sdo_request_t* req, uint32_t timeout) {
    req->timeout_ms = timeout;
    return 0;
}

uint8_t* ecrt_sdo_request_data(const ec_sdo_request_t* req) { return memory_of(req->memory); }

size_t ecrt_sdo_request_data_size(const ec_sdo_request_t* req) { return size_of(req->last, req->upload, req->size); }

ec_request_state_t ecrt_sdo_request_state(const ec_sdo_request_t* req) {
    auto& request = const_cast<ec_sdo_request&>(*req);
    begin_if_due(request, request.upload, request.download);
    return shown_state(request, req->upload, req->download,
                       [req] { return words("SDO request 0x%04x:%02x", req->index, req->subindex); });
}

void ecrt_sdo_request_write_with_size(ec_sdo_request_t* req, size_t size) {
    if (size > req->memory.size()) return refuse(*req, Errc::capacity);
    req->size = size;
    (void)ecrt_sdo_request_write(req);
}

int ecrt_sdo_request_write(ec_sdo_request_t* req) {
    if (busy(*req, req->upload, req->download)) return -EBUSY;
    req->download.index = req->index;
    req->download.subindex = req->subindex;
    req->download.complete_access = req->complete;
    req->download.timeout = ms(req->timeout_ms);
    req->download.data = Borrowed<std::byte>(req->memory.data(), req->size);
    if (is_of_pdos(req->index)) req->config.bus.pdos_written = true;
    return start(*req, req->download, Transfer::write);
}

int ecrt_sdo_request_read(ec_sdo_request_t* req) {
    if (busy(*req, req->upload, req->download)) return -EBUSY;
    req->upload.index = req->index;
    req->upload.subindex = req->subindex;
    req->upload.complete_access = req->complete;
    req->upload.timeout = ms(req->timeout_ms);
    req->upload.data = req->memory;
    return start(*req, req->upload, Transfer::read);
}

// ------------------------------------------------------------------ SoE

ec_soe_request_t* ecrt_slave_config_create_soe_request(ec_slave_config_t* sc, uint8_t drive_no, uint16_t idn,
                                                       size_t size) {
    if (!may_have(*sc, size)) return nullptr;
    if (drive_no > 7) {
        say("configuration %u:%u: IDN 0x%04x: there is no drive %u", sc->alias, sc->position, idn, drive_no);
        return nullptr;
    }
    const std::lock_guard lock(sc->bus.config_mutex);
    auto request = std::make_unique<ec_soe_request>(*sc);
    request->drive = drive_no;
    request->idn = idn;
    request->memory.resize(std::max(size, kLeastRoom));
    request->size = size;
    sc->soe_requests.push_back(std::move(request));
    return sc->soe_requests.back().get();
}

int ecrt_soe_request_idn(ec_soe_request_t* req, uint8_t drive_no, uint16_t idn) {
    if (drive_no > 7) return -EINVAL;
    if (busy(*req, req->read, req->write)) return -EBUSY;
    req->drive = drive_no;
    req->idn = idn;
    return 0;
}

int ecrt_soe_request_timeout(ec_soe_request_t* req, uint32_t timeout) {
    req->timeout_ms = timeout;
    return 0;
}

uint8_t* ecrt_soe_request_data(const ec_soe_request_t* req) { return memory_of(req->memory); }

size_t ecrt_soe_request_data_size(const ec_soe_request_t* req) { return size_of(req->last, req->read, req->size); }

ec_request_state_t ecrt_soe_request_state(const ec_soe_request_t* req) {
    auto& request = const_cast<ec_soe_request&>(*req);
    begin_if_due(request, request.read, request.write);
    return shown_state(request, req->read, req->write,
                       [req] { return words("SoE request, drive %u, IDN 0x%04x", req->drive, req->idn); });
}

int ecrt_soe_request_write(ec_soe_request_t* req) {
    if (busy(*req, req->read, req->write)) return -EBUSY;
    req->write.drive = req->drive;
    req->write.idn = Idn{req->idn};
    req->write.timeout = ms(req->timeout_ms);
    req->write.data = Borrowed<std::byte>(req->memory.data(), req->size);
    return start(*req, req->write, Transfer::write);
}

int ecrt_soe_request_read(ec_soe_request_t* req) {
    if (busy(*req, req->read, req->write)) return -EBUSY;
    req->read.drive = req->drive;
    req->read.idn = Idn{req->idn};
    req->read.timeout = ms(req->timeout_ms);
    req->read.data = req->memory;
    return start(*req, req->read, Transfer::read);
}

// ------------------------------------------------------------------ registers

ec_reg_request_t* ecrt_slave_config_create_reg_request(ec_slave_config_t* sc, size_t size) {
    if (!may_have(*sc, size)) return nullptr;
    const std::lock_guard lock(sc->bus.config_mutex);
    auto request = std::make_unique<ec_reg_request>(*sc);
    request->memory.resize(size);
    sc->reg_requests.push_back(std::move(request));
    return sc->reg_requests.back().get();
}

uint8_t* ecrt_reg_request_data(const ec_reg_request_t* req) { return memory_of(req->memory); }

ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t* req) {
    auto& request = const_cast<ec_reg_request&>(*req);
    begin_registers_if_due(request);
    const Transfer last = req->last;
    const auto describe = [req] { return words("register request, 0x%04x", req->address, 0); };
    if (last != Transfer::exchange) return shown_state(request, req->read, req->write, describe);
    const ec_request_state_t state = to_ec(req->exchange.state());
    const bool short_of = state == EC_REQUEST_SUCCESS && req->exchange.wkc != kExchanged;
    if (state == EC_REQUEST_SUCCESS && !short_of) request.said = 0;
    if (state != EC_REQUEST_ERROR && !short_of) return state;
    const Error too_few{.code = Errc::working_counter, .expected = kExchanged, .actual = req->exchange.wkc};
    note_failure(request.config, request, short_of ? too_few : req->exchange.error(), describe().data());
    return EC_REQUEST_ERROR;
}

int ecrt_reg_request_write(ec_reg_request_t* req, uint16_t address, size_t size) {
    if (!fits(*req, size)) return -EINVAL;
    if (busy(*req)) return -EBUSY;
    req->address = address;
    req->write.address = address;
    req->write.data = Borrowed<std::byte>(req->memory.data(), size);
    return start(*req, req->write, Transfer::write);
}

int ecrt_reg_request_read(ec_reg_request_t* req, uint16_t address, size_t size) {
    if (!fits(*req, size)) return -EINVAL;
    if (busy(*req)) return -EBUSY;
    req->address = address;
    req->read.address = address;
    req->read.data = std::span(req->memory).first(size);
    return start(*req, req->read, Transfer::read);
}

void ecrt_reg_request_readwrite(ec_reg_request_t* req, uint16_t address, size_t size) {
    if (busy(*req)) return;
    req->address = address;
    if (size == 0 || size > req->memory.size()) return refuse(*req, Errc::capacity);
    req->exchange.command = DatagramCommand::fprw;
    req->exchange.ado = address;
    req->exchange.data = std::span(req->memory).first(size);
    req->exchange.repeat = false;  // the data of a lost frame is unknown
    exchange_or_later(*req);
}

}  // extern "C"
