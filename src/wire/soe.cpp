#include "wire/soe.hpp"

#include "util/text_writer.hpp"

namespace margay {

std::string_view to_text(Idn idn, std::span<char> into) {
    TextWriter out(into);
    const unsigned number = idn.number();
    const char digits[] = {idn.of_product() ? 'P' : 'S',
                           '-',
                           static_cast<char>('0' + idn.set()),
                           '-',
                           static_cast<char>('0' + number / 1000),
                           static_cast<char>('0' + number / 100 % 10),
                           static_cast<char>('0' + number / 10 % 10),
                           static_cast<char>('0' + number % 10)};
    out << std::string_view(digits, sizeof digits);
    return out.text();
}

namespace {

// Reads digits up to the end or a dash. Returns nullopt when the number is larger than `most`.
std::optional<unsigned> read_number(std::string_view& text, unsigned most) {
    unsigned value = 0;
    std::size_t n = 0;
    for (; n < text.size() && text[n] != '-'; ++n) {
        if (text[n] < '0' || text[n] > '9') return std::nullopt;
        value = value * 10 + static_cast<unsigned>(text[n] - '0');
        if (value > most) return std::nullopt;
    }
    if (n == 0) return std::nullopt;
    text.remove_prefix(n);
    return value;
}

}  // namespace

std::optional<Idn> parse_idn(std::string_view text) {
    if (text.size() < 3 || text[1] != '-') return std::nullopt;
    const bool product = text[0] == 'P' || text[0] == 'p';
    if (!product && text[0] != 'S' && text[0] != 's') return std::nullopt;
    text.remove_prefix(2);
    auto number = read_number(text, 0x0FFF);
    if (!number) return std::nullopt;
    unsigned set = 0;
    if (!text.empty()) {
        set = *number;
        text.remove_prefix(1);
        number = read_number(text, 0x0FFF);
        if (!number || set > 7 || !text.empty()) return std::nullopt;
    }
    return product ? Idn::product(*number, set) : Idn::standard(*number, set);
}

}  // namespace margay

namespace margay::wire::soe {

std::array<Idn, 2> telegram(unsigned type, bool mdt) {
    using namespace idn;
    switch (type) {
        case 1: return mdt ? std::array{kTorqueCommand, Idn{}} : std::array<Idn, 2>{};
        case 2: return {mdt ? kVelocityCommand : kVelocityFeedback};
        case 3: return {mdt ? kVelocityCommand : kPositionFeedback};
        case 4: return {mdt ? kPositionCommand : kPositionFeedback};
        case 5: return {mdt ? kPositionCommand : kPositionFeedback, mdt ? kVelocityCommand : kVelocityFeedback};
        case 6: return mdt ? std::array{kVelocityCommand, Idn{}} : std::array<Idn, 2>{};
        default: return {};
    }
}

std::string_view to_text(ErrorCode code) {
    using enum ErrorCode;
    switch (code) {
        case none: return "no error";
        case no_idn: return "no such IDN";
        case invalid_access: return "invalid access to the IDN itself";
        case no_name: return "it has no name";
        case name_too_short: return "name too short";
        case name_too_long: return "name too long";
        case name_read_only: return "the name cannot be changed";
        case name_protected: return "the name is write-protected at this time";
        case attribute_too_short: return "attribute too short";
        case attribute_too_long: return "attribute too long";
        case attribute_read_only: return "the attribute cannot be changed";
        case attribute_protected: return "the attribute is write-protected at this time";
        case no_unit: return "it has no unit";
        case unit_too_short: return "unit too short";
        case unit_too_long: return "unit too long";
        case unit_read_only: return "the unit cannot be changed";
        case unit_protected: return "the unit is write-protected at this time";
        case no_minimum: return "it has no minimum";
        case minimum_too_short: return "minimum too short";
        case minimum_too_long: return "minimum too long";
        case minimum_read_only: return "the minimum cannot be changed";
        case minimum_protected: return "the minimum is write-protected at this time";
        case no_maximum: return "it has no maximum";
        case maximum_too_short: return "maximum too short";
        case maximum_too_long: return "maximum too long";
        case maximum_read_only: return "the maximum cannot be changed";
        case maximum_protected: return "the maximum is write-protected at this time";
        case value_too_short: return "value too short";
        case value_too_long: return "value too long";
        case value_read_only: return "the value cannot be changed";
        case value_protected: return "the value is write-protected in this state";
        case value_too_small: return "value below the minimum";
        case value_too_large: return "value above the maximum";
        case value_invalid: return "invalid value";
        case value_password: return "the value is write-protected by a password";
        case value_cyclic: return "the value is write-protected: it is part of the cyclic data";
        case invalid_indirect: return "invalid indirect addressing";
        case value_settings: return "the value is write-protected by other settings";
        case value_reserved: return "invalid floating point number";
        case value_parameterization: return "the value is write-protected at parameterization level";
        case value_operation: return "the value is write-protected at operation level";
        case command_active: return "the command is active already";
        case command_not_interruptible: return "the command cannot be interrupted";
        case command_not_now: return "the command cannot be executed at this time";
        case command_invalid: return "the command cannot be executed: invalid parameters";
        case no_data_state: return "it has no data state";
        case no_default: return "it has no default value";
        case default_too_long: return "default value too long";
        case default_read_only: return "the default value cannot be changed";
        case invalid_drive: return "there is no such drive";
        case general: return "general error";
        case no_element: return "no element asked for";
    }
    return "unknown SoE error code";
}

}  // namespace margay::wire::soe
