#include "wire/mailbox.hpp"

namespace margay::wire {

std::string_view to_text(MailboxErrorCode code) {
    using enum MailboxErrorCode;
    switch (code) {
        case syntax: return "syntax of the mailbox header is wrong";
        case unsupported_protocol: return "the mailbox protocol is not supported";
        case invalid_channel: return "the channel field is not valid";
        case service_not_supported: return "the service of the mailbox protocol is not supported";
        case invalid_header: return "the header of the mailbox protocol is wrong";
        case size_too_short: return "the message is too short";
        case no_more_memory: return "no memory to work on the message";
        case invalid_size: return "the length is inconsistent";
        case service_in_work: return "the service is already being worked on";
    }
    return "unknown mailbox error";
}

std::string_view to_text(MailboxType type) {
    using enum MailboxType;
    switch (type) {
        case error: return "error";
        case aoe: return "AoE";
        case eoe: return "EoE";
        case coe: return "CoE";
        case foe: return "FoE";
        case soe: return "SoE";
        case voe: return "VoE";
    }
    return "unknown protocol";
}

}  // namespace margay::wire
