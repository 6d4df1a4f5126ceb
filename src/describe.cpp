// describe() for an Error: writes it as a sentence.
#include "argument_text.hpp"
#include "util/text_writer.hpp"
#include "wire/al_status_code.hpp"
#include "wire/aoe.hpp"
#include "wire/coe.hpp"
#include "wire/eoe.hpp"
#include "wire/esc.hpp"
#include "wire/foe.hpp"
#include "wire/mailbox.hpp"
#include "wire/sii.hpp"
#include "wire/soe.hpp"

#include <margay/al_state.hpp>
#include <margay/configuration.hpp>
#include <margay/error.hpp>
#include <margay/mailbox_type.hpp>

#include <algorithm>
#include <array>
#include <iterator>

namespace margay {
namespace {

bool is_command(Step step) { return step >= Step::command_ip && step <= Step::command_bi; }

bool is_entry(Errc code) { return code >= Errc::entry_not_mapped && code <= Errc::entry_stale; }

// The object of an entry, or its place in the assignment: "0x1C12:1, entry 3".
void write_entry_place(TextWriter& out, const Error& e) {
    (out << " of ").hex(e.index, 4) << ":" << unsigned{e.subindex};
    if (e.detail != 0) out << ", entry " << e.detail;
}

bool is_sync_manager(const Error& e) {
    const bool has = e.index >= wire::reg::kSyncManagerBase && e.index < wire::reg::sync_manager(16).address;
    return has || e.code == Errc::sm_shortage;
}
unsigned sync_manager(const Error& e) {
    return (e.index - unsigned{wire::reg::kSyncManagerBase}) / wire::reg::kSyncManagerStride;
}

void write_parameter(TextWriter& out, const Error& e) {
    std::array<char, 8> idn{};
    out << to_text(Idn{e.index}, idn) << ", drive " << e.subindex;
}

// Whether the error belongs to a command that is a message: it has no index, and its subindex is the type of the
// message.
bool is_message(const Error& e) {
    const auto type = static_cast<MailboxType>(e.subindex);
    if (e.index != 0 || (type != MailboxType::aoe && type != MailboxType::eoe)) return false;
    switch (e.code) {
        case Errc::sdo_abort: return false;
        case Errc::aoe_error:
        case Errc::aoe_result:
        case Errc::eoe_error:
        case Errc::mailbox_error: return true;
        default: return e.detail == 0;
    }
}

// The k…Command of an error; 0: it has none. A detail that uses all 32 bits does not contain it.
std::uint32_t command_kind(const Error& e) {
    constexpr std::array kWide{Errc::sdo_abort, Errc::soe_error,  Errc::command_failed,
                               Errc::aoe_error, Errc::aoe_result, Errc::eoe_error};
    if (!is_command(e.step) || std::ranges::find(kWide, e.code) != kWide.end()) return 0;
    return e.detail & (Error::kRegisterCommand | Error::kParameterCommand);
}

void write_command(TextWriter& out, const Error& e) {
    const bool by_soe = e.code == Errc::soe_error || e.code == Errc::command_failed;
    out << " (no. " << unsigned{e.place} << ", ";
    if (!by_soe && is_message(e)) {
        out << (static_cast<MailboxType>(e.subindex) == MailboxType::aoe ? "AoE" : "EoE") << " message";
    } else if (by_soe || command_kind(e) == Error::kParameterCommand) {
        write_parameter(out, e);
    } else if (command_kind(e) == Error::kRegisterCommand) {
        (out << "register ").hex(e.index, 4);
    } else {
        (out << "object ").hex(e.index, 4) << ":" << unsigned{e.subindex};
    }
    out << ")";
}

// Whether the call itself was refused, so that the error does not concern a slave.
bool is_refused_call(const Error& e) {
    const bool of_call = e.code == Errc::not_owner || e.code == Errc::not_polled || e.code == Errc::waiting_forbidden ||
                         e.code == Errc::in_callback || e.code == Errc::wrong_state || e.code == Errc::busy;
    return of_call && e.slave == 0 && e.index == 0;
}

// Whether the error concerns a request as a whole, and does not contain the object, word or register.
bool is_without_place(const Error& e) {
    const bool accesses = (e.step >= Step::sdo_upload && e.step <= Step::write_register) || e.step == Step::read_sii ||
                          e.step == Step::write_sii;
    if (!accesses || e.index != 0 || e.subindex != 0) return false;
    switch (e.code) {
        case Errc::not_owner:
        case Errc::not_polled:
        case Errc::waiting_forbidden:
        case Errc::in_callback:
        case Errc::timeout:
        case Errc::capacity:
        case Errc::canceled: return true;
        default: return e.slave == 0;
    }
}

// Writes `index` and `subindex`, whose meaning depends on the step.
void write_place(TextWriter& out, const Error& e) {
    if (is_refused_call(e) || is_without_place(e)) return;
    if (is_entry(e.code)) return write_entry_place(out, e);
    switch (e.step) {
        case Step::read_sii:
        case Step::write_sii:
        case Step::parse_sii: (out << " at word ").hex(e.word(), 4); break;
        case Step::sdo_upload:
        case Step::sdo_download:
        case Step::sdo_information: (out << " of ").hex(e.index, 4) << ":" << e.subindex; break;
        case Step::soe_read:
        case Step::soe_write:
        case Step::soe_command: write_parameter(out << " of ", e); break;
        case Step::mailbox_send:
        case Step::mailbox_receive:
            if (e.index != 0) out << " of PDO " << e.index;
            break;
        case Step::read_register:
        case Step::write_register: (out << " at register ").hex(e.index, 4); break;
        case Step::configure_pdos:
            if (is_sync_manager(e))
                out << " of SyncManager " << sync_manager(e);
            else
                (out << " of ").hex(e.index, 4) << ":" << unsigned{e.subindex};
            break;
        case Step::topology: out << " at port " << e.index; break;
        case Step::discover_pdos:
        case Step::map_process_data:
        case Step::exchange_process_data:
            if (e.code == Errc::unknown_group || e.code == Errc::group_left_out ||
                (e.step == Step::exchange_process_data && e.index != 0))
                out << " of group " << e.index;
            else if (e.code == Errc::image_overlaps)
                break;
            else if (e.code == Errc::pdo_unknown)
                (out << ", PDO ").hex(e.index, 4);
            else if (e.code == Errc::unknown_slave && e.index != 0)
                (out << " of ").hex(e.index, 4) << ":" << unsigned{e.subindex};
            else if (is_sync_manager(e))
                out << " at SyncManager " << sync_manager(e);
            else if (e.index != 0)
                (out << " at register ").hex(e.index, 4);
            break;
        default:
            if (is_command(e.step))
                write_command(out, e);
            else if (e.index != 0)
                (out << " at register ").hex(e.index, 4);
    }
}

std::string_view sm_text(std::uint32_t type) {
    static constexpr std::string_view kTexts[] = {"unused", "mailbox out", "mailbox in", "outputs", "inputs"};
    return type < std::size(kTexts) ? kTexts[type] : "nothing known";
}

// Example: "by 64 bits (used: the object dictionary, 128 bits; the SII has 64 bits)".
void write_difference(TextWriter& out, const Error& e) {
    const auto source = [](std::uint32_t s) { return to_text(static_cast<ConfigurationSource>(s & 0xFFU)); };
    out << " by " << (e.expected > e.actual ? e.expected - e.actual : e.actual - e.expected) << " bits ("
        << "used: " << source(e.detail >> 8) << ", " << e.expected << " bits; " << source(e.detail) << " has "
        << e.actual << " bits)";
}

// The size of process data in the SII, which is used although the slave itself does not report a size; 0: none.
void write_used_size(TextWriter& out, std::uint32_t octets) {
    if (octets != 0) out << " (used: " << octets << (octets == 1 ? " octet" : " octets") << ", as the SII says)";
}

void write_argument(TextWriter& out, const Error& e) {
    if (e.step == Step::identify && e.actual != 0) {
        out << " (entry " << e.actual
            << " of the list: without number, alias or device id, with the number or station address of another "
               "entry, with a reserved station address, or apart from its hot connect group)";
        return;
    }
    const bool of_command = is_command(e.step) || (e.step == Step::map_process_data && e.place != 0);
    const auto argument = static_cast<Argument>(of_command ? e.actual : e.detail);
    const auto text = argument_text(argument, e);
    if (text.empty()) return;
    out << ": ";
    if (argument == Argument::sync_cycle && e.expected != 0) {
        out << "SYNC0 each " << e.actual << " ns is neither a whole multiple nor a whole part of the cycle of "
            << e.expected << " ns, so its phase to the frames changes";
        return;
    }
    if (argument == Argument::empty_group) {
        out << "no slave has group " << e.actual << " in SlaveConfiguration::group";
        return;
    }
    if (argument == Argument::sync_pulse)
        out << "a cycle of " << e.actual << " ns, and a pulse of " << e.expected
            << " ns (ESC register 0x0982, from the SII): ";
    if (argument == Argument::command_transition) out << "no. " << unsigned{e.place} << " of the start-up commands ";
    out << text;
    if (argument <= Argument::limit_process_frames)
        out << " is " << e.actual << ", it must be 1 to " << e.expected;
    else if (argument == Argument::sii_words && e.expected != UINT32_MAX)
        out << ", which has " << e.expected << (e.expected == 1 ? " word" : " words");
    else if (argument == Argument::mail_size && e.actual == 0)
        out << " is empty";
    else if (argument == Argument::mail_size || argument == Argument::aoe_size)
        out << " is " << e.actual << " octets, at most " << e.expected << " are possible";
}

// The causes that are errors of the application's configuration.
void write_configuration_cause(TextWriter& out, const Error& e) {
    switch (e.code) {
        case Errc::above_highest:
            out << " (" << to_text(static_cast<AlState>(e.actual)) << " is above "
                << to_text(static_cast<AlState>(e.expected)) << ")";
            break;
        case Errc::cabling:
            if (e.detail == static_cast<std::uint32_t>(CablingFault::same_port))
                out << ": both hear the same frames, so they are connected to the same end of the segment";
            else
                out << ": another segment is connected to the second one";
            break;
        case Errc::supervised:
            out << " (wanted " << to_text(static_cast<AlState>(e.actual)) << ", the supervision keeps it in "
                << to_text(static_cast<AlState>(e.expected)) << ")";
            break;
        case Errc::pdo_list: out << " (" << pdo_list_text(static_cast<PdoListFault>(e.detail)) << ")"; break;
        case Errc::image_overlaps: out << " (group " << e.index << ")"; break;
        case Errc::invalid_argument: write_argument(out, e); break;
        case Errc::pdo_unknown: write_used_size(out, e.expected); break;
        case Errc::pdo_size: out << " (the SyncManager " << e.expected << ", the PDOs " << e.actual << ")"; break;
        case Errc::sizes_differ: write_difference(out, e); break;
        case Errc::types_differ:
            out << " ("
                << "used: " << sm_text(e.expected) << "; the other: " << sm_text(e.actual) << ")";
            break;
        case Errc::clock_not_reached:
            out << (e.detail == Error::kReferenceLost ? " (lost: slave " : " (behind it in the ring: slave ")
                << e.expected << ")";
            break;
        case Errc::clock_before_reference: out << " (slave " << e.expected << ")"; break;
        case Errc::not_in_sync: {
            const bool behind = (e.actual & 0x8000'0000) != 0;
            const std::uint32_t away = behind ? 0U - e.actual : e.actual;
            out << " (" << away << (behind ? " ns behind" : " ns ahead") << ", the limit is " << e.expected << " ns"
                << (away <= e.expected ? ": it was not within the limit for ClockSettings::settle)" : ")");
            break;
        }
        case Errc::entry_size: out << " (the type has " << e.expected << " bits, the entry " << e.actual << ")"; break;
        case Errc::check_failed:
            ((out << " (wanted ").hex(e.expected, 8) << ", is ").hex(e.actual, 8);
            if (is_command(e.step) && e.subindex != 0) out << ", from octet " << unsigned{e.subindex} << " on";
            out << ")";
            break;
        default: break;
    }
}

// The SII word of a mailbox size, or of the length of a SyncManager: the size does not fit a frame.
void write_oversized_mailbox(TextWriter& out, const Error& e) {
    std::string_view which = "mailbox SyncManager";
    switch (e.index) {
        case wire::sii::word::kBootMailbox + 1: which = "boot mailbox out"; break;
        case wire::sii::word::kBootMailbox + 3: which = "boot mailbox in"; break;
        case wire::sii::word::kMailbox + 1: which = "mailbox out"; break;
        case wire::sii::word::kMailbox + 3: which = "mailbox in"; break;
        default: break;
    }
    out << " (the " << which << " has " << e.actual << " octets, a frame carries " << e.expected << ")";
}

// The error of a register that every slave has, or of a mailbox, shows that the slave does not answer.
void write_silence(TextWriter& out, const Error& e) {
    const bool any_register = e.step == Step::read_register || e.step == Step::write_register || is_command(e.step) ||
                              e.step >= Step::configure_clocks;
    const bool silent = e.slave != 0 && e.actual == 0 && e.expected != 0 && e.step != Step::exchange_process_data;
    if (silent) out << ": the slave does not answer" << (any_register ? ", or has no such register" : "");
}

// How much memory is needed, and how much is available.
void write_room(TextWriter& out, const Error& e) {
    if (e.expected != 0) out << " (needed " << e.expected << ", there is room for " << e.actual << ")";
}

void write_aoe(TextWriter& out, const Error& e) {
    (out << " (error code ").hex(e.detail, 4) << ": " << wire::aoe::error_text(e.detail);
    if (e.expected != 0 || e.actual != 0) {
        (out << "; index group ").hex(e.expected, 4);
        (out << ", offset ").hex(e.actual, 4);
    }
    out << ")";
}

// The source that is used because the PDOs were not read from the slave.
void write_instead(TextWriter& out, const Error& e) {
    write_used_size(out, e.expected);
    if (e.step == Step::discover_pdos && e.expected == 0) out << ", and the SII has no sizes";
}

std::string_view code_text(const Error& e) {
    if (needs_feature(e)) return feature_text(e);
    if (e.code == Errc::configuration_lost) return lost_text(e);
    if (e.code == Errc::missing_slave && e.step == Step::recover)
        return e.slave == 0 ? "no lost slave was found" : "the slave does not answer";
    if (e.code == Errc::mailbox_closed && e.step == Step::voe_receive)
        return "the inbox does not listen any more: unlisten() was called";
    if (e.code == Errc::nic && e.step == Step::open_nic) return "the network interface could not be opened";
    if (e.code == Errc::unknown_group && e.expected != 0) return "there is no such group";
    if (e.code == Errc::unknown_group && e.step == Step::request_state) return "nothing is mapped: call config_map()";
    return to_text(e.code);
}

// The operation that has prevented a request from beginning.
void write_obstacle(TextWriter& out, std::uint32_t operation) {
    out << " (it has not begun";
    if (operation != 0) out << ": " << to_text(static_cast<Operation>(operation)) << " is busy";
    out << ")";
}

void write_cause(TextWriter& out, const Error& e) {
    switch (e.code) {
        case Errc::sii_format:
            if (e.actual > e.expected) write_oversized_mailbox(out, e);
            break;
        case Errc::timeout:
            if (e.detail >= Error::kNotBegun) return write_obstacle(out, e.detail - Error::kNotBegun);
            [[fallthrough]];
        case Errc::al_status:
        case Errc::other_state:
            if (e.step != Step::request_state || e.expected == 0) break;
            out << " (wanted " << to_text(static_cast<AlState>(e.expected)) << ", is in "
                << to_text(static_cast<AlState>(e.actual));
            if (e.detail != 0)
                (out << ", AL status code ").hex(e.detail, 4)
                    << ": " << wire::al_status_text(static_cast<std::uint16_t>(e.detail));
            out << ")";
            break;
        case Errc::no_frame:
            if (e.detail == Error::kUnmarked)
                out << " (frames came back unmarked: slaves have counted them up, but bit 1 of the first octet of the "
                       "source address is not set, and this network interface does not hide own frames)";
            break;
        case Errc::working_counter:
        case Errc::unstable:
            if (e.expected != e.actual) out << " (expected " << e.expected << ", got " << e.actual << ")";
            if (e.code == Errc::working_counter) write_silence(out, e);
            if (e.code == Errc::unstable && e.step == Step::configure_clocks)
                out << (e.detail == Error::kRedundancy ? " (the measurement of the delays took too long)"
                        : e.slave != 0
                            ? " (it was lost, or came back, during the measurement, or its receive times make "
                              "no sense)"
                        : e.actual < e.expected ? ""
                                                : " (more slaves answer than were found: search again)");
            if (e.code == Errc::unstable && e.step == Step::topology)
                out << ": its open ports do not fit the slaves that were found, or frames enter a slave at a port "
                       "other than 0";
            if (e.step == Step::exchange_process_data && e.detail == Error::kOthersFresh)
                out << ", the inputs of the other slaves are fresh";
            if (e.step == Step::exchange_process_data && e.detail == Error::kBeingMapped)
                out << ", the group is being mapped";
            break;
        case Errc::capacity:
            out << ": " << capacity_text(e);
            write_room(out, e);
            break;
        case Errc::too_many_frames: out << ": Limits::process_frames"; [[fallthrough]];
        case Errc::image_too_large:
        case Errc::fmmu_shortage:
        case Errc::sm_shortage: write_room(out, e); break;
        case Errc::sii_verify:
        case Errc::sii_checksum:
            (out << " (expected ").hex(e.expected, e.code == Errc::sii_verify ? 4 : 2);
            (out << ", got ").hex(e.actual, e.code == Errc::sii_verify ? 4 : 2) << ")";
            break;
        case Errc::sdo_abort:
            (out << " (abort code ").hex(e.detail, 8)
                << ": " << wire::coe::to_text(static_cast<wire::coe::Abort>(e.detail)) << ")";
            if (e.step == Step::configure_pdos && e.expected != e.actual) {
                (out << "; wanted ").hex(e.expected, 8);
                (out << ", it has ").hex(e.actual, 8);
            }
            break;
        case Errc::soe_error:
            (out << " (error code ").hex(e.detail, 4)
                << ": " << wire::soe::to_text(static_cast<wire::soe::ErrorCode>(e.detail)) << ")";
            break;
        case Errc::foe_error:
            (out << " (error code ").hex(e.detail, 4)
                << ": " << wire::foe::to_text(static_cast<wire::foe::ErrorCode>(e.detail)) << ")";
            break;
        case Errc::stream_failed: out << " (number " << e.detail << ")"; break;
        case Errc::aoe_error:
        case Errc::aoe_result: write_aoe(out, e); break;
        case Errc::eoe_error:
            (out << " (result ").hex(e.detail, 4)
                << ": " << wire::eoe::to_text(static_cast<EoeResult>(e.detail)) << ")";
            break;
        case Errc::command_failed: (out << " (data state ").hex(e.detail, 4) << ")"; break;
        case Errc::mailbox_error:
            (out << " (detail ").hex(e.detail, 4)
                << ": " << wire::to_text(static_cast<wire::MailboxErrorCode>(e.detail)) << ")";
            break;
        case Errc::wrong_size: out << " (expected " << e.expected << " octets, got " << e.actual << ")"; break;
        case Errc::other_slave:
            out << " (expected " << to_text(static_cast<IdentityField>(e.subindex)) << " ";
            out.hex(e.expected, 8) << ", got ";
            out.hex(e.actual, 8) << " of vendor ";
            out.hex(e.detail, 8) << ")";
            break;
        case Errc::missing_slave:
            if (e.index != 0) break;  // the subindex is that of an object
            if (e.subindex == static_cast<unsigned>(IdentityField::alias)) (out << " (alias ").hex(e.actual, 4) << ")";
            if (e.subindex == static_cast<unsigned>(IdentityField::device_id))
                (out << " (device id ").hex(e.actual, 4) << ")";
            if (e.step == Step::recover && e.slave != 0) out << ": check its power and its cable";
            break;
        case Errc::unsupported:
            if (needs_feature(e)) return write_instead(out, e);
            if (e.step == Step::identify) out << " (an explicit device id)";
            if (e.step == Step::configure_sync) out << " (its SII has no DC operation mode " << e.subindex << ")";
            if (e.step == Step::configure_clocks && e.detail == Error::kRedundancy)
                out << " (the chosen reference clock is at a branch that only the frames of the second NIC reach)";
            if (e.step == Step::configure_clocks && e.detail != Error::kRedundancy)
                out << " (frames arrive at its port " << e.actual
                    << " instead of 0, and the receive times do not tell which slaves are behind)";
            if (e.step == Step::request_state)
                out << " (" << to_text(AlState::boot) << ": its SII describes no bootstrap mailbox)";
            break;
        case Errc::wrong_state:
            if (e.step == Step::configure_clocks && e.detail == Error::kNoTime)
                out << " (call ApplicationTime::set() before)";
            else if (e.step == Step::configure_clocks && e.detail == Error::kNotBack)
                out << " (the datagram was not sent, or is not back yet)";
            else if (e.step == Step::configure_clocks && e.detail == Error::kRedundancy)
                out << " (the ring is broken: the delays of its clocks can be measured while it is whole)";
            else if (is_refused_call(e) && e.detail == Error::kNotSubmitted)
                out << " (the request was not submitted to this context: call submit())";
            else if (is_refused_call(e))
                out << (e.step == Step::open_nic ? " (init() was called before)"
                                                 : " (call init(), then config_init(), then submit or wait)");
            if (e.step == Step::configure_sync) out << " (call configdc() before: it has to find a clock)";
            if (e.slave != 0 && e.step >= Step::mailbox_send && e.step <= Step::eoe_frames)
                out << " (the mailbox of the slave is closed: the slave is in INIT, or was not read)";
            if (e.step == Step::configure_clocks && e.slave != 0)
                out << " (it is in OP and needs its SYNC signals: bring it to PREOP before)";
            break;
        case Errc::unknown_group:
            if (e.expected != 0) out << " (Limits::groups is " << e.expected << ")";
            break;
        case Errc::busy:
            if (e.detail != 0) out << " (" << to_text(static_cast<Operation>(e.detail)) << " is busy)";
            if (e.step == Step::exchange_process_data && e.expected != 0)
                out << " (" << e.expected << " cycles are on the wire: call receive_processdata())";
            break;
        case Errc::unknown_slave:
            if (e.detail != 0)
                ((out << " (station address ").hex(e.detail, 4) << " is wanted, and the slave has ").hex(e.actual, 4)
                    << ")";
            else if (e.step == Step::mailbox_receive && e.expected == 0)
                out << " (Limits::slaves is " << e.actual << ")";  // a listener before the first scan
            else if (e.slave != 0 || e.expected != 0)
                out << " (there are " << e.expected << ")";
            break;
        case Errc::nic:
            if (e.actual != 0) out << " (system error " << e.actual << ")";
            if (e.step == Step::open_nic) out << ": problem() of the NIC says why";
            break;
        default: write_configuration_cause(out, e);
    }
}

}  // namespace

std::string_view describe(const Error& e, std::span<char> buffer) {
    TextWriter out(buffer);
    if (e.slave != 0) out << "slave " << e.slave << ": ";
    if (e.step != Step::none) {
        out << to_text(e.step);
        write_place(out, e);
        out << ": ";
    }
    Error cause = e;
    cause.detail &= ~command_kind(e);
    out << code_text(cause);
    write_cause(out, cause);
    return out.text();
}

}  // namespace margay
