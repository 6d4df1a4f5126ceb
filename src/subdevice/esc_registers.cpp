#include "subdevice/esc_registers.hpp"

#include <algorithm>

namespace margay::subdevice {

void read_memory(EscAccess& esc, std::uint16_t address, MutableBytes into) {
    while (!into.empty()) {
        const auto bytes = std::min(into.size(), EscAccess::kMostLockedBytes);
        const Guard guard(esc);
        esc.read(address, into.first(bytes));
        address = static_cast<std::uint16_t>(address + bytes);
        into = into.subspan(bytes);
    }
}

void write_memory(EscAccess& esc, std::uint16_t address, Bytes data) {
    while (!data.empty()) {
        const auto bytes = std::min(data.size(), EscAccess::kMostLockedBytes);
        const Guard guard(esc);
        esc.write(address, data.first(bytes));
        address = static_cast<std::uint16_t>(address + bytes);
        data = data.subspan(bytes);
    }
}

}  // namespace margay::subdevice
