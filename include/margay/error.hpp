// Error: the code of a failure, the operation step, the slave, and details. A plain value of a few words; describe()
// makes a sentence of it.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

// The kind of failure. In brackets: which members of Error have a value, and their meaning.
enum class Errc : std::uint8_t {
    none,
    timeout,           // no final answer within the time allowed
    no_frame,          // a frame did not come back, although it was sent again (detail: 0, or Error::kUnmarked)
    working_counter,   // a frame came back, but not every addressed slave took part (expected, actual; of a cycle
                       // detail: 0, Error::kOthersFresh or Error::kBeingMapped)
    link_down,         // the NIC reports no carrier
    nic,               // the NIC refused to send (actual: the system's error number)
    capacity,          // a buffer or table of the caller is too small (expected: needed, actual: available)
    no_slaves,         // no slave has answered a broadcast
    unstable,          // the number of slaves changed while it was being counted (expected, actual)
    unknown_slave,     // no slave has this number
    invalid_argument,  // a parameter is out of range (detail: the Argument, if it is known; of a start-up command
                       // actual: the Argument, place: its number; of limits and settings expected: the greatest allowed
                       // value, actual: the value; of words of the SII expected: the number of words that the EEPROM
                       // has, word(): the first word that does not exist; of expect() actual: the number of the list
                       // entry, the first is 1)
    wrong_state,       // the call is not allowed in the present state of the context or of the slave (expected, actual)
    busy,              // another operation prevents this one (detail: the Operation, 0: not known); from submit(): the
                       // request itself is busy (detail: its operation)
    canceled,          // the caller has cancelled it
    al_status,         // the slave refused a state change (expected state, actual state; detail: AL status code)
    sii_busy,          // the SII interface stayed busy
    sii_nack,          // the EEPROM did not acknowledge, although the access was repeated
    sii_verify,        // the word that was read back differs from the written one (expected, actual)
    sii_checksum,      // wrong CRC of the configuration area (expected, actual)
    sii_blank,         // the EEPROM is erased (all 0xFF)
    sii_truncated,     // the content ends before the end that it declares
    sii_format,        // the content contradicts itself
    sii_write_denied,  // the EEPROM refused the write (write enable missing)
    protocol,          // the standard does not allow this reply
    mailbox_error,     // mailbox error reply (detail: detail code, ETG.1000.6 table "Mailbox error reply")
    sdo_abort,         // SDO abort (detail: the abort code)
    soe_error,         // error reply of a drive (detail: the SoE error code)
    foe_error,         // the slave ended a file transfer with an error (detail: the FoE error code)
    stream_failed,     // the source or the sink of the application has failed (detail: the number that it gave)
    command_failed,    // a procedure command of a drive ended with an error (detail: its data state)
    aoe_error,         // the AoE header of the answer has an error code: no device has executed the command (detail:
                       // the code, expected: index group, actual: index offset)
    aoe_result,        // the device has executed the AoE command, and its result is an error (the same members)
    eoe_error,         // the slave refused an EoE request (detail: the result code)
    unsupported,       // the slave does not support it, or the program has not given the Feature to init() (detail)
    // the identity of a slave that was away was not compared yet, or could not be read: it may be another device
    identity_unread,
    other_slave,    // another slave than expected (subindex: what differs, see IdentityField; expected, actual; detail:
                    // vendor of the present slave)
    missing_slave,  // an expected slave is missing, or one that was there does not answer any more (subindex:
                    // alias or device_id of IdentityField if this identifies the slave, and actual: its value)
    unexpected_slave,  // a slave that is not in the list of expect()
    no_place,  // a slave that appeared later has process data, and the image has no free part for it (expected: bits)
    // SlaveConfiguration::sms or the lists of PDOs were changed since the mapping of the group, or an SDO has written
    // PDO objects of the slave: config_map() is needed
    remapping_needed,
    scan_needed,      // expect() was called after config_init(): the slaves were compared with another list
    unknown_group,    // the group (index) is not mapped, or does not exist (expected: how many groups exist)
    image_too_large,  // the process image does not fit the buffer (expected, actual: octets)
    fmmu_shortage,    // the slave has too few FMMUs (expected, actual)
    sm_shortage,      // the slave does not have this SyncManager (index: its register, expected, actual: number of
                      // SyncManagers)
    sm_memory,        // a SyncManager is outside the slave's process data memory or overlaps another one (index: its
                      // register)
    too_many_frames,  // process data needs more frames than the context can prepare (expected, actual)
    mailbox_full,     // the slave accepts no mailbox message: its mailbox is full, or not enabled in this state
    wrong_size,       // a value has another size than requested (expected, actual: octets)
    pdo_list,     // a list of PDOs that is invalid for every slave (index: PDO or SyncManager's register, subindex: the
                  // entry, detail: PdoListFault)
    pdo_unknown,  // no source knows the entries of a listed or assigned PDO (index; expected: octets of the SII, used)
    not_process_sm,   // a list of PDOs for a mailbox SyncManager (index: its register)
    wrong_direction,  // an output PDO for an input SyncManager, or the reverse (index: the PDO)
    pdo_size,         // the PDOs have another size than the configuration gives their SyncManager (index: its register;
                      // expected, actual: bits)
    sizes_differ,  // a warning: two sources differ on the size of a SyncManager (index: its register; expected: bits in
                   // use, actual: bits of the other source; detail: both as ConfigurationSource, the one in use << 8)
    types_differ,  // a warning: object 0x1C00 (expected) and the SII (actual) differ on the SmType of a
                   // SyncManager (index: its register)
    above_highest,  // the slave's configuration does not allow the state (expected: the highest allowed, actual: the
                    // requested one)
    check_failed,   // a register or an object does not have the required value (expected, actual: 32 bits that differ)
    not_owner,      // the call is for the thread that owns the context, and another thread made it
    not_polled,     // the owner of the context has not called poll()
    waiting_forbidden,  // a function that waits, called by the owner after allow_waiting(ctx, false)
    in_callback,        // a function that waits or polls, called from a callback or hook of the library
    nic_busy,           // the NIC did not accept the datagram for LinkSettings::queue_timeout
    datagram_size,      // more data than a datagram can carry: it was not sent
    no_cycle,           // receive_processdata() was called, but no cycle is on the wire: send_processdata() was not
                        // called before it, or the cycle was received already
    mailbox_closed,  // the mailbox was closed while a message waited: the slave is in INIT, starts up, or was found by
                     // a new scan
    reply_lost,      // the slave's reply was lost on the wire, and the slave cannot repeat it
    entry_not_mapped,  // no exchanged PDO of the slave contains the entry (index, subindex; by place: index of the
                       // assignment object, subindex: number of the PDO in it, detail: number of the entry in the PDO)
    entry_direction,   // the entry is an input but an output was requested, or the reverse (place as above)
    entry_size,   // the type does not match the entry (place as above; expected: bits of the type, actual: bits of the
                  // entry)
    entry_type,   // the entry is a real number and the type is not, or the reverse (place as above; actual: CoE data
                  // type). Only entries whose data type is known are checked: see EntryValue in entry.hpp
    entry_stale,  // the group was mapped again since the entry was found
    other_state,  // the slave is not in its target state, or not in the state from which it can be brought to the
                  // requested one (expected: the state that is needed, actual: the present state)
    image_overlaps,      // the image of a group overlaps the image of another mapped group (index: that group)
    configuration_lost,  // a warning: `config` or `hooks` were set before the first scan or for a wrong number (slave
                         // 0), or for a slave of the scan before (slave), and are gone; or `config` of a group was
                         // set before init() or for a wrong number (detail: kOfGroup)
    place_unknown,   // a warning: the slave may be missing and is missing, and the sizes of its process data are not
                     // known (SlaveSetup::pdos), so that it has no place in the image: it can take part after the next
                     // config_map()
    not_supervised,  // no supervision is busy, and the states of all slaves were read more than a second ago
    group_left_out,  // the group is mapped, and the application has not exchanged it for a second (index: the group)
    start_up_unfinished,     // the slave is in its target state, and its commands or its hook after the transition have
                             // not ended, or were ended early (expected, actual: the state)
    no_clock,                // the slave has no clock that runs; slave 0: no slave has one
    clock_before_reference,  // a slave before the reference clock in the ring has a clock (expected: that slave)
    clock_not_reached,  // the reference clock does not synchronise the clock of the slave: it is behind the slave in
                        // the ring, or lost (detail: Error::kReferenceLost; expected: the slave with the reference)
    not_in_sync,        // a clock differs from the reference clock (expected: the limit, actual: the difference, ns)
    cabling,            // the two NICs of init_redundant() are connected wrongly (detail: CablingFault)
    supervised,  // the supervision keeps the slave in another state, see set_target() (expected: that state, actual:
                 // the requested one)
};

