#include "subdevice/timestamp.hpp"

#include "subdevice/application.hpp"

namespace margay::subdevice {

HookAnswer read_timestamp(const ObjectAccess& access) {
    const Entry* const entry = access.object.entry(access.subindex);
    if (access.application == nullptr || entry == nullptr) return Abort::none;
    const MutableBytes memory = access.dictionary.in_image(access.object, *entry, access.subindex);
    const Guard guard(access.dictionary.lock());
    if (memory.size() == 8) store_le(memory, 0, access.application->timestamp_ns(access.now));
    return Abort::none;
}

}  // namespace margay::subdevice
