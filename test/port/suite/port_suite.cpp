#include "port_suite.hpp"
#include "run.hpp"

namespace margay::port {

Verdict check_port(const Port& port) {
    Run run(port);
    check_osal(run);
    if (port.nic != nullptr) check_nic(run);
    if (port.nic != nullptr) check_timing(run);
    check_clock_of_run(run);
    std::array<char, 80> line{};
    TextWriter text(line);
    text << std::uint64_t{run.verdict().passed} << " passed, " << std::uint64_t{run.verdict().failed} << " failed, "
         << std::uint64_t{run.verdict().skipped} << " skipped";
    run.print(text.text());
    return run.verdict();
}

}  // namespace margay::port
