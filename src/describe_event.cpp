// describe() for an Event: writes it as a sentence.
#include "util/text_writer.hpp"
#include "wire/al_status_code.hpp"
#include "wire/emergency_code.hpp"

#include <margay/event.hpp>

#include <array>

namespace margay {
namespace {

void write_al(TextWriter& out, const AlStatus& al) {
    out << to_text(al.state);
    if (al.error) out << "+ERROR";
    if (al.code != 0) (out << " (").hex(al.code, 4) << ": " << wire::al_status_text(al.code) << ")";
}

// Example: "between slave 4 port 1 and slave 5".
void write_cable(TextWriter& out, const Event& e) {
    if (e.slave == 0)
        out << "between the master and slave " << e.other;
    else if (e.other == 0)
        out << "at slave " << e.slave << " port " << e.port;
    else
        out << "between slave " << e.slave << " port " << e.port << " and slave " << e.other;
}

// The difference to the reference clock as the event stores it: as an unsigned number.
void write_difference(TextWriter& out, std::uint32_t difference) {
    const bool behind = (difference & 0x8000'0000) != 0;
    out << (behind ? 0U - difference : difference) << (behind ? " ns behind" : " ns ahead");
}

// Example: "between slave 4 port 1 and slave 5"; the ends of the ring are the NICs.
void write_break(TextWriter& out, const Event& e) {
    const bool swapped = e.actual != 0;
    out << "between ";
    if (e.slave == 0)
        out << (swapped ? "the second NIC" : "the first NIC");
    else
        out << "slave " << e.slave << " port " << unsigned{e.port};
    if (e.other == 0)
        out << (swapped ? " and the first NIC" : " and the second NIC");
    else
        out << " and slave " << e.other;
}

void write_slave(TextWriter& out, const Event& e) { out << "slave " << e.slave << ": "; }

}  // namespace

std::string_view to_text(EventKind kind) {
    switch (kind) {
        case EventKind::state: return "state changed";
        case EventKind::lost: return "lost";
        case EventKind::found: return "found again";
        case EventKind::other_slave: return "another slave in its place";
        case EventKind::stranger: return "unexpected slave";
        case EventKind::ambiguous: return "one of several equal slaves";
        case EventKind::missing: return "missing";
        case EventKind::recovered: return "recovered";
        case EventKind::recovery_failed: return "recovery failed";
        case EventKind::fell_short: return "working counter fell short";
        case EventKind::right_again: return "working counter right again";
        case EventKind::slave_count: return "number of slaves changed";
        case EventKind::line_errors: return "CRC errors";
        case EventKind::link_lost: return "link interrupted";
        case EventKind::emergency: return "emergency";
        case EventKind::unsupervised: return "supervision ended";
        case EventKind::clock_in_sync: return "clock in sync";
        case EventKind::clock_out_of_sync: return "clock out of sync";
        case EventKind::reference_clock: return "another reference clock";
        case EventKind::reference_lost: return "reference clock lost";
        case EventKind::latch_edge: return "edge at a latch input";
        case EventKind::master_in_sync: return "cycle in sync";
        case EventKind::master_out_of_sync: return "cycle out of sync";
        case EventKind::overrun: return "cycles left out";
        case EventKind::ring_broken: return "redundancy broken";
        case EventKind::ring_closed: return "redundancy restored";
        case EventKind::clock_not_reached: return "clock not synchronised";
        case EventKind::second_reference: return "a second reference clock";
        case EventKind::second_cable_missing: return "second cable missing";
        case EventKind::nics_on_same_port: return "both NICs on the same port";
        case EventKind::second_segment: return "another segment at the second NIC";
        case EventKind::cables_swapped: return "cables swapped";
        case EventKind::delays_assumed: return "delays not measured";
    }
    return "unknown event";
}

std::string_view describe(const Event& e, std::span<char> buffer) {
    TextWriter out(buffer);
    switch (e.kind) {
        case EventKind::state:
            write_slave(out, e);
            out << to_text(e.before.state) << (e.before.error ? "+ERROR to " : " to ");
            write_al(out, e.now);
            break;
        case EventKind::lost:
            if (e.slave == 0) return (out << "no frame comes back from the segment").text();
            write_slave(out, e);
            out << "lost, it was in " << to_text(e.before.state);
            break;
        case EventKind::found:
            if (e.slave == 0) return (out << "frames come back from the segment again").text();
            write_slave(out, e);
            out << "found again, in ";
            write_al(out, e.now);
            if (e.now.state == AlState::init) out << ", as after a loss of power";
            break;
        case EventKind::other_slave:
            write_slave(out, e);
            out << "another slave in its place (expected " << to_text(static_cast<IdentityField>(e.error.subindex));
            (out << " ").hex(e.error.expected, 8);
            (out << ", got ").hex(e.error.actual, 8);
            (out << " of vendor ").hex(e.detail, 8) << ")";
            break;
        case EventKind::stranger:
            (out << "an unexpected slave (product ").hex(e.actual, 8);
            (out << " of vendor ").hex(e.detail, 8);
            (out << ", revision ").hex(e.expected, 8) << ") is connected to ";
            if (e.slave == 0) return (out << "the master").text();
            out << "slave " << e.slave << " port " << unsigned{e.port} << ", or behind such a slave there";
            break;
        case EventKind::ambiguous:
            out << "a device at ";
            if (e.expected == 0)
                out << "a NIC";
            else
                out << "slave " << e.expected << " port " << unsigned{e.port};
            out << " may be slave " << e.slave << " or slave " << e.other
                << ", which are equal and lost: it is not started until the others are there (a serial number or an "
                   "alias would tell them apart)";
            break;
        case EventKind::missing:
            write_slave(out, e);
            out << "missing, though the first slave of its group, slave " << e.other << ", is there";
            break;
        case EventKind::recovered:
            write_slave(out, e);
            out << "recovered, in ";
            write_al(out, e.now);
            break;
        case EventKind::recovery_failed: {
            std::array<char, 256> text{};
            out << "recovery failed: " << describe(e.error, text);
            break;
        }
        case EventKind::fell_short:
        case EventKind::right_again:
            out << "group " << unsigned{e.group} << ": "
                << (e.actual > e.expected ? "working counter too high" : to_text(e.kind)) << " (expected " << e.expected
                << ", got " << e.actual << ")";
            break;
        case EventKind::slave_count:
            out << e.actual << (e.actual == 1 ? " slave answers" : " slaves answer") << ", it was " << e.expected;
            break;
        case EventKind::line_errors:
            out << "CRC errors ";
            write_cable(out, e);
            out << ": " << e.actual;
            break;
        case EventKind::link_lost:
            out << "link interrupted ";
            write_cable(out, e);
            out << ": " << e.actual << (e.actual == 1 ? " time" : " times");
            break;
        case EventKind::emergency:
            write_slave(out, e);
            (out << "emergency ").hex(e.detail, 4)
                << ": " << wire::emergency_text(static_cast<std::uint16_t>(e.detail));
            (out << ", error register ").hex(e.actual, 2);
            break;
        case EventKind::unsupervised:
            out << "the supervision has ended: lost slaves are not brought back";
            if (e.error.code != Errc::none && e.error.code != Errc::canceled) {
                std::array<char, 200> text{};
                out << ": " << describe(e.error, text);
            }
            break;
        case EventKind::clock_in_sync:
        case EventKind::clock_out_of_sync:
            write_slave(out, e);
            out << to_text(e.kind) << ", ";
            write_difference(out, e.actual);
            if (e.kind == EventKind::clock_out_of_sync) out << " (limit " << e.expected << " ns)";
            break;
        case EventKind::reference_clock:
            out << "the clock of slave " << e.slave << " is the reference clock now, in place of slave " << e.other;
            break;
        case EventKind::second_reference:
            out << "the clocks that the reference does not reach follow slave " << e.slave
                << ", which is kept in step with slave " << e.other;
            break;
        case EventKind::clock_not_reached:
            write_slave(out, e);
            out << "its clock is not synchronised, because it is before the reference clock of slave " << e.other
                << " in the ring";
            break;
        case EventKind::reference_lost: out << "slave " << e.slave << " with the reference clock is lost"; break;
        case EventKind::latch_edge:
            write_slave(out, e);
            out << (e.detail == 0 ? "rising" : "falling") << " edge at latch input " << e.port << " at "
                << (std::uint64_t{e.expected} << 32 | e.actual) << " ns";
            break;
        case EventKind::master_in_sync:
        case EventKind::master_out_of_sync: {
            const auto late = static_cast<std::int32_t>(e.actual);
            out << to_text(e.kind) << ", " << (late < 0 ? 0U - e.actual : e.actual)
                << (late < 0 ? " ns early" : " ns late");
            break;
        }
        case EventKind::overrun:
            out << "the work of a cycle takes longer than its period: " << e.actual
                << (e.actual == 1 ? " cycle" : " cycles") << " left out, " << e.expected << " since the cycle began";
            break;
        case EventKind::ring_broken:
            out << "redundancy broken ";
            write_break(out, e);
            break;
        case EventKind::ring_closed: out << "redundancy restored: the ring is whole again"; break;
        case EventKind::second_cable_missing:
            out << "no redundancy: the second NIC reaches no slave, its cable is not connected or broken";
            break;
        case EventKind::nics_on_same_port:
            out << "no redundancy: both NICs hear the same frames, they are connected to the same end of the segment";
            break;
        case EventKind::second_segment:
            out << "no redundancy: the second NIC is connected to the first slave of another segment";
            break;
        case EventKind::cables_swapped:
            out << "the cables of the NICs are swapped: the second NIC is connected to the first slave";
            break;
        case EventKind::delays_assumed:
            write_slave(out, e);
            out << "it has branches and no receive times, so the delays of " << e.actual
                << (e.actual == 1 ? " clock" : " clocks") << " are not measured: ";
            if (e.detail != 0)
                out << "they are wrong by all that its cables need, because no slave before it has receive times";
            else
                out << "they are right if all its cables are equally long";
            break;
    }
    return out.text();
}

}  // namespace margay
