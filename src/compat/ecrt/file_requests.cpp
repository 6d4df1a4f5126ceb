// Asynchronous requests for files of a slave (FoE).
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/requests.hpp"

#include <array>
#include <chrono>
#include <cstdio>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

const FoeRequest& last_of(const ec_foe_request& req) {
    if (req.last == Transfer::write) return req.write;
    return req.read;
}

void start(ec_foe_request& req, FoeRequest& request, Transfer what) {
    request.name = req.file;
    request.password = req.password;
    request.timeout = std::chrono::milliseconds(req.timeout_ms);
    begin_or_later(req, request, what);
}

}  // namespace

extern "C" {

ec_foe_request_t* ecrt_slave_config_create_foe_request(ec_slave_config_t* sc, size_t size) {
    if (!may_have(*sc, size)) return nullptr;
    const std::lock_guard lock(sc->bus.config_mutex);
    auto request = std::make_unique<ec_foe_request>(*sc);
    request->memory.resize(size);
    sc->foe_requests.push_back(std::move(request));
    return sc->foe_requests.back().get();
}

void ecrt_foe_request_file(ec_foe_request_t* req, const char* file_name, uint32_t password) {
    if (ecrt_foe_request_state(req) == EC_REQUEST_BUSY) return;
    req->file = file_name != nullptr ? file_name : "";
    req->password = password;
}

void ecrt_foe_request_timeout(ec_foe_request_t* req, uint32_t timeout) { req->timeout_ms = timeout; }

uint8_t* ecrt_foe_request_data(ec_foe_request_t* req) { return reinterpret_cast<std::uint8_t*>(req->memory.data()); }

size_t ecrt_foe_request_data_size(const ec_foe_request_t* req) {
    return req->last == Transfer::read ? req->read.bytes() : req->size;
}

ec_request_state_t ecrt_foe_request_state(ec_foe_request_t* req) {
    begin_if_due(*req, req->read, req->write);
    return shown_state(*req, req->read, req->write, [req] {
        std::array<char, 80> text{};
        constexpr std::size_t kMost = 50;  // of the name
        (void)std::snprintf(text.data(), text.size(), "FoE request, file %.*s%s", static_cast<int>(kMost),
                            req->file.c_str(), req->file.size() > kMost ? "..." : "");
        return text;
    });
}

ec_foe_error_t ecrt_foe_request_result(const ec_foe_request_t* req) {
    if (req->last == Transfer::none) return FOE_IDLE;
    if (req->last == Transfer::refused) return FOE_WC_ERROR;
    if (is_waiting(req->last)) return FOE_BUSY;
    const FoeRequest& request = last_of(*req);
    if (request.busy()) return FOE_BUSY;
    switch (request.error().code) {
        case Errc::none: return FOE_READY;
        case Errc::timeout: return FOE_TIMEOUT_ERROR;
        case Errc::capacity: return FOE_READ_OVER_ERROR;
        case Errc::foe_error: return FOE_OPCODE_ERROR;
        case Errc::unsupported:
        case Errc::wrong_state: return FOE_MBOX_PROT_ERROR;
        case Errc::no_frame:
        case Errc::working_counter: return FOE_WC_ERROR;
        default: return FOE_PROT_ERROR;
    }
}

uint32_t ecrt_foe_request_error_code(const ec_foe_request_t* req) {
    if (req->last == Transfer::none || req->last == Transfer::refused || last_of(*req).busy()) return 0;
    const Error& error = last_of(*req).error();
    return error.code == Errc::foe_error ? error.detail : 0;
}

size_t ecrt_foe_request_progress(const ec_foe_request_t* req) { return last_of(*req).bytes(); }

void ecrt_foe_request_write(ec_foe_request_t* req, size_t size) {
    if (ecrt_foe_request_state(req) == EC_REQUEST_BUSY) return;
    if (size > req->memory.size()) return refuse(*req, Errc::capacity);
    req->size = size;
    req->write.data = Borrowed<std::byte>(req->memory.data(), size);
    start(*req, req->write, Transfer::write);
}

void ecrt_foe_request_read(ec_foe_request_t* req) {
    if (ecrt_foe_request_state(req) == EC_REQUEST_BUSY) return;
    req->read.data = req->memory;
    start(*req, req->read, Transfer::read);
}

}  // extern "C"
