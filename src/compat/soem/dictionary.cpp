// The description of the objects of a slave (SDO information).
#include "compat/soem/facade.hpp"

#include <string_view>

namespace margay::soem {
namespace {

constexpr int kTime = EC_TIMEOUTRXM;

void copy_name(std::string_view name, char* to) {
    const std::size_t size = std::min(name.size(), std::size_t{EC_MAXNAME});
    std::copy_n(name.data(), size, to);
    to[size] = '\0';
}

// An error of the service, with the kind of entry that the interface has for it.
int result(ecx_contextt& context, std::uint16_t slave, const Error& error, std::uint16_t index, std::uint8_t subindex) {
    if (error.code != Errc::sdo_abort) return mail_result(context, slave, error, index, subindex);
    push_unasked(context, slave);
    ec_errort entry{};
    entry.Slave = slave;
    entry.Index = index;
    entry.SubIdx = subindex;
    entry.Etype = EC_ERR_TYPE_SDOINFO_ERROR;
    entry.AbortCode = static_cast<int32>(error.detail);
    push(context, entry);
    return 0;
}

void take_indices(std::span<const std::uint16_t> indices, void* user) {
    auto& list = *static_cast<ec_ODlistt*>(user);
    for (const std::uint16_t index : indices)
        if (list.Entries < EC_MAXODLIST) list.Index[list.Entries++] = index;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_readODlist(ecx_contextt* context, uint16 Slave, ec_ODlistt* pODlist) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, Slave)) return 0;
    pODlist->Slave = Slave;
    pODlist->Entries = 0;
    margay::ObjectListRequest request;
    request.slave = Slave;
    request.found = take_indices;
    request.user = pODlist;
    request.answer_timeout = mail_time(kTime);
    const auto done = session->run(request);
    return result(*context, Slave, done.error(), 0, 0);
}

int ecx_readODdescription(ecx_contextt* context, uint16 Item, ec_ODlistt* pODlist) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, pODlist->Slave) || Item >= EC_MAXODLIST) return 0;
    pODlist->DataType[Item] = 0;
    pODlist->ObjectCode[Item] = 0;
    pODlist->MaxSub[Item] = 0;
    pODlist->Name[Item][0] = '\0';
    margay::ObjectDescriptionRequest request;
    request.slave = pODlist->Slave;
    request.index = pODlist->Index[Item];
    request.timeout = mail_time(kTime);
    const auto done = session->run(request);
    if (done) {
        pODlist->DataType[Item] = request.description.data_type;
        pODlist->ObjectCode[Item] = request.description.object_code;
        pODlist->MaxSub[Item] = request.description.max_subindex;
        copy_name(request.description.name(), pODlist->Name[Item]);
    }
    return result(*context, pODlist->Slave, done.error(), pODlist->Index[Item], 0);
}

int ecx_readOEsingle(ecx_contextt* context, uint16 Item, uint8 SubI, ec_ODlistt* pODlist, ec_OElistt* pOElist) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, pODlist->Slave) || Item >= EC_MAXODLIST) return 0;
    margay::EntryDescriptionRequest request;
    request.slave = pODlist->Slave;
    request.index = pODlist->Index[Item];
    request.subindex = SubI;
    request.timeout = mail_time(kTime);
    const auto done = session->run(request);
    if (done) {
        ++pOElist->Entries;
        pOElist->ValueInfo[SubI] = 0;
        pOElist->DataType[SubI] = request.description.data_type;
        pOElist->BitLength[SubI] = request.description.bit_length;
        pOElist->ObjAccess[SubI] = request.description.access;
        copy_name(request.description.name(), pOElist->Name[SubI]);
    }
    return result(*context, pODlist->Slave, done.error(), pODlist->Index[Item], SubI);
}

int ecx_readOE(ecx_contextt* context, uint16 Item, ec_ODlistt* pODlist, ec_OElistt* pOElist) {
    if (Item >= EC_MAXODLIST) return 0;
    pOElist->Entries = 0;
    int last = 0;
    for (unsigned sub = 0; sub <= pODlist->MaxSub[Item] && sub < EC_MAXOELIST; ++sub)
        last = ecx_readOEsingle(context, Item, static_cast<uint8>(sub), pODlist, pOElist);
    return last;
}

}  // extern "C"