// The step of an operation at which the error occurred.
enum class Step : std::uint8_t {
    none,
    open_nic,
    wait_link,
    count_slaves,
    reset_slaves,
    assign_address,
    read_dl_information,
    read_sii,
    write_sii,
    parse_sii,
    configure_mailbox,
    request_state,
    read_state,
    discover_pdos,
    map_process_data,
    configure_process_data,
    exchange_process_data,
    mailbox_send,
    mailbox_receive,
    sdo_upload,
    sdo_download,
    sdo_information,
    soe_read,
    soe_write,
    soe_command,
    foe_read,
    foe_write,
    voe_send,
    voe_receive,
    aoe_read,
    aoe_write,
    aoe_read_write,
    aoe_write_control,
    aoe_read_state,
    aoe_device_info,
    aoe_notification,
    aoe_net_id,
    eoe_set_ip,
    eoe_get_ip,
    eoe_set_filter,
    eoe_get_filter,
    eoe_frames,
    read_register,
    write_register,
    topology,
    recover,
    identify,
    configure_pdos,
    // Commands of SlaveSetup::startup, by transition.
    command_ip,
    command_ps,
    command_so,
    command_os,
    command_op,
    command_oi,
    command_sp,
    command_si,
    command_pi,
    command_ib,
    command_bi,
    application_hook,
    supervise,
    configure_clocks,
    configure_sync,
    watch_latches,
    exchange_datagram,
};

