#include "wire/coe.hpp"

namespace margay::wire::coe {

std::string_view to_text(Abort code) {
    using enum Abort;
    switch (code) {
        case none: return "no abort";
        case toggle_not_changed: return "toggle bit not changed";
        case timeout: return "SDO protocol timeout";
        case unknown_command: return "command specifier not valid or unknown";
        case out_of_memory: return "out of memory";
        case unsupported_access: return "unsupported access to an object";
        case write_only: return "attempt to read a write-only object";
        case read_only: return "attempt to write a read-only object";
        case subindex_needs_zero: return "subindex cannot be written, subindex 0 must be 0 for write access";
        case complete_access_unsupported: return "complete access not supported for this object";
        case exceeds_mailbox: return "object length exceeds the mailbox size";
        case mapped_to_rx_pdo: return "object is mapped to an RxPDO, download blocked";
        case no_object: return "object does not exist";
        case cannot_be_mapped: return "object cannot be mapped into the PDO";
        case exceeds_pdo: return "number and length of the objects to be mapped would exceed the PDO length";
        case parameter_incompatible: return "general parameter incompatibility";
        case internal_incompatibility: return "general internal incompatibility in the device";
        case hardware_error: return "access failed due to a hardware error";
        case length_mismatch: return "data type does not match, length of service parameter does not match";
        case length_too_high: return "length of service parameter too high";
        case length_too_low: return "length of service parameter too low";
        case no_subindex: return "subindex does not exist";
        case value_range: return "value range of parameter exceeded";
        case value_too_high: return "value of parameter too high";
        case value_too_low: return "value of parameter too low";
        case max_less_than_min: return "maximum value is less than minimum value";
        case general: return "general error";
        case cannot_store: return "data cannot be transferred or stored to the application";
        case local_control: return "data cannot be transferred or stored because of local control";
        case device_state: return "data cannot be transferred or stored in the present device state";
        case no_dictionary: return "object dictionary dynamic generation fails or no object dictionary is present";
    }
    return "unknown abort code";
}

std::string_view to_text(DataType type) {
    using enum DataType;
    switch (type) {
        case none: return "none";
        case boolean: return "BOOLEAN";
        case integer8: return "INTEGER8";
        case integer16: return "INTEGER16";
        case integer32: return "INTEGER32";
        case unsigned8: return "UNSIGNED8";
        case unsigned16: return "UNSIGNED16";
        case unsigned32: return "UNSIGNED32";
        case real32: return "REAL32";
        case visible_string: return "VISIBLE_STRING";
        case octet_string: return "OCTET_STRING";
        case unicode_string: return "UNICODE_STRING";
        case time_of_day: return "TIME_OF_DAY";
        case time_difference: return "TIME_DIFFERENCE";
        case domain: return "DOMAIN";
        case integer24: return "INTEGER24";
        case real64: return "REAL64";
        case integer40: return "INTEGER40";
        case integer48: return "INTEGER48";
        case integer56: return "INTEGER56";
        case integer64: return "INTEGER64";
        case unsigned24: return "UNSIGNED24";
        case unsigned40: return "UNSIGNED40";
        case unsigned48: return "UNSIGNED48";
        case unsigned56: return "UNSIGNED56";
        case unsigned64: return "UNSIGNED64";
        case guid: return "GUID";
        case byte: return "BYTE";
        case word: return "WORD";
        case dword: return "DWORD";
        case pdo_mapping: return "PDO_MAPPING";
        case identity: return "IDENTITY";
        case command: return "COMMAND_PAR";
        case sync_parameter: return "SYNC_PAR";
        case bit1: return "BIT1";
        case bit2: return "BIT2";
        case bit3: return "BIT3";
        case bit4: return "BIT4";
        case bit5: return "BIT5";
        case bit6: return "BIT6";
        case bit7: return "BIT7";
        case bit8: return "BIT8";
    }
    return "unknown data type";
}

}  // namespace margay::wire::coe
