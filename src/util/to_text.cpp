// Texts for the enumerations of the public API.
#include <margay/al_state.hpp>
#include <margay/configuration.hpp>
#include <margay/error.hpp>

namespace margay {

std::string_view to_text(Errc code) {
    switch (code) {
        case Errc::none: return "no error";
        case Errc::timeout: return "timed out";
        case Errc::no_frame: return "the frame did not come back";
        case Errc::working_counter: return "wrong working counter";
        case Errc::link_down: return "no link: is the cable plugged in and the other end powered?";
        case Errc::nic: return "the network interface refused the frame";
        case Errc::capacity: return "not enough memory";
        case Errc::no_slaves: return "no slave answered";
        case Errc::unstable: return "the slaves, or their connections, have changed meanwhile";
        case Errc::unknown_slave: return "there is no such slave";
        case Errc::invalid_argument: return "argument out of range";
        case Errc::wrong_state: return "not possible in this state";
        case Errc::busy: return "already in progress";
        case Errc::canceled: return "the request was canceled";
        case Errc::al_status: return "the slave refused";
        case Errc::sii_busy: return "the EEPROM stayed busy";
        case Errc::sii_nack: return "the EEPROM did not acknowledge";
        case Errc::sii_verify: return "read back differently from what was written";
        case Errc::sii_checksum: return "wrong checksum of the configuration area";
        case Errc::sii_blank: return "the EEPROM is blank";
        case Errc::sii_truncated: return "the content ends early";
        case Errc::sii_format: return "the content contradicts itself";
        case Errc::sii_write_denied: return "the EEPROM refused to be written";
        case Errc::protocol: return "a reply that the standard does not allow";
        case Errc::mailbox_error: return "mailbox error reply";
        case Errc::sdo_abort: return "the slave aborted the transfer";
        case Errc::soe_error: return "the drive refused";
        case Errc::foe_error: return "the slave ended the file transfer";
        case Errc::stream_failed: return "the source or sink of the application has failed";
        case Errc::command_failed: return "the command could not be executed";
        case Errc::unsupported: return "not supported by the slave";
        case Errc::identity_unread:
            return "the slave was away, and its identity was not compared since: readstate() or a supervision does "
                   "it";
        case Errc::other_slave: return "another slave than expected";
        case Errc::missing_slave: return "the slave is missing";
        case Errc::unexpected_slave: return "the slave is not in the list of expected slaves";
        case Errc::no_place:
            return "the slave has process data, but no place in the image is reserved for it: call "
                   "config_map() again";
        case Errc::remapping_needed:
            return "its revision, SyncManagers or PDOs have changed since config_map(): call config_map() again";
        case Errc::scan_needed: return "expect() was called after config_init(): call config_init() again";
        case Errc::unknown_group: return "there is no such group, or nothing is mapped in it: call config_map()";
        case Errc::image_too_large: return "the process image is larger than the buffer";
        case Errc::fmmu_shortage: return "the slave has too few FMMUs";
        case Errc::sm_shortage: return "the slave has no such SyncManager";
        case Errc::sm_memory: return "outside the slave's process data memory, or on top of another SyncManager";
        case Errc::too_many_frames: return "more frames than the application provided for";
        case Errc::mailbox_full:
            return "the slave accepts no mailbox message: its mailbox is full, or not enabled in this AL state";
        case Errc::wrong_size: return "the size of the value differs from the requested size";
        case Errc::pdo_list: return "the list of PDOs is invalid";
        case Errc::pdo_unknown: return "neither the list nor the slave says which entries the PDO has";
        case Errc::not_process_sm: return "a list of PDOs for a SyncManager of a mailbox";
        case Errc::wrong_direction: return "the direction of the PDO differs from the direction of its SyncManager";
        case Errc::pdo_size: return "the size of the PDOs differs from the size of the SyncManager";
        case Errc::sizes_differ: return "sources differ";
        case Errc::types_differ: return "object 0x1C00 and the SII differ";
        case Errc::above_highest: return "the slave's configuration allows no such state";
        case Errc::check_failed: return "the value is not the required one";
        case Errc::not_owner:
            return "another thread owns the context: submit a request, or call take_ownership() at a time that both "
                   "threads know";
        case Errc::not_polled: return "the thread that owns the context does not call poll()";
        case Errc::waiting_forbidden:
            return "this call waits, and allow_waiting() forbids that in the thread that owns the context: submit() "
                   "a request (in place of reach(): a SuperviseRequest) and look at its state() between cycles";
        case Errc::in_callback:
            return "this call is not possible in a callback, a hook or the work function of run_cycle(): submit() a "
                   "request there, or write the hook as a sequence";
        case Errc::nic_busy: return "the network interface does not take frames";
        case Errc::datagram_size: return "more data than a datagram can carry";
        case Errc::no_cycle:
            return "no cycle is on the wire: call send_processdata() before each receive_processdata()";
        case Errc::mailbox_closed:
            return "the mailbox was closed while the message waited, because the slave has gone to INIT, is started or "
                   "is found anew";
        case Errc::reply_lost: return "the reply was lost on the wire, and the slave does not have it any more";
        case Errc::entry_not_mapped: return "no PDO that the slave exchanges has this entry";
        case Errc::entry_direction: return "the direction of the entry differs";
        case Errc::entry_size: return "the entry does not have the size of the type";
        case Errc::entry_stale: return "the group was mapped again since the entry was found: find it again";
        case Errc::entry_type: return "one of entry and type is a floating point number, the other is not";
        case Errc::other_state: return "the slave is not in the state that is wanted";
        case Errc::image_overlaps: return "the image overlaps that of another group: give each group octets of its own";
        case Errc::not_supervised:
            return "the states of the slaves were read more than a second ago: submit a SuperviseRequest, or call "
                   "readstate() again and again";
        case Errc::group_left_out: return "the group is mapped, but its process data was not exchanged for a second";
        case Errc::place_unknown:
            return "no place in the image, the sizes of its process data are not known (SlaveSetup::pdos): it can take "
                   "part after the next config_map()";
        case Errc::configuration_lost:
            return "config or hooks of a slave that does not exist were written: write them after config_init(), to "
                   "slaves 1 and up, or use expect()";
        case Errc::start_up_unfinished:
            return "the commands or the hook after the transition have not ended, or were ended early";
        case Errc::no_clock: return "no clock that runs";
        case Errc::clock_before_reference:
            return "a slave before the reference clock in the ring has a clock, which the reference cannot synchronise";
        case Errc::clock_not_reached: return "the reference clock does not synchronise the clock";
        case Errc::not_in_sync: return "the clock is not in sync";
        case Errc::aoe_error: return "the AoE command was not executed";
        case Errc::aoe_result: return "the device refused the AoE command";
        case Errc::eoe_error: return "the slave refused the EoE request";
        case Errc::cabling: return "the two network interfaces are connected wrongly";
        case Errc::supervised: return "the supervision keeps the slave in another state: call set_target()";
    }
    return "unknown error";
}

std::string_view to_text(Step step) {
    switch (step) {
        case Step::none: return "";
        case Step::open_nic: return "opening the network interface";
        case Step::wait_link: return "waiting for link";
        case Step::count_slaves: return "counting slaves";
        case Step::reset_slaves: return "resetting slaves";
        case Step::assign_address: return "assigning station addresses";
        case Step::read_dl_information: return "reading DL information";
        case Step::read_sii: return "reading the SII";
        case Step::write_sii: return "writing the SII";
        case Step::parse_sii: return "parsing the SII";
        case Step::configure_mailbox: return "configuring the mailbox";
        case Step::request_state: return "requesting a state";
        case Step::read_state: return "reading the state";
        case Step::discover_pdos: return "finding the PDOs";
        case Step::map_process_data: return "mapping process data";
        case Step::configure_process_data: return "configuring process data";
        case Step::exchange_process_data: return "exchanging process data";
        case Step::mailbox_send: return "sending to the mailbox";
        case Step::mailbox_receive: return "receiving from the mailbox";
        case Step::sdo_upload: return "SDO upload";
        case Step::sdo_download: return "SDO download";
        case Step::sdo_information: return "SDO information";
        case Step::soe_read: return "SoE read";
        case Step::soe_write: return "SoE write";
        case Step::soe_command: return "SoE command";
        case Step::foe_read: return "FoE read";
        case Step::foe_write: return "FoE write";
        case Step::voe_send: return "VoE send";
        case Step::voe_receive: return "VoE receive";
        case Step::aoe_read: return "AoE read";
        case Step::aoe_write: return "AoE write";
        case Step::aoe_read_write: return "AoE read and write";
        case Step::aoe_write_control: return "AoE write control";
        case Step::aoe_read_state: return "AoE read state";
        case Step::aoe_device_info: return "AoE device information";
        case Step::aoe_notification: return "AoE notification";
        case Step::aoe_net_id: return "setting the AoE NetID";
        case Step::eoe_set_ip: return "setting the IP parameters";
        case Step::eoe_get_ip: return "reading the IP parameters";
        case Step::eoe_set_filter: return "setting the address filter";
        case Step::eoe_get_filter: return "reading the address filter";
        case Step::eoe_frames: return "EoE frames";
        case Step::read_register: return "reading";
        case Step::write_register: return "writing";
        case Step::configure_pdos: return "configuring PDOs";
        case Step::command_ip: return "command at IP";
        case Step::command_ps: return "command at PS";
        case Step::command_so: return "command at SO";
        case Step::command_os: return "command at OS";
        case Step::command_op: return "command at OP (OP to PREOP)";
        case Step::command_oi: return "command at OI";
        case Step::command_sp: return "command at SP";
        case Step::command_si: return "command at SI";
        case Step::command_pi: return "command at PI";
        case Step::command_ib: return "command at IB";
        case Step::command_bi: return "command at BI";
        case Step::application_hook: return "the hook of the application";
        case Step::supervise: return "supervising the slaves";
        case Step::configure_clocks: return "synchronising the clocks";
        case Step::configure_sync: return "activating SYNC";
        case Step::watch_latches: return "watching latch inputs";
        case Step::exchange_datagram: return "exchanging a datagram";
        case Step::recover: return "recovering the slave";
        case Step::identify: return "comparing with what is expected";
        case Step::topology: return "finding the topology";
    }
    return "";
}

std::string_view to_text(Operation operation) {
    switch (operation) {
        case Operation::none: return "";
        case Operation::scan: return "a scan";
        case Operation::map: return "a mapping of process data";
        case Operation::supervise: return "a supervision";
        case Operation::reconfigure: return "a reconfiguration";
        case Operation::recover: return "a search for lost slaves";
        case Operation::change_state: return "a change of state";
        case Operation::set_target: return "a change of targets";
        case Operation::read_states: return "a reading of states";
        case Operation::write_states: return "a request of states";
        case Operation::check_states: return "a wait for states";
        case Operation::read_sii: return "a reading of the SII";
        case Operation::write_sii: return "a writing of the SII";
        case Operation::read_register: return "a reading of registers";
        case Operation::write_register: return "a writing of registers";
        case Operation::sdo_upload: return "an SDO upload";
        case Operation::sdo_download: return "an SDO download";
        case Operation::sdo_information: return "an SDO information request";
        case Operation::mail_pdo: return "a PDO by mailbox";
        case Operation::soe_read: return "a SoE read";
        case Operation::soe_write: return "a SoE write";
        case Operation::soe_command: return "a SoE command";
        case Operation::foe_read: return "a FoE read";
        case Operation::foe_write: return "a FoE write";
        case Operation::raw_mail: return "a mailbox message";
        case Operation::voe_send: return "a VoE message";
        case Operation::voe_receive: return "a wait for VoE";
        case Operation::aoe: return "an AoE command";
        case Operation::eoe_parameters: return "an EoE request";
        case Operation::eoe_port: return "an exchange of Ethernet frames";
        case Operation::find_entry: return "a search for an entry";
        case Operation::configure_clocks: return "a synchronisation of the clocks";
        case Operation::set_sync: return "a change of SYNC signals";
        case Operation::watch_latches: return "the watch of latch inputs";
        case Operation::exchange_datagram: return "a datagram";
    }
    return "";
}

std::string_view to_text(ConfigurationSource source) {
    switch (source) {
        case ConfigurationSource::none: return "no known source";
        case ConfigurationSource::sii: return "the SII";
        case ConfigurationSource::coe: return "the object dictionary";
        case ConfigurationSource::soe: return "the parameters of its drives";
        case ConfigurationSource::file: return "the configuration file";
        case ConfigurationSource::application: return "the application";
    }
    return "unknown source";
}

std::string_view to_text(IdentityField field) {
    switch (field) {
        case IdentityField::product: return "product";
        case IdentityField::vendor: return "vendor";
        case IdentityField::revision: return "revision";
        case IdentityField::serial: return "serial number";
        case IdentityField::alias: return "alias";
        case IdentityField::device_id: return "device id";
        case IdentityField::hot_connect: return "hot connect group";
    }
    return "identity";
}

std::string_view to_text(AlState state) {
    switch (state) {
        case AlState::none: return "NONE";
        case AlState::init: return "INIT";
        case AlState::preop: return "PREOP";
        case AlState::boot: return "BOOT";
        case AlState::safeop: return "SAFEOP";
        case AlState::op: return "OP";
    }
    return "unknown state";
}

}  // namespace margay
