// The commands reg_read, reg_write.
#include "common/counted.hpp"
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"
#include "ethercat/values.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace margay::ethercat {
namespace {

constexpr std::uint64_t kSpace = 0x10000;  // of register addresses

}  // namespace

int run_reg_read(Call& call) {
    const auto& words = call.words();
    const auto address = Call::number("ADDRESS", words[0], 0xFFFF);
    if (!address) return call.fail(address.problem());
    const auto type = named_type(call);
    if (!type) return call.fail(type.problem());
    std::uint64_t size = *type == nullptr ? 0 : (*type)->bytes;
    if (size == 0 && words.size() < 2)
        return call.fail({"SIZE is missing: it is the number of octets, and only a --type with a size replaces it",
                          samples::exit_code::kUsage});
    if (words.size() >= 2) {
        const auto given = Call::number("SIZE", words[1], 0xFFFF);
        if (!given) return call.fail(given.problem());
        if (size != 0 && *given != size)
            return call.fail(
                {fmt::format("SIZE is {}, and {} has {}", *given, (*type)->name, samples::counted(size, "octet")),
                 samples::exit_code::kUsage});
        size = *given;
    }
    if (size == 0 || *address + size > kSpace)
        return call.fail({fmt::format("{} from 0x{:04x} on: 1 octet or more up to 0xffff can be read",
                                      samples::counted(size, "octet"), *address),
                          samples::exit_code::kUsage});
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const auto octets = slave->session().read_registers(slave->position(), static_cast<std::uint16_t>(*address), size);
    if (!octets) return call.fail(octets.problem());
    Output output;
    output.json = place_json(*slave);
    output.json["address"] = *address;
    output.json["octets"] = hex(*octets);
    if (*type == nullptr) {
        output.text = octets_text(*octets) + "\n";
        return call.print(output);
    }
    const auto text = value_text(**type, *octets);
    if (!text) return call.fail(text.problem());
    output.text = *text + "\n";
    output.json["type"] = (*type)->name;
    output.json["value"] = value_json(**type, *octets);
    return call.print(output);
}

int run_reg_write(Call& call) {
    const auto& words = call.words();
    const auto address = Call::number("ADDRESS", words[0], 0xFFFF);
    if (!address) return call.fail(address.problem());
    const auto type = named_type(call);
    if (!type) return call.fail(type.problem());
    const auto octets = *type == nullptr ? read_octets(words[1]) : value_argument(**type, words[1]);
    if (!octets) return call.fail(octets.problem());
    constexpr std::size_t kOnce = 1486;  // of one datagram
    if (octets->empty() || octets->size() > kOnce || *address + octets->size() > kSpace)
        return call.fail({fmt::format("{} from 0x{:04x} on: 1 to {} octets up to 0xffff can be written",
                                      samples::counted(octets->size(), "octet"), *address, kOnce),
                          samples::exit_code::kUsage});
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const auto done = slave->session().write_registers(slave->position(), static_cast<std::uint16_t>(*address), *octets,
                                                       call.has("emergency"));
    if (!done) return call.fail(done.problem());
    if (!call.json()) return samples::exit_code::kWell;
    Output output;
    output.json = place_json(*slave);
    output.json["address"] = *address;
    output.json["written"] = hex(*octets);
    return call.print(output);
}

}  // namespace margay::ethercat
