#include "compat/source/source.hpp"

#include "osal/linux/linux_osal.hpp"
#include "oshw/linux/packet_nic.hpp"

#include <cstdlib>
#include <fstream>
#include <string_view>

namespace margay::compat {
namespace {

class InterfaceSource final : public Source {
  public:
    [[nodiscard]] std::string open(const std::string& name) {
        return nic_.open(name) ? std::string() : std::string(nic_.problem());
    }
    Nic& nic() override { return nic_; }
    Osal& osal() override { return osal_; }

  private:
    LinuxOsal osal_;
    PacketNic nic_;
};

std::string trimmed(std::string_view text) {
    constexpr std::string_view kBlank = " \t\r\"";
    const auto first = text.find_first_not_of(kBlank);
    if (first == std::string_view::npos) return {};
    return std::string(text.substr(first, text.find_last_not_of(kBlank) - first + 1));
}

std::string source_in_file(const char* file, const std::string& key) {
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        const auto equals = line.find('=');
        if (equals == std::string::npos || trimmed(line).starts_with('#')) continue;
        if (trimmed(std::string_view(line).substr(0, equals)) == key)
            return trimmed(std::string_view(line).substr(equals + 1));
    }
    return {};
}

}  // namespace

OpenedSource open_source(const std::string& text) {
    constexpr std::string_view kSimulated = "sim:";
    if (text.starts_with(kSimulated)) return open_simulated(text.substr(kSimulated.size()));
    if (text.find('+') != std::string::npos)
        return {nullptr, "'" + text + "': two interfaces for one segment (redundancy) are not supported yet"};
    auto source = std::make_unique<InterfaceSource>();
    std::string problem = source->open(text);
    if (!problem.empty()) return {nullptr, std::move(problem)};
    return {std::move(source), {}};
}

std::string bound_source(unsigned index) {
    const std::string key = "MARGAY_MASTER" + std::to_string(index);
    if (const char* bound = std::getenv(key.c_str()); bound != nullptr && *bound != '\0') return bound;
    const char* file = std::getenv("MARGAY_MASTERS");
    return source_in_file(file != nullptr ? file : "/etc/margay/masters.conf", key);
}

}  // namespace margay::compat
