#include "wire/foe.hpp"

namespace margay::wire::foe {

std::string_view to_text(ErrorCode code) {
    using enum ErrorCode;
    switch (code) {
        case undefined: return "not defined";
        case not_found: return "the file was not found";
        case access_denied: return "access denied";
        case disk_full: return "the disk is full";
        case illegal: return "illegal operation";
        case wrong_packet_number: return "wrong packet number";
        case already_exists: return "the file exists already";
        case no_user: return "no such user";
        case bootstrap_only: return "possible in BOOT only";
        case not_in_bootstrap: return "not possible in BOOT";
        case no_rights: return "no access rights";
        case program_error: return "program error";
        case wrong_checksum: return "wrong checksum";
        case firmware_does_not_fit: return "the firmware does not fit the hardware";
        case no_file_to_read: return "no file to read";
        case no_file_header: return "the file header does not exist";
        case flash_problem: return "flash problem";
        case file_incompatible: return "the file is incompatible";
    }
    return "unknown FoE error";
}

}  // namespace margay::wire::foe
