// Reads files with the installed package.
#include <margay/files/eni.hpp>
#include <margay/files/esi.hpp>

int main() {
    const auto eni = margay::files::read_eni("<EtherCATInfo/>");
    const auto esi = margay::files::read_esi("<EtherCATConfig/>");
    return !eni && !esi && eni.problem.line == 1 && esi.problem.line == 1 ? 0 : 1;
}
