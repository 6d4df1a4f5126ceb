#include "ethercat/help.hpp"

#include "common/help_text.hpp"
#include "common/program.hpp"
#include "common/ready_made.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace margay::ethercat {
namespace {

using samples::escaped;
using samples::man_entry;
using samples::row;
using samples::wrapped;

constexpr std::string_view kIntroduction =
    "Shows and configures EtherCAT slaves. A command works on a SOURCE of its own: --source, or the environment "
    "variables MARGAY_MASTER0, MARGAY_MASTER1 and so on. Without them it works on the masters of margayd and of the "
    "applications that serve a socket in /run/margay, and when there is none, on the sources in /etc/margay/*.toml.";
constexpr std::string_view kNumbers =
    "Numbers are decimal, octal with the prefix 0, or hexadecimal with the prefix 0x. A LIST has numbers and ranges: "
    "1,4,7-9.";

std::string option_name(const Option& option) {
    return fmt::format("{}--{}{}{}", option.letter == 0 ? std::string("    ") : fmt::format("-{}, ", option.letter),
                       option.name, option.value.empty() ? "" : " ", option.value);
}

std::string options_text(const Command* command) {
    constexpr std::size_t kIndent = 30;
    std::string text;
    for (const bool common : {false, true}) {
        std::string rows;
        for (const Option& option : options()) {
            const bool listed = command != nullptr ? command->has_option(option) : option.common;
            if (listed && common == option.common) rows += row(option_name(option), option.text, kIndent);
        }
        if (!rows.empty()) text += fmt::format("\n{}:\n{}", common ? "Options of all commands" : "Options", rows);
    }
    return text;
}

std::string call_form(const Command& command, std::string_view form) {
    return fmt::format("ethercat {} [OPTIONS]{}{}", command.name, form.empty() ? "" : " ", form);
}

// A paragraph that begins with blanks is an example and keeps its lines.
bool verbatim(std::string_view paragraph) { return paragraph.starts_with(' '); }

std::string man_option(const Option& option) {
    std::string name = option.letter == 0 ? "" : fmt::format("\\-{}, ", option.letter);
    name += fmt::format("\\-\\-{}", escaped(option.name));
    if (!option.value.empty()) name += fmt::format("\\fR \\fI{}", escaped(option.value));
    return fmt::format(".TP\n\\fB{}\\fR\n{}\n", name, escaped(option.text));
}

std::string man_command(const Command& command) {
    std::string text = fmt::format(".SS {}\n", command.name);
    for (const auto form : command.forms)
        text += fmt::format("{}.B ethercat {}\n.RI [ OPTIONS ]\n{}", form == command.forms.front() ? "" : ".br\n",
                            command.name, form.empty() ? "" : fmt::format(".I {}\n", escaped(form)));
    text += fmt::format(".PP\n{}\n", escaped(command.summary));
    for (const auto paragraph : command.text) {
        if (!verbatim(paragraph)) {
            text += fmt::format(".PP\n{}\n", escaped(paragraph));
            continue;
        }
        text += ".PP\n.nf\n";
        for (std::size_t at = 0; at < paragraph.size();) {
            const auto end = std::min(paragraph.find('\n', at), paragraph.size());
            text += escaped(paragraph.substr(at, end - at)) + '\n';
            at = end + 1;
        }
        text += ".fi\n";
    }
    for (const Argument& argument : command.arguments) text += man_entry(argument.name, argument.text);
    for (const auto name : command.options) text += man_option(*find_option(name));
    return text;
}

// The words that may follow, in the form that the completion distinguishes: "FILE", "SOURCE", or a list.
std::string completion_case(std::string_view pattern, std::string_view words) {
    if (words == "FILE") return fmt::format("        {}) _margay_ethercat_files; return ;;\n", pattern);
    if (words == "SOURCE") return fmt::format("        {}) _margay_ethercat_sources; return ;;\n", pattern);
    return fmt::format("        {}) _margay_ethercat_words \"{}\"; return ;;\n", pattern, words);
}

std::string option_words(const Command* command) {
    std::string words;
    for (const Option& option : options()) {
        const bool fits = command == nullptr ? option.common : command->has_option(option);
        if (fits) words += fmt::format("{}--{}", words.empty() ? "" : " ", option.name);
    }
    return words;
}

// The words after "sim:": the ready-made segments of this program, and files.
std::string completion_of_segments() {
    return fmt::format(
        "_margay_ethercat_segments() {{\n"
        "    _margay_ethercat_files\n"
        "    COMPREPLY=($(compgen -W \"{}\" -- \"$current\") \"${{COMPREPLY[@]}}\")\n"
        "}}\n",
        fmt::join(samples::ready_made_names(), " "));
}

}  // namespace

