#include "argument_text.hpp"

#include <margay/features.hpp>

namespace margay {

// BOOT is allowed only for a single slave.
static std::string_view states_text(const Error& where) {
    if (where.step == Step::configure_mailbox) return "the state must be PREOP or BOOT";
    if (where.slave != 0) return "the state must be INIT, PREOP, BOOT, SAFEOP or OP";
    return "the state must be INIT, PREOP, SAFEOP or OP";
}

static std::string_view sync_start_text(const Error& where) {
    if (where.expected != 0)
        return "the start of SYNC0 is more than 4.29 s ahead, and the clock of the slave has 32 bits";
    if (where.actual != 0) return "each time the start of SYNC0 has passed before the slave activated it";
    return "ClockSettings::start_time has returned a time that has passed";
}

std::string_view argument_text(Argument argument, const Error& where) {
    switch (argument) {
        case Argument::unknown: break;
        case Argument::limit_slaves: return "Limits::slaves";
        case Argument::limit_frames: return "Limits::frames";
        case Argument::limit_groups: return "Limits::groups";
        case Argument::limit_process_frames: return "Limits::process_frames";
        case Argument::link_frame_timeout: return "LinkSettings::frame_timeout must be above zero";
        case Argument::link_queue_timeout: return "LinkSettings::queue_timeout must be above zero";
        case Argument::link_sendings: return "LinkSettings::sendings must be at least 1";
        case Argument::priority: return "the priority must be 0 to 3";
        case Argument::timeout: return "the timeout must not be negative";
        case Argument::period: return "the period must be above zero";
        case Argument::reply_timeout: return "the reply timeout must not be negative";
        case Argument::send_lead: return "the send lead must be longer than 0 and shorter than the period";
        case Argument::interval:
            return "an interval must be above zero (line_interval: zero or more; of latches at a clock of 32 bits: 2 s "
                   "at most)";
        case Argument::look_every: return "the interval of looks for mail must not be negative (zero: no looks)";
        case Argument::state: return states_text(where);
        case Argument::work: return "there is no work function";
        case Argument::sii_words: return "beyond the end of the EEPROM";
        case Argument::sii_size:
            return "the SII is read and written in words, the data must have an even number of octets, at least 2";
        case Argument::register_octets: return "1 to 1486 octets, and none beyond register 0xffff";
        case Argument::complete_access: return "a complete access begins at subindex 0 or 1";
        case Argument::soe_drive: return "a slave has drives 0 to 7";
        case Argument::mail_type: return "the mailbox protocol must be 1 to 15 (of a listener 0 to 15)";
        case Argument::mail_size: return "the mailbox message";
        case Argument::mail_listener: return "the object does not listen, call listen()";
        case Argument::aoe_size: return "the length in the AoE command";
        case Argument::eoe_filter: return "an address filter has at most 15 addresses and 3 masks";
        case Argument::eoe_port_memory: return "the memory of the EoePort has no room for one frame in each direction";
        case Argument::highest: return "SlaveConfiguration::highest must be PREOP, SAFEOP or OP";
        case Argument::watchdog_time: return "process_data_watchdog must be at most 65535 units of the divider";
        case Argument::sync_manager_count: return "SlaveConfiguration::sm_count must be at most 8";
        case Argument::sync_manager_direction: return "ProcessSm::direction is no Direction";
        case Argument::sync_manager_of_mailbox:
            return "SlaveConfiguration::sms names a SyncManager of the slave's mailbox";
        case Argument::configuration_source: return "SlaveConfiguration::source is no ConfigurationSource";
        case Argument::sync_manager_twice: return "SlaveConfiguration::sms has this SyncManager twice";
        case Argument::pdi_watchdog: return "SlaveTimes::pdi_watchdog must be zero to 65535 units of the divider";
        case Argument::state_time: return "the times of SlaveTimes must not be negative";
        case Argument::mailbox_time: return "SlaveTimes::mailbox must not be negative";
        case Argument::command_transition: return "has no transition, or an unknown one";
        case Argument::command_kind: return "the kind or the moment of a start-up command is no known one";
        case Argument::command_time: return "the timeout of a start-up command must not be negative";
        case Argument::command_value:
            return "the value of the start-up command has a size that the command cannot have";
        case Argument::image_start:
            return "GroupConfiguration::start: the image overlaps another one, or ends above 0xffffffff";
        case Argument::packing: return "GroupConfiguration::packing is no Packing";
        case Argument::lost_inputs: return "GroupConfiguration::lost_inputs is no LostInputs";
        case Argument::cycles_in_flight: return "GroupConfiguration::cycles_in_flight must be 1 to 4";
        case Argument::reserve_bytes: return "GroupConfiguration::reserve_bytes leaves no space in the frame";
        case Argument::dc_reference: return "GroupConfiguration::dc_reference is a slave without a DC clock";
        case Argument::copy:
            return "GroupConfiguration::copies: at least 1 bit, and only bits of the slave's data in this group";
        case Argument::entry_handle: return "GroupConfiguration::entries has a null pointer";
        case Argument::empty_group: return "no slave has this group in SlaveConfiguration::group";
        case Argument::sync_cycle:
            return "a SYNC cycle must be 0 to 4.29 s, and SYNC1 less than a SYNC0 cycle before its SYNC0";
        case Argument::clock_settings:
            return "ClockSettings: measurements and burst_bulk at least 1, times from 0 to 100 years, cycle above "
                   "zero, group below Limits::groups";
        case Argument::file_name: return "the name of the file does not fit the mailbox of the slave";
        case Argument::file_time: return "answer_timeout and busy_timeout must be above zero";
        case Argument::sync_grid: return "ClockSettings::start_grid must be a whole multiple of the SYNC cycle";
        case Argument::sync_pulse: return "the cycle of a SYNC signal must be longer than its pulse";
        case Argument::aoe_time: return "a time of a notification must be 0 to 429 s";
        case Argument::image_place:
            return "SlaveSetup::place overlaps the data of another slave, or begins within an octet";
        case Argument::sdo_stream: return "there is no source or sink, or the size has more than 32 bits";
        case Argument::command_message:
            return "the message of the start-up command writes or sets nothing, contradicts itself or does not fit the "
                   "mailbox";
        case Argument::second_nic: return "the second NIC is the first one: a ring needs two";
        case Argument::sync_start: return sync_start_text(where);
    }
    return {};
}

bool needs_feature(const Error& e) {
    const bool by_step =
        e.step == Step::discover_pdos || e.step == Step::map_process_data || e.step == Step::request_state;
    return e.code == Errc::unsupported && by_step && e.detail != 0;
}

std::string_view feature_text(const Error& e) {
    switch (static_cast<Feature>(e.detail)) {
        case Feature::coe: return "init() was not given kCoeFeature, so the object dictionary is not read";
        case Feature::soe: return "init() was not given kSoeFeature, so the parameters of the drives are not read";
        case Feature::overlap: return "init() was not given kOverlapFeature, so cycles_in_flight must be 1";
        case Feature::boot: return "init() was not given kBootFeature, so slaves cannot be brought to BOOT";
        case Feature::none: break;
    }
    return "init() was not given the feature";
}

std::string_view capacity_text(const Error& e) {
    constexpr std::string_view kSequences = "Limits::tasks, or Limits::arena_bytes";
    if (e.detail == Error::kTasks) return kSequences;
    if (e.detail == Error::kPlaces) return "places for requests of other threads";
    if (e.detail == Error::kRedundancy) return "Limits::redundancy is false";
    // If a buffer is too small, `expected` is the required size. Only for a file this size is not known.
    const bool of_buffer = e.expected != 0 || e.step == Step::foe_read;
    switch (e.step) {
        case Step::count_slaves:
        case Step::identify:
        case Step::recover: return "Limits::slaves";
        case Step::open_nic: return "the memory of the context";
        case Step::mailbox_send: return of_buffer ? "the mailbox of the slave" : kSequences;
        case Step::sdo_upload:
        case Step::soe_read:
        case Step::foe_read:
        case Step::voe_receive:
        case Step::aoe_read:
        case Step::aoe_read_write:
        case Step::mailbox_receive: return of_buffer ? "the buffer of the call" : kSequences;
        case Step::map_process_data: return "SharedImage";
        case Step::configure_clocks: return "Limits::clocks is false";
        default: return kSequences;
    }
}

std::string_view lost_text(const Error& e) {
    if (e.slave != 0) return "the new scan has deleted its config and its hooks: set them again, or use expect()";
    if (e.detail == Error::kOfGroup)
        return "the config of a group that does not exist was written: write it after init(), to groups below "
               "Limits::groups";
    return to_text(e.code);
}

std::string_view pdo_list_text(PdoListFault why) {
    switch (why) {
        case PdoListFault::sync_manager_twice: return "two lists name this SyncManager";
        case PdoListFault::too_many_pdos: return "a SyncManager has room for 254 PDOs";
        case PdoListFault::pdo_twice: return "the PDO is listed twice";
        case PdoListFault::no_pdo_index: return "PDOs are 0x1600 to 0x17FF and 0x1A00 to 0x1BFF";
        case PdoListFault::too_many_entries: return "a PDO has room for 254 entries";
        case PdoListFault::no_bits: return "an entry has 0 bits";
        case PdoListFault::none: break;
    }
    return "reason unknown";
}

}  // namespace margay
