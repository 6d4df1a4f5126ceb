// What went wrong, where and why. An Error is a plain value of a few words; describe() puts it into a sentence.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

// The kind of failure.
enum class Errc : std::uint8_t {
    none,
    timeout,           // no final answer within the time allowed
    no_frame,          // a frame did not come back, retries included (detail: 0, or Error::kUnmarked)
    working_counter,   // a frame came back but not everyone addressed took part (expected, actual; of a cycle detail:
                       // 0, or Error::kOthersFresh)
    link_down,         // the NIC reports no carrier
    nic,               // the NIC refused to send (actual: the system's error number)
    capacity,          // a buffer or table that the caller sized is full (expected: needed, actual: available)
    no_slaves,         // nobody answered a broadcast
    unstable,          // the number of slaves changed while it was being counted (expected, actual)
    unknown_slave,     // no slave at this position
    invalid_argument,  // a parameter outside its range (of expect(): actual: the entry of the list, 1 the first)
    wrong_state,       // the call does not fit the state of the context or of the slave (expected, actual)
    busy,              // another operation is in the way (detail: the Operation, 0: the request itself)
    canceled,          // given up by the caller
    al_status,         // the slave refused a state change (expected state, actual state, code: AL status code)
    sii_busy,          // the SII interface stayed busy
    sii_nack,          // the EEPROM did not acknowledge, retries included
    sii_verify,        // what was read back is not what was written (expected, actual)
    sii_checksum,      // CRC of the configuration area (expected, actual)
    sii_blank,         // the EEPROM is erased (all 0xFF)
    sii_truncated,     // content ends before its own description says so
    sii_format,        // content that contradicts itself
    sii_write_denied,  // EEPROM refused the write (write enable missing)
    protocol,          // a reply that the standard does not allow
    mailbox_error,     // mailbox error reply (code: detail code, ETG.1000.6 table "Mailbox error reply")
    sdo_abort,         // SDO abort (code: the abort code)
    soe_error,         // error reply of a drive (code: the SoE error code)
    command_failed,    // a procedure command of a drive ended with an error (code: its data state)
    unsupported,       // the slave does not have it
    other_slave,    // another slave than expected (subindex: what differs, see IdentityField; expected, actual; detail:
                    // vendor that is there)
    missing_slave,  // an expected slave is not there (subindex: by what it would have been known, alias or device_id,
                    // and actual: that)
    unexpected_slave,  // a slave that nobody expects
    no_place,          // a slave that came later has process data, and none was kept free in the image (expected: bits)
    unknown_group,     // no group with this number, or nothing is mapped in it (index: the group)
    image_too_large,   // the process image does not fit the buffer (expected, actual: octets)
    fmmu_shortage,     // the slave has too few FMMUs (expected, actual)
    sm_shortage,       // the slave has no such SyncManager (index: its register, expected, actual: how many)
    sm_memory,  // a SyncManager outside the slave's process data memory or on top of another one (index: its register)
    too_many_frames,  // process data needs more frames than the context has prepared ones (expected, actual)
    mailbox_full,     // the slave does not take mail: its mailbox is full, or not enabled in this state
    wrong_size,       // a value has another size than was asked for (expected, actual: octets)
    pdo_list,         // a list of PDOs that no slave can have (index: PDO or SyncManager's register, subindex: the
                      // entry, detail: PdoListFault)
    pdo_unknown,      // nobody tells what a PDO of a list has in it (index: the PDO)
    not_process_sm,   // a list of PDOs for a SyncManager of the mailbox (index: its register)
    wrong_direction,  // a PDO of outputs at a SyncManager of inputs, or the reverse (index: the PDO)
    pdo_size,         // PDOs have other bits than their SyncManager is given (index: its register; expected, actual)
    sizes_differ,     // a warning: two sources differ on a SyncManager (index: its register; expected: bits that
                      // count, actual: the others; detail: ConfigurationSource of both, that which counts << 8)
    types_differ,     // a warning: object 0x1C00 (expected) and the SII (actual) differ on the SmType of a
                      // SyncManager (index: its register)
    above_highest,    // a state that the slave's configuration rules out (expected: what it allows, actual: asked for)
    check_failed,     // a register is not as a command wants it (expected, actual: the lowest 32 bits)
    not_owner,        // a call that is for the thread that owns the context, from another thread
    not_polled,       // the owner of the context has not called poll()
    waiting_forbidden,  // a call that waits, in the thread of the owner, after allow_waiting(ctx, false)
    in_callback,        // a call that waits or polls, from a callback or hook of the library
    nic_busy,           // the NIC did not take the datagram for LinkSettings::queue_timeout
    datagram_size,      // more data than a datagram can carry: it was not sent
    no_cycle,           // receive_processdata() without a cycle that was sent and not received yet
    mailbox_closed,     // the mailbox was closed while a message waited: the slave is started or found anew
    reply_lost,         // the slave's reply was lost on the wire, and the slave does not have it any more
    entry_not_mapped,   // no PDO of the slave that is exchanged has the entry (index, subindex; by position: index of
                        // the assignment object, subindex: which PDO in it, detail: which entry of the PDO)
    entry_direction,    // the entry is an input where an output is wanted, or the reverse (place as above)
    entry_size,         // the entry does not fit the type (place as above; expected: bits of the type, actual: bits)
    entry_type,         // the entry is a real number and the type is not, or the reverse (place as above; actual: CoE
                        // data type)
    entry_stale,        // the group was mapped again since the entry was found
    other_state,        // the slave is not in the state that is wanted (expected: that state, actual: the state it has)
    image_overlaps,     // the image of a group overlaps the image of another mapped group (index: that group)
    configuration_lost,  // a warning: `config` or `hooks` that were written before a scan do not outlive it
    supervised,  // the supervision keeps the slave in another state, see set_target() (expected: that state, actual:
                 // asked for)
};

