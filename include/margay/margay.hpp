// Margay: the functions. Each says whether it may be called from a running cycle; a function that waits says so.
#pragma once

#include <margay/coe.hpp>
#include <margay/context.hpp>
#include <margay/entry.hpp>
#include <margay/expected.hpp>
#include <margay/registers.hpp>
#include <margay/request.hpp>
#include <margay/shared_image.hpp>
#include <margay/soe.hpp>
#include <margay/supervision.hpp>

namespace margay {

// Gives the context its NIC and its system. Both outlive the context. To be called once, before anything else;
// Errc::invalid_argument when the limits are out of range.
Result<> init(Context& ctx, Nic& nic, Osal& osal);

// The heart: takes in what the NIC has received, lets every busy request go on, sends what is due, and returns the time
// at which it wants to be called again at the latest (kNever: only for a new frame or request). Never waits; callable
// from the cycle. `now` is the time of the osal and never goes backwards.
Time poll(Context& ctx, Time now);

// Starts a request. Errc::busy when it runs already, Errc::capacity when there is no room for another one (nothing has
// happened then), Errc::wrong_state before init(). Callable from the cycle.
Result<> submit(Context& ctx, ScanRequest& request);
Result<> submit(Context& ctx, SiiReadRequest& request);
Result<> submit(Context& ctx, SiiWriteRequest& request);
Result<> submit(Context& ctx, StateRequest& request);
Result<> submit(Context& ctx, MapRequest& request);
Result<> submit(Context& ctx, ReadStateRequest& request);
Result<> submit(Context& ctx, WriteStateRequest& request);
Result<> submit(Context& ctx, StateCheckRequest& request);
Result<> submit(Context& ctx, SuperviseRequest& request);
Result<> submit(Context& ctx, ReconfigRequest& request);
Result<> submit(Context& ctx, RecoverRequest& request);

// Polls until a submitted request is not busy any more, and returns its error if it has one. While another thread runs
// a cycle that one polls, and this one only looks. Waits.
Result<> wait(Context& ctx, Request& request);

// Waits for link, counts the slaves, gives them station addresses from 0x1001 on, reads what the ESCs and the SIIs say,
// finds the topology, configures the mailboxes and brings all slaves to PREOP, all at once. Returns how many slaves
// there are. What goes wrong with a single slave does not stop the others: it is in slave(n).error and in errors().
// Waits. Errors: link_down, no_frame, no_slaves, unstable, capacity (more slaves, with those that are expected, than
// limits().slaves; expected says how many). Called again it scans anew, whoever is there now, without anything being
// switched off: end a SuperviseRequest before, and map the groups again; numbers, hooks and configurations begin anew
// too.
Result<std::uint16_t> config_init(Context& ctx);

// Says which slaves the next config_init() shall find, how they are numbered and with what each shall be configured:
// see ExpectedSlave. An empty list: whatever is there. What is not as expected is an error of that slave (other_slave,
// unsupported: it tells no device id, unexpected_slave), what is missing one in errors() (missing_slave); the others go
// on. `slaves` is the caller's memory and must live until the config_init() after the next expect(). Errors:
// wrong_state before init(), invalid_argument (known by nothing, two at one position, a group torn apart; actual:
// which).
Result<> expect(Context& ctx, std::span<const ExpectedSlave> slaves);

// Calls the slaves' hooks, makes the slaves' PDOs what their configuration wants, finds out what process data each
// slave of the group exchanges (slave(n).config: by the application, else a file, else its object dictionary, else the
// parameters of its drives, else its SII; that these differ is told in errors() as a warning), lays it into `image`
// (slave(n).image), writes SyncManagers and FMMUs and brings the slaves from PREOP to SAFEOP, all at once. Returns how
// many octets of the image are used. `image` is the caller's and must live as long as process data is exchanged; it is
// set to zero. What goes wrong with a single slave does not stop the others: it is in slave(n).error and in errors().
// Entries of GroupConfiguration::entries are found and checked; with one
// that is not mapped, or not as its type wants it, the call ends with that error (entry_not_mapped, entry_direction,
// entry_size, entry_type) when all else is done. Waits. Errors: wrong_state (no slaves yet), unknown_group,
// image_too_large, fmmu_shortage, sm_shortage, sm_memory, too_many_frames (limits().process_frames).
Result<std::size_t> config_map(Context& ctx, std::span<std::byte> image, std::uint8_t group = 0);

// States. All three refresh or use slave(n).al: the state that the slave itself reports, its error indication and AL
// status code; a slave that does not answer is in state NONE. Wait; beside a running cycle submit the requests of the
// same names.
//
// readstate() reads all slaves and returns the lowest state, with the error indication if any slave has one; slaves
// that are where their configuration lets them go at the highest do not lower it. writestate() executes the commands
// and the hook before the transition from the state that was read last, requests a state of one slave or of all (slave
// 0; of each no more than it is allowed), and acknowledges an error that the last reading has found; it does not wait
// for the state. What comes after the transition is done by whichever of the other two, or the supervision, sees it
// first. statecheck() reads all slaves until the one, or all, are in `state` without error, or `timeout` is over, and
// returns what it read last: that is no error, look at it.
Result<AlStatus> readstate(Context& ctx);
Result<> writestate(Context& ctx, std::uint16_t slave, AlState state);
Result<AlStatus> statecheck(Context& ctx, std::uint16_t slave, AlState state, Duration timeout);

// Bringing slaves back by hand; a SuperviseRequest does both by itself. reconfig_slave() goes through the whole
// start-up of a slave that answers at its station address, from INIT on: mailboxes, start-up lists, hook, process data;
// to SAFEOP, or PREOP where its group is not mapped. recover_slave() finds slaves that are back without their station
// address, as after a loss of power, and gives it to them; with `slave` 0 it returns whether any was found, else
// whether that one answers now: Errc::unknown_slave when it does not, other_slave when another one is in its place.
// Wait.
Result<> reconfig_slave(Context& ctx, std::uint16_t slave);
Result<> recover_slave(Context& ctx, std::uint16_t slave);

// The cycle. send_processdata() sends the outputs of a group's image in the frames that config_map() has prepared, and
// queued datagrams in the space that is left (GroupConfiguration::acyclic_bytes). Callable from the cycle: never waits,
// does not allocate. Errors: unknown_group (nothing mapped), nic (a frame was not taken).
//
// With `now`, the time of the osal, for a task that has read its clock already.
Result<> send_processdata(Context& ctx, std::uint8_t group = 0);
Result<> send_processdata(Context& ctx, Time now, std::uint8_t group = 0);

// Takes in the frames of the last send_processdata(): returns as soon as all are back, and gives up those that are not
// back after `timeout`. Inputs go into the image datagram by datagram, each only if its working counter is the expected
// one; otherwise the old ones stay. Returns the working counter of all datagrams together. group(n).datagrams tells of
// each. Errors: unknown_group; no_frame (actual: frames that did not come back); working_counter (expected, actual;
// slave: one that is known to be lost, as soon as readstate() has found it). What else comes in waits for poll(), which
// is to be called between cycles.
//
// Cycles may overlap (GroupConfiguration::cycles_in_flight, 2 or more): the next one is sent while others are on their
// way, and each receive_processdata() ends the oldest of them, waiting `timeout` for it since it was sent or since the
// call, whichever is later. group(n).cycle_received says which one that was. Inputs go into the image then and not
// before. Each send_processdata() that does not end with busy (all are on their way; expected: how many) is a cycle to
// be received. Without one to be received receive_processdata() waits for one: timeout.
//
//     send_processdata(ctx);
//     for (;;) {
//         … outputs …; send_processdata(ctx);
//         receive_processdata(ctx, timeout); … inputs of the cycle before …
//     }
//
// One other thread may call send_processdata() for such groups, and nothing else, while the owner of the context
// receives, polls and calls all the rest. NIC and osal have to allow that (oshw/nic.hpp). Outputs in the image are the
// sending thread's then, inputs the owner's; copies from slave to slave (GroupConfiguration::copies) want one thread.
// While config_map() runs for such a group, and when the context ends, nobody sends it.
Result<std::uint32_t> receive_processdata(Context& ctx, Duration timeout, std::uint8_t group = 0);

// Reads and writes the SII EEPROM of a slave by word address; see SiiReadRequest and SiiWriteRequest. Wait.
Result<> eeprom_read(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<std::byte> data);
Result<> eeprom_write(Context& ctx, std::uint16_t slave, std::uint32_t word, std::span<const std::byte> data);

}  // namespace margay
