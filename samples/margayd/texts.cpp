#include "margayd/texts.hpp"

#include "common/help_text.hpp"
#include "common/program.hpp"
#include "common/service_configuration.hpp"

#include <fmt/format.h>

namespace margay::service {
namespace {

using samples::escaped;
using samples::man_entry;
using samples::ServiceKey;
using samples::wrapped;

constexpr ProgramOption kOptions[] = {
    {"config", "FOLDER", "the folder with the configuration [/etc/margay]"},
    {"check", "", "check the configuration, print each error with its file and line, and end"},
    {"sockets", "FOLDER", "the folder of the sockets [/run/margay]"},
    {"help", "", "print help and exit"},
    {"version", "", "print the version and exit"},
    {"man", "", "print the manual page and exit"},
    {"completion", "", "print the completion for bash and exit"},
};

constexpr std::string_view kIntroduction =
    "Runs EtherCAT masters as a service: brings their segments up, keeps the slaves in their state, runs the cycle "
    "with "
    "outputs of 0, and lets `ethercat` and other programs work on them by sockets. Runs in the foreground until "
    "SIGTERM "
    "or SIGINT. Messages go to standard error.";
constexpr std::string_view kConfiguration =
    "Each file *.toml of the folder describes masters: a file with the key `source` is one master with the name of the "
    "file, in other files each table ([line1]) is one master.";
constexpr std::string_view kExample =
    "[line1]\nsource = \"eth0\"\neni = \"line1.xml\"\ncycle_us = 1000\n"
    "socket = { group = \"automation\", mode = \"0660\" }\n";
constexpr std::string_view kExitCodes =
    "Exit codes: 0 no error; 2 wrong arguments or an error in the configuration; 3 system error (interface, file, "
    "permission), or another program serves the socket.";

std::string key_text(const ServiceKey& key) {
    return std::string(key.text) + (key.standard.empty() ? "" : fmt::format(" [{}]", key.standard));
}

std::string verbatim(std::string_view text) {
    std::string out = ".PP\n.nf\n";
    for (std::size_t at = 0; at < text.size();) {
        const auto end = std::min(text.find('\n', at), text.size());
        out += escaped(text.substr(at, end - at)) + '\n';
        at = end + 1;
    }
    return out + ".fi\n";
}

std::string paragraph(std::string_view text) { return fmt::format(".PP\n{}\n", escaped(text)); }

std::string man_signals() {
    return ".SH SIGNALS\n" +
           man_entry("SIGTERM, SIGINT",
                     "The slaves are brought to the end state of their master, and the program ends with 0.") +
           man_entry("SIGHUP",
                     "The configuration is read again. Masters whose configuration has changed end and start anew; the "
                     "others go on undisturbed. A configuration with an error is refused, and all masters go on with "
                     "the old one. A master that cannot start, because its port is in use for example, is tried again "
                     "every 5 s.");
}

std::string man_slaves() {
    return ".SH SLAVES\n" +
           paragraph(
               "Messages number the slaves of a master from 1, as the ENI file lists them or the scan has found them; "
               "`ethercat` names the position in the ring, which begins with 0.") +
           paragraph(
               "Without an ENI file the segment is scanned again when slaves were added or exchanged. With an ENI file "
               "it is not: its slaves keep the places of the first scan. A slave of a line that gets its power later "
               "comes into operation. In a ring, or where another branch follows it, the slaves behind it were taken "
               "for other ones at the start, and they and the late slave stay out of operation: restart the master, by "
               "SIGHUP with a changed configuration or by `systemctl restart margayd`.");
}

std::string man_service() {
    return ".SH UNDER SYSTEMD\n" +
           paragraph(
               "The unit margayd.service runs the program as the user margay with the capabilities CAP_NET_RAW "
               "(frames), CAP_NET_ADMIN (switching interfaces on, EoE interfaces) and CAP_CHOWN (the owner of a "
               "socket). Members of the group margay may use the sockets. `systemctl reload margayd` checks the "
               "configuration before it sends SIGHUP.") +
           paragraph("A source with xdp: also needs CAP_BPF. `systemctl edit margayd` adds it:") +
           verbatim(
               "[Service]\nCapabilityBoundingSet=CAP_BPF\nAmbientCapabilities=CAP_BPF\n"
               "SystemCallFilter=bpf\nRestrictAddressFamilies=AF_XDP\n");
}

}  // namespace

std::span<const ProgramOption> program_options() { return kOptions; }

std::string help_text() {
    std::string text = "Usage: margayd [OPTIONS]\n\n" + wrapped(kIntroduction, 0) + "\nOptions:\n";
    for (const auto& option : kOptions)
        text += samples::row(fmt::format("--{}{}{}", option.name, option.value.empty() ? "" : " ", option.value),
                             option.text, 22);
    text += "\nConfiguration:\n" + wrapped(kConfiguration, 0) + "\n";
    for (const ServiceKey& key : samples::service_keys())
        text += samples::row(fmt::format("{} = {}", key.name, key.value), key_text(key), 34);
    return text + "\nExample:\n" + std::string(kExample) + "\n" + wrapped(kExitCodes, 0);
}

std::string man_page() {
    std::string text =
        ".\\\" Made by margayd --man from the tables of options and keys.\n"
        ".TH MARGAYD 8 \"\" Margay \"System Administration\"\n"
        ".SH NAME\nmargayd \\- runs EtherCAT masters as a service\n"
        ".SH SYNOPSIS\n.B margayd\n.RI [ OPTIONS ]\n.SH DESCRIPTION\n";
    text += escaped(kIntroduction) + "\n.SH OPTIONS\n";
    for (const auto& option : kOptions)
        text += fmt::format(".TP\n\\fB\\-\\-{}\\fR{}\n{}\n", escaped(option.name),
                            option.value.empty() ? "" : fmt::format(" \\fI{}\\fR", escaped(option.value)),
                            escaped(option.text));
    text += ".SH CONFIGURATION\n" + escaped(kConfiguration) + "\n";
    for (const ServiceKey& key : samples::service_keys())
        text += man_entry(fmt::format("{} = {}", key.name, key.value), key_text(key));
    text += ".SH EXAMPLE\n" + verbatim(kExample) + man_slaves() + man_signals() + man_service();
    text += ".SH FILES\n" + man_entry("/etc/margay/*.toml", "the configuration") +
            man_entry("/run/margay/NAME.sock", "the socket of a master") +
            man_entry("/run/margay/NAME.sock.left",
                      "the source of a master that has ended while slaves did not answer: the next one brings them up "
                      "without take_over");
    text += ".SH EXIT STATUS\n" + escaped(kExitCodes.substr(kExitCodes.find(':') + 2)) + "\n";
    return text + ".SH SEE ALSO\n.BR ethercat (1)\n";
}

std::string bash_completion() {
    std::string names;
    std::string folders;
    for (const auto& option : kOptions) {
        names += fmt::format("{}--{}", names.empty() ? "" : " ", option.name);
        if (option.value == "FOLDER") folders += fmt::format("{}--{}", folders.empty() ? "" : "|", option.name);
    }
    return fmt::format(
        "# Completion of margayd for bash. Made by `margayd --completion` from its table of options.\n"
        "_margayd() {{\n"
        "    local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}}\n"
        "    COMPREPLY=()\n"
        "    case $previous in\n"
        "        {}) mapfile -t COMPREPLY < <(compgen -d -- \"$current\"); compopt -o filenames 2>/dev/null; return "
        ";;\n"
        "    esac\n"
        "    COMPREPLY=($(compgen -W \"{}\" -- \"$current\"))\n"
        "}}\ncomplete -F _margayd margayd\n",
        folders, names);
}

}  // namespace margay::service
