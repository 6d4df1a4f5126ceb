// The FoE server with any sequence of FoE messages, in PREOP and in BOOT.
#include "common/run_protocol.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace margay;
    if (size == 0) return 0;
    subdevice::fuzzing::run_protocol(wire::MailboxType::foe, {data + 1, size - 1}, (data[0] & 1) != 0);
    return 0;
}
