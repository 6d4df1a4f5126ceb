// The commands soe_read, soe_write.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <array>

namespace margay::ethercat {
namespace {

struct Parameter {
    std::uint8_t drive = 0;
    Idn idn{};
};

// The drive may be left out: `count` words are drive and IDN, or the IDN alone.
Answer<Parameter> parameter_of(const std::vector<std::string>& words, std::size_t count) {
    Parameter parameter;
    if (count == 2) {
        const auto drive = Call::number("DRIVE", words[0], 7);
        if (!drive) return drive.problem();
        parameter.drive = static_cast<std::uint8_t>(*drive);
    }
    const std::string& word = words[count - 1];
    if (const auto idn = parse_idn(word)) {
        parameter.idn = *idn;
        return parameter;
    }
    const auto value = parse_unsigned(word, 0xFFFF);
    if (!value)
        return Problem{fmt::format("IDN: '{}' is neither a number up to 65535 nor written like P-0-150", word),
                       samples::exit_code::kUsage};
    parameter.idn.value = static_cast<std::uint16_t>(*value);
    return parameter;
}

const DataType* type_of(const SoeAttribute& attribute) {
    if (attribute.list) return type_by_name(attribute.type == SoeType::text ? "string" : "octet_string");
    const bool is_signed = attribute.type == SoeType::signed_decimal;
    if (attribute.type == SoeType::floating) return type_by_name(attribute.bytes == 8 ? "double" : "float");
    return type_by_name(fmt::format("{}int{}", is_signed ? "" : "u", 8 * attribute.bytes));
}

// Whether a value begins with the lengths of a list: the present and the greatest number of octets. For slaves without
// the attribute.
bool looks_like_list(std::span<const std::byte> value) {
    const auto number = [&](std::size_t at) {
        return std::to_integer<std::size_t>(value[at]) | std::to_integer<std::size_t>(value[at + 1]) << 8;
    };
    return value.size() >= 4 && number(0) == value.size() - 4 && number(2) >= number(0);
}

}  // namespace

int run_soe_read(Call& call) {
    const auto parameter = parameter_of(call.words(), call.words().size());
    if (!parameter) return call.fail(parameter.problem());
    const auto named = named_type(call);
    if (!named) return call.fail(named.problem());
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const DataType* type = *named;
    enum class Head { none, lengths, unknown } head = Head::none;
    if (type == nullptr || type->kind == DataType::Kind::text) {
        const auto attribute = slave->session().soe_attribute(slave->position(), parameter->drive, parameter->idn);
        if (!attribute && type == nullptr) return call.fail(attribute.problem());
        if (type == nullptr) type = type_of(*attribute);
        head = !attribute ? Head::unknown : attribute->list ? Head::lengths : Head::none;
    }
    auto value = slave->session().soe_read(slave->position(), parameter->drive, parameter->idn);
    if (!value) return call.fail(value.problem());
    std::span<const std::byte> shown(*value);
    // Present and greatest length.
    if (head == Head::lengths || (head == Head::unknown && looks_like_list(shown)))
        shown = shown.subspan(std::min<std::size_t>(shown.size(), 4));
    const auto text = value_text(*type, shown);
    if (!text) return call.fail(text.problem());
    std::array<char, 16> idn{};
    Output output;
    output.text = *text + "\n";
    output.json = place_json(*slave);
    output.json["drive"] = parameter->drive;
    output.json["idn"] = to_text(parameter->idn, idn);
    output.json["type"] = type->name;
    output.json["value"] = value_json(*type, shown);
    output.json["octets"] = hex(*value);
    return call.print(output);
}

int run_soe_write(Call& call) {
    const auto parameter = parameter_of(call.words(), call.words().size() - 1);
    if (!parameter) return call.fail(parameter.problem());
    const auto type = named_type(call);
    if (!type) return call.fail(type.problem());
    if (*type == nullptr) return call.fail({"soe_write needs --type", samples::exit_code::kUsage});
    const auto octets = value_argument(**type, call.words().back());
    if (!octets) return call.fail(octets.problem());
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const auto done = slave->session().soe_write(slave->position(), parameter->drive, parameter->idn, *octets);
    if (!done) return call.fail(done.problem());
    if (!call.json()) return samples::exit_code::kWell;
    Output output;
    output.json = place_json(*slave);
    output.json["written"] = hex(*octets);
    return call.print(output);
}

}  // namespace margay::ethercat
