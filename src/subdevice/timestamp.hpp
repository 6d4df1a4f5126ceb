// Object 0x10F8 "Timestamp object" (ETG.1020): the time of the device in ns. A master reads it to relate the time
// stamps of the diagnosis history (0x10F3) to its own time, or maps it into a TxPDO. Application::timestamp_ns() gives
// the time. The object may be absent; a device that has it places its value in its image:
//
//     struct Values { Le<std::uint64_t> time; … };
//     constexpr auto kTime = timestamp_entry<MemberField<&Values::time>>();
//     … variable(0x10F8, "Timestamp", kTime, &kTimestampHooks), …
#pragma once

#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

inline constexpr std::uint16_t kTimestamp = 0x10F8;

template <class F>
[[nodiscard]] constexpr std::array<Entry, 1> timestamp_entry() {
    static_assert(sizeof(typename F::Type) == 8);
    return {value<F>(0, "Timestamp", od::kReadOnly | od::kTxMappable)};
}

// An SDO reads the time at which the request is served. In SAFEOP and OP, ProcessData also updates the value before
// each copy of the inputs.
[[nodiscard]] HookAnswer read_timestamp(const ObjectAccess& access);
inline constexpr ObjectHooks kTimestampHooks{.before_read = read_timestamp};

}  // namespace margay::subdevice