std::string help_text(const Command* command) {
    if (command == nullptr) {
        std::string text = "Usage: ethercat COMMAND [OPTIONS] [ARGUMENTS]\n\n" + wrapped(kIntroduction, 0);
        text += "\nCommands:\n";
        for (const Command& one : commands()) text += row(one.name, one.summary, 14);
        text += "\n" + wrapped("ethercat COMMAND --help describes a command. Its name may be shortened.", 0);
        return text + options_text(nullptr) + "\n" + wrapped(kNumbers, 0) + std::string(samples::kExitCodeText) + "\n";
    }
    std::string text;
    for (const auto form : command->forms)
        text += fmt::format("{}{}\n", text.empty() ? "Usage: " : "       ", call_form(*command, form));
    text += "\n" + wrapped(command->summary, 0);
    for (const auto paragraph : command->text)
        text += "\n" + (verbatim(paragraph) ? std::string(paragraph) + "\n" : wrapped(paragraph, 0));
    if (!command->arguments.empty()) text += "\nArguments:\n";
    for (const Argument& argument : command->arguments) text += row(argument.name, argument.text, 18);
    return text + options_text(command) + "\n" + wrapped(kNumbers, 0) + std::string(samples::kExitCodeText) + "\n";
}

std::string man_page() {
    std::string text =
        ".\\\" Made by ethercat --man from the table of commands.\n"
        ".TH ETHERCAT 1 \"\" Margay \"User Commands\"\n"
        ".SH NAME\nethercat \\- shows and configures EtherCAT slaves\n"
        ".SH SYNOPSIS\n.B ethercat\n.I COMMAND\n.RI [ OPTIONS ]\n.RI [ ARGUMENTS ]\n.SH DESCRIPTION\n";
    text += fmt::format("{}\n.PP\n{}\n.SH COMMANDS\n", escaped(kIntroduction), escaped(kNumbers));
    for (const Command& command : commands()) text += man_command(command);
    text += ".SH OPTIONS\nOf all commands; analyse has only those that do not concern a segment:\n";
    for (const Option& option : options())
        if (option.common) text += man_option(option);
    text += ".SH EXIT STATUS\n" + escaped(samples::kExitCodeText.substr(samples::kExitCodeText.find(':') + 2)) + "\n";
    text += ".SH ENVIRONMENT\n" +
            man_entry("MARGAY_MASTER0, MARGAY_MASTER1 ...", "The sources of the masters, where --source is not given.");
    text +=
        ".SH EXAMPLES\n.nf\nethercat slaves \\-\\-source eth0\nethercat upload \\-p 3 \\-t uint32 0x1018 1 "
        "\\-\\-source "
        "sim:demo\nethercat graph | dot \\-Tsvg > bus.svg\n.fi\n";
    return text;
}

std::string bash_completion() {
    std::string names;
    for (const Command& command : commands()) names += fmt::format("{}{}", names.empty() ? "" : " ", command.name);
    std::string text =
        "# Completion of ethercat for bash. Made by `ethercat --completion` from the table of commands.\n"
        "_margay_ethercat_words() { COMPREPLY=($(compgen -W \"$1\" -- \"$current\")); }\n"
        "_margay_ethercat_files() { mapfile -t COMPREPLY < <(compgen -f -- \"$current\"); compopt -o filenames "
        "2>/dev/null; }\n"
        "# Readline divides words at colons: \"sim:demo\" is three words.\n"
        "_margay_ethercat_sources() {\n"
        "    local name\n"
        "    COMPREPLY=($(compgen -W \"$(ls /sys/class/net 2>/dev/null) sim: pcap:\" -- \"$current\"))\n"
        "    for name in \"${COMPREPLY[@]}\"; do [[ $name == *: ]] && compopt -o nospace 2>/dev/null; done\n"
        "}\n" +
        completion_of_segments() +
        "_margay_ethercat() {\n"
        "    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]} command= n\n"
        "    COMPREPLY=()\n"
        "    [[ $previous == '=' ]] && previous=${COMP_WORDS[COMP_CWORD-2]}\n"
        "    if [[ $previous == : || $current == : ]]; then\n"
        "        [[ $current == : ]] && current= || previous=${COMP_WORDS[COMP_CWORD-2]}\n"
        "        if [[ $previous == sim ]]; then _margay_ethercat_segments; else _margay_ethercat_files; fi\n"
        "        return\n"
        "    fi\n"
        "    case $previous in\n";
    for (const Option& option : options()) {
        if (option.value.empty()) continue;
        const auto pattern =
            option.letter == 0 ? fmt::format("--{}", option.name) : fmt::format("-{}|--{}", option.letter, option.name);
        text += completion_case(pattern, option.words);
    }
    text += "    esac\n    for ((n = 1; n < COMP_CWORD; ++n)); do\n        case ${COMP_WORDS[n]} in\n";
    text += "            " + [&names] {
        std::string pattern = names;
        std::ranges::replace(pattern, ' ', '|');
        return pattern;
    }() + ") command=${COMP_WORDS[n]}; break ;;\n        esac\n    done\n";
    text += "    case $command:$current in\n";
    for (const Command& command : commands())
        text += completion_case(fmt::format("{}:-*", command.name), option_words(&command));
    text += completion_case(":-*", option_words(nullptr));
    text += completion_case(":*", names);
    for (const Command& command : commands())
        for (const Argument& argument : command.arguments)
            if (!argument.words.empty()) text += completion_case(fmt::format("{}:*", command.name), argument.words);
    return text + "    esac\n}\ncomplete -F _margay_ethercat ethercat\n";
}

}  // namespace margay::ethercat
