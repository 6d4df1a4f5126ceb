// The parts of the page about the machine and about the report itself.
#include "segment_report/page.hpp"

#include <fmt/format.h>

namespace margay::segment_report {
namespace {

Severity severity_of(nic_check::Verdict verdict) {
    return verdict == nic_check::Verdict::good ? Severity::good : Severity::remark;
}

Markup interface_facts(const nic_check::InterfaceFacts& facts) {
    Facts list;
    list.add("Interface", facts.name);
    list.add("Driver", facts.driver.value_or(""));
    list.add("Kind", facts.kind);
    list.add("Link", !facts.up       ? "interface is down"
                     : facts.carrier ? (*facts.carrier ? "up" : "no link")
                                     : "not known");
    if (facts.speed_mbit)
        list.add("Speed", fmt::format("{} Mbit/s{}", *facts.speed_mbit,
                                      !facts.full_duplex   ? ""
                                      : *facts.full_duplex ? ", full duplex"
                                                           : ", half duplex"));
    list.add("MTU", fmt::to_string(facts.mtu));
    return list.markup();
}

Markup device_facts(const Report& report) {
    Table table({{"NIC"}, {"MAC address"}, {"Link"}});
    for (const auto& device : report.master.devices) {
        const auto& m = device.mac;
        table.add({device.name,
                   code(fmt::format("{:02x}:{:02x}:{:02x}:{:02x}:{:02x}:{:02x}", m[0], m[1], m[2], m[3], m[4], m[5])),
                   device.link ? "up" : "down"});
    }
    return table.empty() ? Markup() : table.markup();
}

}  // namespace

Markup machine_section(const Report& report) {
    const Machine& machine = report.machine;
    Facts facts;
    facts.add("System", machine.system);
    facts.add("Kernel", machine.kernel);
    facts.add("Real time", machine.facts.preempt_rt.value_or(false) ? "PREEMPT_RT"
                           : machine.facts.preemptible              ? "preemptible kernel, no PREEMPT_RT"
                                                                    : "no PREEMPT_RT");
    facts.add("Processor", machine.processor.empty()
                               ? fmt::format("{} online", machine.facts.processors)
                               : fmt::format("{}, {} online", machine.processor, machine.facts.processors));
    if (machine.facts.virtual_machine) facts.add("Virtual machine", "yes");
    Markup content = facts.markup() + device_facts(report);
    for (const auto& interface : machine.interfaces) content += interface_facts(interface);
    content += list_of(machine.interface_problems);
    if (report.origin == Origin::segment && machine.interfaces.empty() && machine.interface_problems.empty())
        content += paragraph("The source is no network interface of this machine.");
    if (report.origin != Origin::segment) content += paragraph("This is the machine that made the report.");
    if (machine.findings.empty()) return content;
    Table table({{"Verdict"}, {"Subject"}, {"Finding"}, {"Command"}});
    for (const auto& finding : machine.findings)
        table.add({badge(severity_of(finding.verdict), nic_check::to_text(finding.verdict)), finding.subject,
                   finding.text, finding.command.empty() ? Markup() : tag("code", "class=\"long\"", finding.command)});
    return content + tag("h3", "What nic_check says") + table.markup();
}

Markup run_section(const Report& report) {
    Facts facts;
    facts.add("Command", code(report.command));
    facts.add("Version", "Margay " + report.version);
    facts.add("Begun", report.begun);
    facts.add("Ended", report.ended);
    facts.add("Source", report.source);
    if (report.virtual_time) facts.add("Time", "the segment is simulated or replayed: its time is virtual");
    if (report.origin != Origin::recording && report.failure.empty())
        facts.add("Frames", fmt::format("{} sent, {} received, {} lost, {} on the wire", report.master.frames_sent,
                                        report.master.frames_received, report.master.frames_lost,
                                        counted(report.master.bytes_on_wire, "octet")));
    Markup content = facts.markup();
    if (!report.messages.empty()) content += tag("h3", "Messages of the master") + list_of(report.messages);
    return content;
}

}  // namespace margay::segment_report
