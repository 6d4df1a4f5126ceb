// The functions of the master. Each comment says whether the function may be called from a running cycle and whether it
// waits.
//
// Names. A service of a mailbox protocol begins with the protocol, in capitals but for SoE: SDOread(), SDOwrite(),
// SoEread(), SoEcommand(), FOEread(), AOEread(), EOEset_ip(), VOEsend(). Exceptions are raw_mail(), which is for any
// protocol, and the services of SDO information: read_object_list(). The functions that every master has keep their
// usual names: config_init(), config_map(), send_processdata(), receive_processdata(), readstate(), writestate(),
// statecheck(), configdc(), dcsync0(), dcsync01(). Every other function that does something is a verb with its object:
// read_register(), read_sii(), find_entry(), recover_slave(), set_target(); or a verb alone, if an argument is the
// object: submit(), listen(), expect(). A function that only returns what is known, or only computes, is named after
// its result: all_right(), inputs_fresh(), emergencies(), sii_checksum(), what_is_wrong(). A function that returns a
// StartupCommand writes nothing to a slave itself, and has the name of the work of this command (write_object(),
// startup.hpp). The requests of the usual functions are SdoUpload (SDOread()), SdoDownload
// (SDOwrite()), ScanRequest (config_init()), MapRequest (config_map()), ClockRequest (configdc()) and SyncRequest
// (dcsync0(), dcsync01()). Other requests have words of their function, or of their work, in CamelCase, most of them
// without the verb: read_object_list() and ObjectListRequest. A method of Context returns a part of the context. A
// method of HookedSlave begins with what it accesses: sdo_read().
//
// Numbers. `number` is the number of a slave, which config_init() gives and which stays until the next config_init().
// `position` is the place of a slave in the ring, and nothing else. The standard counts it from 0, with auto-increment
// addresses: so do RingPosition (address.hpp) and EniSlave::ring_position (files/eni.hpp). Slave::ring_position counts
// from 1; 0 means that the slave is not in the ring.
#pragma once

#include <margay/aoe.hpp>
#include <margay/clocks.hpp>
#include <margay/coe.hpp>
#include <margay/coe_stream.hpp>
#include <margay/context.hpp>
#include <margay/datagram.hpp>
#include <margay/entry.hpp>
#include <margay/eoe.hpp>
#include <margay/expected.hpp>
#include <margay/features.hpp>
#include <margay/foe.hpp>
#include <margay/hooked_slave.hpp>
#include <margay/mailbox.hpp>
#include <margay/registers.hpp>
#include <margay/request.hpp>
#include <margay/run.hpp>
#include <margay/shared_image.hpp>
#include <margay/sii.hpp>
#include <margay/soe.hpp>
#include <margay/startup_mail.hpp>
#include <margay/supervision.hpp>
#include <margay/voe.hpp>