// The kind of a request: an error names the operation that prevents another one.
enum class Operation : std::uint8_t {
    none,
    scan,
    map,
    supervise,
    reconfigure,
    recover,
    change_state,
    set_target,
    read_states,
    write_states,
    check_states,
    read_sii,
    write_sii,
    read_register,
    write_register,
    sdo_upload,
    sdo_download,
    sdo_information,
    mail_pdo,
    soe_read,
    soe_write,
    soe_command,
    foe_read,
    foe_write,
    raw_mail,
    voe_send,
    voe_receive,
    aoe,
    eoe_parameters,
    eoe_port,
    find_entry,
    configure_clocks,
    set_sync,
    watch_latches,
    exchange_datagram,
};

// One error. Unused members are 0.
struct Error {
    Errc code = Errc::none;
    Step step = Step::none;
    std::uint16_t slave = 0;    // the first slave is 1; 0: the segment as a whole
    std::uint16_t index = 0;    // register address, SII word address (bits 0 to 15), object index, IDN, or the group of
                                // a cycle, depending on the step
    std::uint8_t subindex = 0;  // subindex, or number of the drive; of an SII word address: bits 16 to 23; of a
                                // start-up command without index: the MailboxType of its message; of the check of a
                                // register: the octet from which `expected` and `actual` are
    std::uint8_t place = 0;    // number of a start-up command in its list, the first is 1; of an SII word address: bits
                               // 24 to 31
    std::uint32_t detail = 0;  // AL status code, abort code, mailbox error detail, SoE or FoE error code; k…Command
    std::uint32_t expected = 0;
    std::uint32_t actual = 0;

    // Bits of the detail of errors of start-up commands, beside the detail of the code (16 bits). kRegisterCommand:
    // `index` is a register address, not an object. kParameterCommand: `index` is an IDN, `subindex` a drive; it is not
    // set for soe_error and command_failed.
    static constexpr std::uint32_t kRegisterCommand = 0x1'0000;
    static constexpr std::uint32_t kParameterCommand = 0x2'0000;
    // Detail of Errc::no_frame: frames came back with incremented working counters, but without the mark that the first
    // ESC sets in the source address. The NIC cannot distinguish them from echoes of its own frames, so the library
    // dropped them.
    static constexpr std::uint32_t kUnmarked = 1;
    // Detail of Errc::working_counter from receive_processdata(): the missing slaves are known to be lost, and the
    // inputs of all other slaves are fresh.
    static constexpr std::uint32_t kOthersFresh = 1;
    // Detail of Errc::working_counter from receive_processdata(): config_map() is executing for the group.
    static constexpr std::uint32_t kBeingMapped = 2;
    // Detail of Errc::clock_not_reached: the slave with the reference clock is lost.
    static constexpr std::uint32_t kReferenceLost = 1;
    // Details of Errc::wrong_state from ApplicationTime: set() was not called; there is no result yet.
    static constexpr std::uint32_t kNoTime = 4;
    static constexpr std::uint32_t kNotBack = 5;
    // Detail of Errc::configuration_lost: it was the configuration of a group.
    static constexpr std::uint32_t kOfGroup = 1;
    // Detail of Errc::wrong_state from wait(): the request was not submitted.
    static constexpr std::uint32_t kNotSubmitted = 1;
    // Detail of Errc::timeout: the request has not begun. Added to it: the Operation that it waited for, 0: not known.
    static constexpr std::uint32_t kNotBegun = 0x10000;
    // Detail of Errc::capacity: kTasks: no memory for another operation (Limits::tasks, or Limits::arena_bytes);
    // kPlaces: no place for another request of another thread. kRedundancy: Limits::redundancy is false. 0: the step
    // determines which memory is full.
    static constexpr std::uint32_t kTasks = 1;
    static constexpr std::uint32_t kPlaces = 2;
    static constexpr std::uint32_t kRedundancy = 3;

