// Functions of SOEM 2.0 only: mailbox buffers, the handler of mailboxes, commands of a network description.
#include "compat/soem/facade.hpp"

#include <cstdlib>
#include <mutex>
#include <utility>

namespace margay::soem {
namespace {

// The mutex of a pool is destroyed with its context, while threads may still be in calls that use the pool. Therefore
// each call locks this mutex, which is never destroyed.
constinit PriorityLock pools_lock;
using PoolsGuard = std::lock_guard<PriorityLock>;

}  // namespace

void end_context(ecx_contextt& c) {
    const PoolsGuard guard(pools_lock);
    osal_mutex_destroy(std::exchange(c.mbxpool.mbxmutex, nullptr));
}

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_config_init(ecx_contextt* context) {
    const int found = config_init(*context);
    const Pinned session = session_of(context);
    if (session == nullptr) return found;
    const Session::Guard guard(*session);  // another thread may scan too
    for (uint8 n = 0; n < EC_MAXGROUP; ++n) ecx_initmbxqueue(context, n);
    return found;
}

int ecx_config_map_group(ecx_contextt* context, void* pIOmap, uint8 group) {
    return config_map(*context, pIOmap, group, context->overlappedMode != 0,
                      context->overlappedMode != 0 || context->packedMode == 0);
}

int ecx_initmbxpool(ecx_contextt* context) {
    const PoolsGuard guard(pools_lock);
    ec_mbxpoolt& pool = context->mbxpool;
    if (pool.mbxmutex == nullptr) pool.mbxmutex = static_cast<osal_mutext*>(osal_mutex_create());
    for (int n = 0; n < EC_MBXPOOLSIZE; ++n) pool.mbxemptylist[n] = n;
    pool.listhead = 0;
    pool.listtail = 0;
    pool.listcount = EC_MBXPOOLSIZE;
    return 0;
}

int ecx_initmbxqueue(ecx_contextt* context, uint8 group) {
    if (group >= EC_MAXGROUP) return 0;
    ec_mbxqueuet& queue = context->grouplist[group].mbxtxqueue;
    queue.listhead = 0;
    queue.listtail = 0;
    queue.listcount = 0;
    return 0;
}

ec_mbxbuft* ecx_getmbx(ecx_contextt* context) {
    const PoolsGuard guard(pools_lock);
    ec_mbxpoolt& pool = context->mbxpool;
    if (pool.mbxmutex == nullptr) return nullptr;
    osal_mutex_lock(pool.mbxmutex);
    ec_mbxbuft* buffer = nullptr;
    if (pool.listcount > 0) {
        buffer = &pool.mbx[pool.mbxemptylist[pool.listtail]];
        pool.listtail = (pool.listtail + 1) % EC_MBXPOOLSIZE;
        --pool.listcount;
    }
    osal_mutex_unlock(pool.mbxmutex);
    return buffer;
}

int ecx_dropmbx(ecx_contextt* context, ec_mbxbuft* mbx) {
    const PoolsGuard guard(pools_lock);
    ec_mbxpoolt& pool = context->mbxpool;
    const auto place = mbx - pool.mbx;
    if (pool.mbxmutex == nullptr || mbx == nullptr || mbx < pool.mbx || place >= EC_MBXPOOLSIZE) return 0;
    osal_mutex_lock(pool.mbxmutex);
    const bool room = pool.listcount < EC_MBXPOOLSIZE;
    if (room) {
        pool.mbxemptylist[pool.listhead] = static_cast<int>(place);
        pool.listhead = (pool.listhead + 1) % EC_MBXPOOLSIZE;
        ++pool.listcount;
    }
    osal_mutex_unlock(pool.mbxmutex);
    return room ? 1 : 0;
}

int ecx_slavembxcyclic(ecx_contextt* context, uint16 slave) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    const Session::Guard guard(*session);
    if (context->slavelist[slave].mbxstatus == nullptr) return 0;
    context->slavelist[slave].mbxhandlerstate = ECT_MBXH_CYCLIC;
    return 1;
}

int ecx_mbxENIinitcmds(ecx_contextt* context, uint16 slave, uint16_t transition) {
    const Pinned session = session_of(context);
    if (session == nullptr || context->ENI == nullptr || !is_slave(*context, *session, slave)) return 1;
    const auto vendor = value_of(*context, *session, slave, &ec_slavet::eep_man);
    const auto product = value_of(*context, *session, slave, &ec_slavet::eep_id);
    const auto revision = value_of(*context, *session, slave, &ec_slavet::eep_rev);
    int right = 1;
    for (int n = 0; n < context->ENI->slavecount; ++n) {
        const ec_enislavet& wanted = context->ENI->slave[n];
        if (wanted.Slave != slave || wanted.VendorId != vendor || wanted.ProductCode != product ||
            wanted.RevisionNo != revision)
            continue;
        for (int c = 0; c < wanted.CoECmdCount; ++c) {
            ec_enicoecmdt& command = wanted.CoECmds[c];
            if ((command.Transition & transition) == 0) continue;
            int done = 0;
            if (command.Ccs == 1) {
                uint8 value[1024];
                int size = sizeof(value);
                done = ecx_SDOread(context, slave, command.Index, command.SubIdx, command.CA, &size, value,
                                   command.Timeout);
            } else {
                done = ecx_SDOwrite(context, slave, command.Index, command.SubIdx, command.CA, command.DataSize,
                                    command.Data, command.Timeout);
            }
            if (done <= 0) right = 0;
        }
    }
    return right;
}

}  // extern "C"
