// Objects of CoE, and PDOs by mailbox.
#include "compat/soem/facade.hpp"

using namespace margay::soem;

namespace {

// Whether the slave has a mailbox that can be used.
bool usable(const Pinned& session, ecx_contextt* context, uint16 slave) {
    return session != nullptr && is_slave(*context, *session, slave);
}

}  // namespace

extern "C" {

int ecx_SDOread(ecx_contextt* context, uint16 slave, uint16 index, uint8 subindex, boolean CA, int* psize, void* p,
                int timeout) {
    const Pinned session = session_of(context);
    if (!usable(session, context, slave) || *psize < 0) return 0;
    margay::SdoUpload request;
    request.slave = slave;
    request.index = index;
    request.subindex = CA != FALSE && subindex > 1 ? std::uint8_t{1} : subindex;
    request.complete_access = CA != FALSE;
    request.data = octets_at(p, static_cast<std::size_t>(*psize));
    request.answer_timeout = mail_time(timeout);
    const auto done = session->run(request);
    if (done) *psize = static_cast<int>(request.bytes);
    return mail_result(*context, slave, done.error(), index, subindex);
}

int ecx_SDOwrite(ecx_contextt* context, uint16 Slave, uint16 Index, uint8 SubIndex, boolean CA, int psize,
                 const void* p, int Timeout) {
    const Pinned session = session_of(context);
    if (!usable(session, context, Slave) || psize < 0) return 0;
    margay::SdoDownload request;
    request.slave = Slave;
    request.index = Index;
    request.subindex = CA != FALSE && SubIndex > 1 ? std::uint8_t{1} : SubIndex;
    request.complete_access = CA != FALSE;
    request.data = octets_at(p, static_cast<std::size_t>(psize));
    request.answer_timeout = mail_time(Timeout);
    const auto done = session->run(request);
    return mail_result(*context, Slave, done.error(), Index, SubIndex);
}

int ecx_RxPDO(ecx_contextt* context, uint16 Slave, uint16 RxPDOnumber, int psize, const void* p) {
    const Pinned session = session_of(context);
    if (!usable(session, context, Slave) || psize < 0) return 0;
    margay::MailPdoSend request;
    request.slave = Slave;
    request.number = RxPDOnumber;
    request.data = octets_at(p, static_cast<std::size_t>(psize));
    request.timeout = mail_time(0);
    const auto done = session->run(request);
    return mail_result(*context, Slave, done.error(), RxPDOnumber, 0);
}

int ecx_TxPDO(ecx_contextt* context, uint16 slave, uint16 TxPDOnumber, int* psize, void* p, int timeout) {
    const Pinned session = session_of(context);
    if (!usable(session, context, slave) || *psize < 0) return 0;
    margay::MailPdoFetch request;
    request.slave = slave;
    request.number = TxPDOnumber;
    request.data = octets_at(p, static_cast<std::size_t>(*psize));
    request.timeout = mail_time(timeout);
    const auto done = session->run(request);
    if (done) *psize = static_cast<int>(request.bytes);
    return mail_result(*context, slave, done.error(), TxPDOnumber, 0);
}

}  // extern "C"
