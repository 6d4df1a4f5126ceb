// Files of a slave (FoE).
#include "compat/soem/facade.hpp"

namespace margay::soem {
namespace {

constexpr unsigned kFileNotFound = 0x8001;
constexpr unsigned kPacketNumber = 0x8005;

// Calls the hook of the program, which must not call the library from there.
struct Progress {
    ecx_contextt* context = nullptr;
    std::uint16_t slave = 0;
    std::size_t total = 0;  // octets to send; 0: the slave sends
    int packets = 0;

    static void report(const FoeProgress& progress, void* user) {
        auto& self = *static_cast<Progress*>(user);
        if (progress.busy || self.context->FOEhook == nullptr) return;
        const std::size_t octets = self.total != 0 ? self.total - std::min(self.total, progress.bytes) : progress.bytes;
        self.context->FOEhook(self.slave, ++self.packets, static_cast<int>(octets));
    }
};

int result(ecx_contextt& context, std::uint16_t slave, const Error& error) {
    if (error.code == Errc::capacity) return -EC_ERR_TYPE_FOE_BUF2SMALL;
    if (error.code == Errc::protocol) return -EC_ERR_TYPE_PACKET_ERROR;
    if (error.code != Errc::foe_error) return mail_result(context, slave, error, 0, 0);
    push_emergencies(context, slave);
    if (error.detail == kFileNotFound) return -EC_ERR_TYPE_FOE_FILE_NOTFOUND;
    return error.detail == kPacketNumber ? -EC_ERR_TYPE_FOE_PACKETNUMBER : -EC_ERR_TYPE_FOE_ERROR;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_FOEdefinehook(ecx_contextt* context, void* hook) {
    context->FOEhook = reinterpret_cast<decltype(context->FOEhook)>(hook);
    return 1;
}

int ecx_FOEread(ecx_contextt* context, uint16 slave, char* filename, uint32 password, int* psize, void* p,
                int timeout) {
    Session* const session = session_of(context);
    if (session == nullptr || !is_slave(*context, slave) || *psize < 0) return 0;
    Progress progress{.context = context, .slave = slave};
    margay::FoeRead request;
    request.slave = slave;
    request.name = filename;
    request.password = password;
    request.data = octets_at(p, static_cast<std::size_t>(*psize));
    request.answer_timeout = mail_time(timeout);
    request.progressed = Progress::report;
    request.user = &progress;
    const auto done = session->run(request);
    if (done) *psize = static_cast<int>(request.bytes());
    return result(*context, slave, done.error());
}

int ecx_FOEwrite(ecx_contextt* context, uint16 slave, char* filename, uint32 password, int psize, void* p,
                 int timeout) {
    Session* const session = session_of(context);
    if (session == nullptr || !is_slave(*context, slave) || psize < 0) return 0;
    Progress progress{.context = context, .slave = slave, .total = static_cast<std::size_t>(psize)};
    margay::FoeWrite request;
    request.slave = slave;
    request.name = filename;
    request.password = password;
    const void* const content = p;
    request.data = octets_at(content, static_cast<std::size_t>(psize));
    request.answer_timeout = mail_time(timeout);
    request.progressed = Progress::report;
    request.user = &progress;
    const auto done = session->run(request);
    return result(*context, slave, done.error());
}

}  // extern "C"