// What was being done.
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
};

// What a request does: so that an error can name the operation that is in the way.
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
    find_entry,
};

struct Error {
    Errc code = Errc::none;
    Step step = Step::none;
    std::uint16_t slave = 0;    // 1 is the first slave, 0 the segment as a whole
    std::uint16_t index = 0;    // register address, SII word address, object index or IDN, as the step has it
    std::uint8_t subindex = 0;  // or the number of the drive
    std::uint8_t place = 0;     // of a command in its list, 1 the first
    std::uint32_t detail = 0;   // AL status code, abort code, mailbox error detail, SoE error code; k…Command
    std::uint32_t expected = 0;
    std::uint32_t actual = 0;

    // Detail of what went wrong with a command for a register: `index` is no object.
    static constexpr std::uint32_t kRegisterCommand = 1;
    // The same: `index` is an IDN, `subindex` a drive.
    static constexpr std::uint32_t kParameterCommand = 2;
    // Detail of Errc::no_frame: frames came back with working counters counted up, but without the mark that the first
    // ESC sets in the source address. The NIC cannot tell them from echoes of own frames, so they were dropped.
    static constexpr std::uint32_t kUnmarked = 1;
    // Detail of Errc::working_counter from receive_processdata(): the slaves that are missing are known to be lost, and
    // the inputs of all other slaves are fresh.
    static constexpr std::uint32_t kOthersFresh = 1;
    // Detail of Errc::capacity: no memory for another operation (Limits::tasks); no place for another request of
    // another thread. 0: the step tells which memory it is.
    static constexpr std::uint32_t kTasks = 1;
    static constexpr std::uint32_t kPlaces = 2;

    friend constexpr bool operator==(const Error&, const Error&) = default;
};

// Errc::other_slave: what about it is not as expected.
enum class IdentityField : std::uint8_t { product, vendor, revision, serial, alias, device_id };

// Errc::pdo_list: why a slave cannot have the list.
enum class PdoListFault : std::uint8_t {
    none,
    sync_manager_twice,  // two lists for one SyncManager
    too_many_pdos,       // more than 254 PDOs for one SyncManager
    pdo_twice,           // a PDO in two places
    no_pdo_index,        // neither 0x1600 to 0x17FF nor 0x1A00 to 0x1BFF
    too_many_entries,    // more than 254 entries in one PDO
    no_bits,             // an entry of 0 bits
};

// Codes that are reported in warnings(): nothing has failed, and the slave goes on.
[[nodiscard]] constexpr bool is_warning(Errc code) {
    return code == Errc::sizes_differ || code == Errc::types_differ || code == Errc::configuration_lost;
}

// The kind and the step in words. Static strings, callable from anywhere.
[[nodiscard]] std::string_view to_text(Errc code);
[[nodiscard]] std::string_view to_text(Step step);
[[nodiscard]] std::string_view to_text(Operation operation);

// Writes one sentence naming slave, step and cause into `out` (cut where it does not fit, never terminated by
// a zero) and returns the part that was written. No allocation; callable from the cycle.
std::string_view describe(const Error& error, std::span<char> out);

}  // namespace margay
