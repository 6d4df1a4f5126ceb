// The VoE server with any sequence of VoE messages.
#include "common/run_protocol.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    margay::subdevice::fuzzing::run_protocol(margay::wire::MailboxType::voe, {data, size}, false);
    return 0;
}
