// The EoE server with any sequence of EoE messages.
#include "common/run_protocol.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    margay::subdevice::fuzzing::run_protocol(margay::wire::MailboxType::eoe, {data, size}, false);
    return 0;
}
