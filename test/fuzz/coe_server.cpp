// The CoE server with any sequence of CoE messages.
#include "common/run_protocol.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace margay;
    subdevice::fuzzing::run_protocol(wire::MailboxType::coe, {data, size}, false);
    return 0;
}
