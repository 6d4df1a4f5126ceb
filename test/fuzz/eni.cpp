// The reader of ENI files with random input. The reader ends, and names a problem when it refuses a file. The result
// has each slave number once, no start-up command without octets, and only variables of these slaves.
#include <margay/files/eni.hpp>

#include <cstdlib>
#include <set>

using namespace margay;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto eni = files::read_eni({reinterpret_cast<const char*>(data), size});
    if (!eni) {
        require(!eni.problem.text.empty());
        return 0;
    }
    require(!eni->slaves.empty() && eni->expected().size() == eni->slaves.size());
    std::set<unsigned> numbers;
    for (const files::EniSlave& slave : eni->slaves) require(slave.number != 0 && numbers.insert(slave.number).second);
    for (const ExpectedSlave& slave : eni->expected()) {
        require(slave.config != nullptr && slave.config->sm_count <= SlaveConfiguration::kProcessSms);
        for (const StartupCommand& command : slave.config->startup()) require(!command.octets().empty());
    }
    for (const files::EniVariable& one : eni->variables) require(one.slave <= eni->slaves.size());
    (void)eni->limits();
    return 0;
}