namespace margay {

// Gives the context its NIC and its system functions. Call init() once, before all other functions. `nic` and `osal`
// must outlive the context. The calling thread becomes the owner of the context (request.hpp). Errors: invalid_argument
// (a limit or a link setting is out of range; detail: the Argument), wrong_state (init() was called before), capacity
// (the memory of the context is too small). `features` is for small systems: see features.hpp.
Result<> init(Context& ctx, Nic& nic, Osal& osal, const Features& features);
inline Result<> init(Context& ctx, Nic& nic, Osal& osal) { return init(ctx, nic, osal, kAllFeatures); }

// Does the work of the master: processes the frames that the NIC has received, resumes all busy requests, and sends the
// frames that are due. Returns the latest time at which poll() must be called again; kNever: only a new frame or a new
// request needs the next call. Never waits; callable from the cycle, by the owner of the context only. `now` is the
// time of the osal and must never go backwards. An error is added to errors(): not_owner, in_callback (called from a
// callback or hook).
Time poll(Context& ctx, Time now);

// Waits for the link, counts the slaves, and assigns station addresses from 0x1001 on. Reads the ESC registers and the
// SII of each slave, finds the topology, configures the mailboxes and brings all slaves to PREOP. Works on all slaves
// at the same time. Returns the number of slaves. Waits.
//
// Success means: every wanted slave is present, its identity is the expected one and could be read, and the slave is in
// PREOP. An error of one slave does not stop the other slaves: config_init() finishes all work that is possible, and
// then returns the error of the first failed slave (error().slave is the number of that slave, not 0). All errors are
// in errors() and in slave(n).error. slaves() and all other calls can be used then: the application decides whether to
// continue. Such errors are:
// - missing_slave;
// - other_slave: another slave than the expected one;
// - unsupported: a device id is expected, and the slave reports none;
// - unexpected_slave: expect() has a list, and the slave is not in the list;
// - every error of the start-up of a slave.
//
// Differences that the application tolerates (tolerate(), ExpectedSlave::tolerate) are reported in errors() only;
// config_init() does not fail for them. The same is true of these problems of a slave that reaches PREOP nevertheless:
// an SII that is blank, truncated, contradictory or has a wrong checksum; an explicit device id that is not expected
// and cannot be read; a topology that does not agree with the DL status.
//
// Errors of the whole segment have slave 0, and there are no slaves then: link_down, no_frame, no_slaves, unstable,
// capacity (the slaves that were found and the expected slaves that are missing are more than limits().slaves;
// expected: how many there are).
//
// A second call scans the segment again; no slave must be switched off for it. Slave numbers, hooks and configurations
// start again from their initial values. End a SuperviseRequest before the call, and map the groups again after it.
Result<std::uint16_t> config_init(Context& ctx);

// The progress of the ScanRequest that is busy; after its end, the result of the last scan. All numbers are 0 until the
// slaves have been counted. A slave with an error counts too: the scan has ended for that slave. Never waits; callable
// by the owner of the context only, also between the calls of poll() that execute the request.
struct ScanProgress {
    std::uint16_t slaves = 0;      // slaves in the ring
    std::uint16_t identified = 0;  // of them, the slaves whose ESC registers and SII have been read
    std::uint16_t started = 0;     // of them, the slaves in PREOP, and the slaves that stay in INIT
};
[[nodiscard]] ScanProgress scan_progress(Context& ctx);

// Sets the list of slaves that the next config_init() is to find: their identity, their numbers and their configuration
// (see ExpectedSlave). An empty list: every slave is accepted. When the slaves were scanned already, they have not been
// compared with the list: config_map() and reach() fail with scan_needed until config_init() has been called.
// Slaves that differ from the list are held (see Tolerance). `slaves` is the caller's memory and must live until the
// end of the config_init() that follows the next expect(). Never waits. Errors: wrong_state before init(), not_owner,
// invalid_argument (an entry has no number, alias or device id; two entries have the same number; the members of a hot
// connect group are not neighbours; actual: the number of the entry).
Result<> expect(Context& ctx, Borrowed<ExpectedSlave> slaves);

// Clears slave(n).error, so that the next error of the slave is kept there; slave 0: of all slaves. The errors in
// errors() stay. Never waits; callable from the cycle. Errors: wrong_state before init(), not_owner, unknown_slave.
Result<> clear_error(Context& ctx, std::uint16_t slave);

// Configures the process data of one group and brings its slaves from PREOP to SAFEOP, all at the same time:
// 1. Calls the hook preop_to_safeop of each slave.
// 2. Writes the PDOs that the configuration of the slave requires.
// 3. Finds the process data that each slave exchanges (slave(n).config). The first source that knows it is used: the
//    application, a file, the object dictionary, the parameters of the drives (SoE), the SII. Differences between the
//    sources are reported in warnings().
// 4. Assigns each slave its part of `image` (slave(n).image), and writes SyncManagers and FMMUs.
// 5. Finds and checks the entries of GroupConfiguration::entries.
//
// Returns how many octets of the image are used. `image` is the caller's memory, must live as long as process data is
// exchanged, and is set to zero. Waits.
//
// Success means: every wanted slave of the group is in SAFEOP, or in the lower state that its configuration or
// set_target() requires. config_map() does for all slaves what can be done, and then returns the error of the first
// failed slave. slave(n).error has the first error of each slave; errors() has them too, each missing or held slave
// once since the scan. group(n).mapped says whether process data can be exchanged without the failed slaves. While a
// mapping executes, cycles of its group are not right (working_counter). Such errors are:
// - missing_slave, other_slave, unexpected_slave: held or missing slaves of this group (an unexpected slave belongs to
//   group 0);
// - every error of the slave's hook, of the search for its PDOs, or of its configuration;
// - unknown_group: slave(n).config names a group that does not exist (index: the group);
// - invalid_argument: a value in slave(n).config or its SlaveSetup that no slave can have (detail: the Argument; of a
//   start-up command actual: the Argument, place: its number in the list);
// - invalid_argument: the slave leaves another mapped group, and a copy of that group names it (detail: copy).
//   The copy is not executed any more, and the outputs of its destination stay as they are. what_is_wrong() says so
//   until GroupConfiguration::copies is changed;
// - no_place: the slave could not be read before the image was laid out, and has appeared since;
// - remapping_needed: slave(n).config.sms, or the lists of its PDOs, were changed while config_map() executed. Where a
//   slave has another revision than when its process data was read (new firmware writes it into the EEPROM some time
//   after its start), config_map() itself maps the group again, with all hooks, up to four times in all; the error then
//   means that the revision has changed each time;
// - of an entry: entry_not_mapped, entry_direction, entry_size, entry_type, unknown_slave.
//
// A slave that cannot be asked (because it is missing, held, or does not answer) keeps its part of the image if its
// sizes are known: by slave(n).config.sms, or by SlaveSetup::pdos if these lists name all entries. Expected working
// counters count every wanted slave: while one of them does not take part, receive_processdata() returns an error.
//
// Errors of the call itself, which are not in errors(): wrong_state (no slaves yet), unknown_group (limits().groups),
// scan_needed (expect() was called after config_init()).
// Errors of the whole group, after which no slave of the group is mapped: invalid_argument (a value in group(n).config;
// a SyncManager twice in slave(n).config; no slave belongs to the group, which reads no register either; detail: the
// Argument), image_too_large, image_overlaps (index: the other group), fmmu_shortage, sm_shortage, sm_memory,
// too_many_frames (limits().process_frames), unknown_slave (of a copy, or dc_reference), capacity (the memory of the
// SharedImage), clock_before_reference (slave: the reference, expected: a slave with a clock before it in the ring),
// unsupported (cycles_in_flight is 2 or more in a context without that feature).
Result<std::size_t> config_map(Context& ctx, std::span<std::byte> image, std::uint8_t group = 0);

// Plans the frames of a mapped group again, because group(n).config.block_lrw was changed: from the next
// send_processdata() on they have LRW, or LRD and LWR. Slaves, image and logical addresses stay as they are, in any AL
// state. A cycle that is on the wire is lost; group(n).datagrams and expected_wkc have new values. Callable from the
// cycle, where it does not wait or allocate: its time grows with the number of slaves. After an error the frames of the
// group are the same as before the call. Errors: wrong_state before init(), not_owner, unknown_group (also: the group
// is not mapped), busy (config_map() executes for the group), unsupported (cycles overlap), invalid_argument
// (cycles_in_flight is 0), too_many_frames (limits().process_frames), remapping_needed (the configuration of a slave
// was changed: call config_map()).
Result<> replan_processdata(Context& ctx, std::uint8_t group = 0);

// AL states. The three functions update or use slave(n).al: the state that the slave reports, its error indication and
// its AL status code. A slave that does not answer has state NONE. The functions wait; beside a running cycle submit
// the requests of the same names.
//
// readstate() reads the AL status of all slaves and returns the lowest state, with the error indication if any slave
// has it. Missing slaves that are optional or tolerated do not count. A slave whose configuration does not allow a
// higher state (SlaveConfiguration::highest) does not lower the result once it has reached that state. Where no
// supervision is busy, readstate() and statecheck() compare the identity of a slave that was away, too. readstate()
// compares the identities of all slaves when another machine may be there: since the last reading, ten or more frames
// in succession did not come back; the application has sent no cycle and read no states for more than a second; or the
// cycles of a group were right, fell short and are right again. Errors: wrong_state (no slaves yet), unstable (a scan
// has begun meanwhile), other_slave, identity_unread (another request uses the slave, and has not compared it yet; or
// the slave is in BOOT and was away, and mail to it is under way or its firmware uses the EEPROM), the errors of
// reading the register and the identity.
//
// writestate() requests a state from one slave, or from all slaves (slave 0), each at most up to the highest state that
// it is allowed. It reads the state of each slave, executes the start-up commands and the hook before the transition,
// and acknowledges an error that the slave indicates. It does not wait for the new state. A call that is repeated while
// the slave is on its way to the state requests the state again, and nothing else. For SAFEOP and OP it returns the
// error of the first slave that is held or missing, whose hook or PDOs have failed, or whose commands or hook after the
// last transition have failed or were ended (start_up_unfinished, if there is no other error); the request is sent to
// the other slaves nevertheless. other_state: a slave that enters every state by itself (device emulation) would leave
// out the commands and hooks of an intermediate state; request the states one by one. When a slave has made an earlier
// transition and no function has read its new state yet, the commands and the hook after that transition are executed
// first. While a supervision keeps another state, writestate() fails with Errc::supervised: use set_target(). On the
// way from INIT to PREOP, the library writes only the SyncManagers of the mailboxes of a slave with a mailbox. Such a
// slave then refuses SAFEOP: after INIT, use set_target() or reconfigure_slave() in place of writestate() to bring it
// to SAFEOP and OP.
//
// The commands and the hook after the transition begin when readstate(), statecheck() or the supervision reads the new
// state, whichever is first. They continue during all later calls of poll(). As long as they execute, other
// requests that need the slave, or the whole segment, wait. When they have executed for 10 s, such a request ends them:
// errors() has a timeout of the hook, or start_up_unfinished where commands were ended. The same holds for a hook that
// the supervision executes.
//
// statecheck() reads all slaves until `slave`, or all slaves (0), are in `state` without error and their commands and
// hooks after the transition have ended, or until `timeout` is over (zero: reads once). Returns the status that it has
// read last. A timeout is no error: compare the returned state. But these causes are an error: other_slave (another
// device answers in the place of the slave), and start_up_unfinished (the state is reached, and commands or hooks after
// the transition have not ended), each of the first such slave; and wrong_state, unstable and identity_unread, as for
// readstate().
Result<AlStatus> readstate(Context& ctx);
Result<> writestate(Context& ctx, std::uint16_t slave, AlState state);
Result<AlStatus> statecheck(Context& ctx, std::uint16_t slave, AlState state, Duration timeout);

// Bring back slaves by hand; a SuperviseRequest does both by itself.
//
// reconfigure_slave() repeats the whole start-up, from INIT on, of a slave that answers at its station address:
// mailboxes, start-up commands, hook, process data. The slave ends in SAFEOP, or in PREOP if its group is not mapped or
// its target is below SAFEOP. A held slave ends in PREOP or INIT, with the error other_slave or unexpected_slave.
//
// recover_slave() finds slaves that have lost their station address, for example after a loss of power, and assigns the
// address to them again. With slave 0 it succeeds if it found at least one slave. With another number it succeeds if
// that slave answers now. The identity of a slave that was away is compared. Errors: missing_slave (the slave does not
// answer; slave 0: no lost slave was found), unknown_slave (no slave has this number), other_slave (another slave is in
// its place), unstable (the ring has changed during the search), no_frame, capacity.
//
// Both wait.
Result<> reconfigure_slave(Context& ctx, std::uint16_t slave);
Result<> recover_slave(Context& ctx, std::uint16_t slave);

// Sends the outputs of a group's image in the frames that config_map() has prepared, and queued datagrams in the space
// that is left (GroupConfiguration::acyclic_bytes). Callable from the cycle: never waits, does not allocate. Errors:
// wrong_state before init(), not_owner, unknown_group (the group is not mapped), nic (the NIC did not accept a frame:
// its inputs are old from now on, with or without a receive_processdata(); see inputs_fresh()), busy (see below:
// overlapping cycles).
//
// The overload with `now`, the time of the osal, is for a task that has already read the clock.
Result<> send_processdata(Context& ctx, std::uint8_t group = 0);
Result<> send_processdata(Context& ctx, Time now, std::uint8_t group = 0);

// Receives the frames of the last send_processdata(). Returns as soon as all frames have come back; frames that have
// not come back after `timeout` are lost. Copies inputs into the image, one datagram after the other, and each only if
// its working counter is the expected one; otherwise the image keeps the old inputs. Returns the sum of the working
// counters of all datagrams. group(n).datagrams has the result of each datagram. Callable from the cycle; waits for
// `timeout` at most. Other frames that arrive are kept for poll(), which is to be called between cycles. Errors:
// - wrong_state before init(), not_owner.
// - unknown_group: the group does not exist or is not mapped.
// - invalid_argument: `timeout` is negative, and the frames are not back yet or cycles overlap. The cycle stays on the
//   wire.
// - no_cycle: nothing was sent since the last receive_processdata(). The image is unchanged.
// - no_frame (actual: the number of frames that did not come back): the inputs of these frames are old. Machines may be
//   exchanged while no frame comes back: a supervision compares the slaves afterwards; without a supervision, call
//   readstate().
// - working_counter (expected, actual): a slave did not take part; or a slave that was away answers again, and its
//   identity was not compared yet (slave: this one; then expected and actual may be equal). With detail
//   Error::kOthersFresh, every slave that did not take part is known to be lost (by readstate() or the supervision;
//   slave: one of them), and the inputs of all other slaves are fresh: the application may continue without the lost
//   slaves. Without this detail it is not yet known which slave is missing, and the inputs of whole datagrams are old:
//   inputs_fresh() says which slaves have old inputs.
//   The same error is returned, although the working counter is that of the known slaves, in this case: a slave is
//   missing (also an optional one) or exchanges no process data (its target is below SAFEOP, or BOOT), and the working
//   counter has changed or a cycle was lost. One slave may have left while another one has come, so the inputs are old.
//   poll() then reads the states of the slaves that take part, unless readstate() or the supervision does so. The
//   inputs are fresh again after about four cycles and the cycles in flight. It takes longer while frames are lost,
//   while the working counter changes again, and while a slave is on its way to another state. If a slave does not
//   answer, the inputs stay old until readstate() or the supervision has found the slave lost.
//   One case is not detected: between the same two cycles some slaves leave, and other slaves with the same shares of
//   the working counter come, so that the counter does not change. For example, cables are plugged into other places
//   while the machines run. A slave that comes was missing before: it was cut off and has kept its power, or it is
//   started up again at that time. Then inputs_fresh() is true for the slaves that have left, although their inputs are
//   old, until the states are read: with a supervision for SuperviseRequest::interval and some cycles, otherwise until
//   readstate(). Where no slave is missing, the device that comes can only be a device that was the leaving slave
//   before and has kept its power, its station address and its FMMUs. Its inputs are used as inputs of the slave until
//   the identities are compared.
//
// Overlapping cycles (GroupConfiguration::cycles_in_flight is 2 or more): the next cycle can be sent while earlier
// cycles are still on the wire. Each receive_processdata() ends the oldest cycle and copies its inputs into the image.
// group(n).cycle_received is the number of that cycle. `timeout` counts from the sending of the cycle or from the call,
// whichever is later. Each send_processdata() begins one cycle that must be received, also if it returns nic, except if
// it returns busy (cycles_in_flight cycles are on the wire already; expected: that number). If no cycle is on the wire,
// receive_processdata() waits for one; error: timeout.
//
//     send_processdata(ctx);
//     for (;;) {
//         … outputs …; send_processdata(ctx);
//         receive_processdata(ctx, timeout); … inputs of the cycle before …
//     }
//
// One other thread may call send_processdata() for such a group, and no other function, while the owner of the context
// receives, polls and makes all other calls. The NIC and the osal must allow that (oshw/nic.hpp). Outputs in the image
// then belong to the sending thread, inputs to the owner. Copies from slave to slave (GroupConfiguration::copies) need
// one thread for both. No thread may send such a group while config_map() runs for it, or while the context is
// destroyed.
Result<std::uint32_t> receive_processdata(Context& ctx, Duration timeout, std::uint8_t group = 0);

// Whether the inputs of this slave in the image come from the last received cycle: the slave takes part, and all
// slaves that take part did so in every datagram that carries inputs of this slave. For a slave that has only outputs:
// the same for the datagrams of its outputs. False before the first cycle, for an unknown slave, and for a slave that
// has no process data or no place in the image. False after a send_processdata() whose frame with these inputs was
// refused (overlapping cycles: when that cycle is received). False from the moment when the slave is known to be lost
// until it takes part again and its identity was compared; GroupConfiguration::lost_inputs decides what its inputs are
// meanwhile. For the thread that receives; callable from the cycle, costs a few instructions for each datagram of the
// group. receive_processdata() names the one case in which inputs are shown as fresh although their slave has left.
[[nodiscard]] bool inputs_fresh(Context& ctx, std::uint16_t slave);

// Datagram `n` of a mapped group, in the order of group(number).datagrams. Never waits; callable from the cycle.
[[nodiscard]] PlannedDatagram process_datagram(Context& ctx, std::size_t n, std::uint8_t group = 0);

// Read and write the SII EEPROM of a slave by word address (see SiiReadRequest and SiiWriteRequest). Both functions
// wait. Word 7 has the checksum of the words 0 to 6 in its low octet: a program that writes one of these words also
// writes word 7, see sii_checksum(). With a wrong checksum the ESC does not load its configuration at the next
// power-up.
Result<> read_sii(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<std::byte> data);
Result<> write_sii(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<const std::byte> data);

}  // namespace margay