    // The word address of an error of the steps read_sii, write_sii and parse_sii.
    [[nodiscard]] constexpr std::uint32_t word() const {
        return std::uint32_t{index} | std::uint32_t{subindex} << 16 | std::uint32_t{place} << 24;
    }
    constexpr void set_word(std::uint32_t word) {
        index = static_cast<std::uint16_t>(word);
        subindex = static_cast<std::uint8_t>(word >> 16);
        place = static_cast<std::uint8_t>(word >> 24);
    }

    friend constexpr bool operator==(const Error&, const Error&) = default;
};

// Errc::invalid_argument: which parameter is out of range.
enum class Argument : std::uint8_t {
    unknown,
    limit_slaves,  // members of Limits
    limit_frames,
    limit_groups,
    limit_process_frames,
    link_frame_timeout,  // members of LinkSettings
    link_queue_timeout,
    link_sendings,
    priority,  // members of Request
    timeout,
    period,  // members of CycleSettings
    reply_timeout,
    send_lead,
    interval,         // of a supervision, of latches or of an EoePort
    state,            // an AL state
    work,             // the function of run_cycle()
    sii_words,        // the words are beyond the end of the EEPROM
    sii_size,         // no octets, or an odd number of octets
    register_octets,  // no octets, too many octets, or octets beyond the last register
    complete_access,  // the subindex of a complete access
    soe_drive,        // the number of the drive
    mail_type,        // a mailbox protocol
    mail_size,        // the octets of a mailbox message (expected: the most that fit, actual: its octets)
    mail_listener,    // an object that must listen
    aoe_size,         // a length in an AoE command (expected: the most, actual: the length)
    eoe_filter,       // the numbers of addresses and masks of an EoE address filter
    eoe_port_memory,  // the memory of an EoePort is too small
    highest,          // members of SlaveConfiguration
    watchdog_time,
    sync_manager_count,
    sync_manager_twice,
    sync_manager_direction,
    sync_manager_of_mailbox,
    configuration_source,
    pdi_watchdog,  // members of SlaveTimes
    state_time,
    mailbox_time,
    command_transition,  // members of StartupCommand
    command_kind,        // or its moment
    command_time,
    command_value,
    image_start,  // members of GroupConfiguration
    packing,
    lost_inputs,
    cycles_in_flight,
    reserve_bytes,
    dc_reference,
    copy,  // SlaveToSlave
    entry_handle,
    empty_group,      // no slave belongs to the group (actual: its number)
    sync_cycle,       // members of SyncSettings
    clock_settings,   // members of ClockSettings
    file_name,        // the name of a file does not fit the mailbox
    file_time,        // a time of a FoeRequest
    sync_grid,        // ClockSettings::start_grid is no whole multiple of the cycle of the SYNC signals
    sync_start,       // a start of SYNC0 that has passed. actual: how often it was too late
    aoe_time,         // a time of an AoeAddNotification
    second_nic,       // the second NIC of init_redundant() is the first one
    image_place,      // SlaveSetup::place: it overlaps other data, or begins within an octet where that is not possible
    sdo_stream,       // an SdoStream without source or sink, or a size that CoE cannot announce
    look_every,       // MailListener::look_every, or the interval of watch_mailboxes()
    command_message,  // the message of a StartupCommand
    sync_pulse,       // the cycle of a SYNC signal is not longer than its pulse (SlaveClock::pulse_ns)
};

// Errc::cabling: what is wrong with the cables of two NICs.
enum class CablingFault : std::uint8_t { none, same_port, second_segment };

// Errc::other_slave: which property differs from the expected one.
enum class IdentityField : std::uint8_t { product, vendor, revision, serial, alias, device_id, hot_connect };
[[nodiscard]] std::string_view to_text(IdentityField field);

// Errc::pdo_list: why the list is invalid.
enum class PdoListFault : std::uint8_t {
    none,
    sync_manager_twice,  // two lists name one SyncManager
    too_many_pdos,       // more than 254 PDOs for one SyncManager
    pdo_twice,           // a PDO in two places
    no_pdo_index,        // neither 0x1600 to 0x17FF nor 0x1A00 to 0x1BFF
    too_many_entries,    // more than 254 entries in one PDO
    no_bits,             // an entry of 0 bits
};

// Codes that are reported in warnings(): no operation has failed, and the slave continues.
[[nodiscard]] constexpr bool is_warning(Errc code) {
    return code == Errc::sizes_differ || code == Errc::types_differ || code == Errc::configuration_lost ||
           code == Errc::place_unknown;
}

// The text of a code, a step or an operation. Static strings, callable from anywhere.
[[nodiscard]] std::string_view to_text(Errc code);
[[nodiscard]] std::string_view to_text(Step step);
[[nodiscard]] std::string_view to_text(Operation operation);

// Writes a sentence with slave, step and cause into `out` (cut if it does not fit, without a terminating zero) and
// returns the written part. No allocation; callable from the cycle.
std::string_view describe(const Error& error, std::span<char> out);

}  // namespace margay
