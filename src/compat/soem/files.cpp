// Files of a slave (FoE).
#include "compat/soem/facade.hpp"

#include <vector>

namespace margay::soem {
namespace {

constexpr unsigned kFileNotFound = 0x8001;
constexpr unsigned kPacketNumber = 0x8005;

// Calls the hook of the program between two polls, because the hook may use other functions. Reports that are made
// under the lock of the session are stored in a list until then.
class Progress final : public Session::Between {
  public:
    // `total`: octets to send; 0: the slave sends.
    Progress(ecx_contextt& context, Session& session, std::uint16_t slave, std::size_t total)
        : context_(context), session_(session), slave_(slave), total_(total) {}

    static void report(const FoeProgress& progress, void* user) {
        auto& self = *static_cast<Progress*>(user);
        if (progress.busy) return;
        const std::size_t left = self.total_ - std::min(self.total_, progress.bytes);
        self.octets_.push_back(static_cast<int>(self.total_ != 0 ? left : progress.bytes));
    }

    void run() override {
        std::vector<int> reported;
        {
            const Session::Guard guard(session_);
            reported.swap(octets_);
        }
        for (const int octets : reported)
            if (const auto hook = hook_at(context_.FOEhook).load(); hook != nullptr) hook(slave_, ++packets_, octets);
    }

  private:
    ecx_contextt& context_;
    Session& session_;
    std::uint16_t slave_;
    std::size_t total_;
    int packets_ = 0;
    std::vector<int> octets_;
};

int read_result(ecx_contextt& context, std::uint16_t slave, const Error& error) {
    if (error.code == Errc::capacity) return -EC_ERR_TYPE_FOE_BUF2SMALL;
    if (error.code == Errc::protocol) return -EC_ERR_TYPE_PACKET_ERROR;
    if (error.code != Errc::foe_error) return mail_result(context, slave, error, 0, 0);
    push_unasked(context, slave);
    return -EC_ERR_TYPE_FOE_ERROR;
}

// Two errors of the slave have results of their own.
int write_result(ecx_contextt& context, std::uint16_t slave, const Error& error) {
    if (error.code != Errc::foe_error) return read_result(context, slave, error);
    push_unasked(context, slave);
    if (error.detail == kFileNotFound) return -EC_ERR_TYPE_FOE_FILE_NOTFOUND;
    return error.detail == kPacketNumber ? -EC_ERR_TYPE_FOE_PACKETNUMBER : -EC_ERR_TYPE_FOE_ERROR;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_FOEdefinehook(ecx_contextt* context, void* hook) {
    hook_at(context->FOEhook) = reinterpret_cast<decltype(context->FOEhook)>(hook);
    return 1;
}

int ecx_FOEread(ecx_contextt* context, uint16 slave, char* filename, uint32 password, int* psize, void* p,
                int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) || *psize < 0) return 0;
    Progress progress(*context, *session, slave, 0);
    margay::FoeRead request;
    request.slave = slave;
    request.name = filename;
    request.password = password;
    request.data = octets_at(p, static_cast<std::size_t>(*psize));
    request.answer_timeout = mail_time(timeout);
    request.progressed = Progress::report;
    request.user = &progress;
    const auto done = session->run(request, &progress);
    if (done) *psize = static_cast<int>(request.bytes());
    return read_result(*context, slave, done.error());
}

int ecx_FOEwrite(ecx_contextt* context, uint16 slave, char* filename, uint32 password, int psize, void* p,
                 int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave) || psize < 0) return 0;
    Progress progress(*context, *session, slave, static_cast<std::size_t>(psize));
    margay::FoeWrite request;
    request.slave = slave;
    request.name = filename;
    request.password = password;
    const void* const content = p;
    request.data = octets_at(content, static_cast<std::size_t>(psize));
    request.answer_timeout = mail_time(timeout);
    request.progressed = Progress::report;
    request.user = &progress;
    const auto done = session->run(request, &progress);
    return write_result(*context, slave, done.error());
}

}  // extern "C"
