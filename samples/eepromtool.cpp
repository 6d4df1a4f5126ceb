// eepromtool: reads, writes and shows the EEPROM (SII) of a slave. An image file can be used in the place of a slave.
#include "common/counted.hpp"
#include "common/eeprom.hpp"
#include "common/program.hpp"
#include "common/progress_line.hpp"
#include "common/sii_text.hpp"
#include "common/slave_eeprom.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "common/visible_text.hpp"
#include "common/xml_files.hpp"
#include "wire/sii.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>
#include <unistd.h>

#include <optional>

namespace {

using namespace margay;
using namespace margay::samples;

enum class Action { read, write, dump, alias };

struct Options {
    SourceArguments source;
    std::uint16_t number = 0;  // 0: not given
    Action action = Action::dump;
    std::string file = "-";
    std::optional<ImageFormat> format{};
    std::optional<std::uint16_t> alias{};
    std::size_t size = 0;
    bool force = false;
};

constexpr std::string_view kFileSource = "file:";

int print_error(const std::string& text) { return fail(text); }
int print_system_error(const std::string& text) { return fail(text, exit_code::kSystem); }

void print_note(const std::string& text) { fmt::print(stderr, "{}\n", samples::visible(text)); }

// Shows the progress. Ctrl-C stops the work between two words.
Progress progress_on(ProgressLine& line) {
    return [&line](std::string_view what, std::size_t done, std::size_t total) {
        line.show(fmt::format("{} {} of {}", what, done, total));
        return !stop_asked();
    };
}

// Reads the number of octets of --size, otherwise the whole EEPROM. When the size word contains more than any SII
// needs, only the part up to the end mark is read.
EepromContent read_all(Eeprom& eeprom, const Options& options) {
    const auto size = options.size != 0 ? EepromSize{options.size} : eeprom_size(eeprom);
    if (!size.error.empty()) return {{}, size.error};
    ProgressLine line;
    const bool absurd = size.octets > wire::sii::kMostContentBytes;
    if (options.size == 0 && eeprom.known_size() == 0 && absurd) {
        print_note(
            fmt::format("note: word 0x003e of {} gives {}; only the part up to the end mark is read, use --size {} to "
                        "read all",
                        eeprom.name(), counted(size.octets, "octet"), size.octets));
        return read_used_part(eeprom, progress_on(line));
    }
    if (absurd) print_note(fmt::format("note: reading {} of {}", counted(size.octets, "octet"), eeprom.name()));
    return read_eeprom(eeprom, size.octets, progress_on(line));
}

int read(Eeprom& eeprom, const Options& options) {
    const bool to_terminal = options.file == "-" && ::isatty(STDOUT_FILENO) != 0;
    const auto usual = to_terminal ? ImageFormat::intel_hex : format_by_name(options.file);
    const auto content = read_all(eeprom, options);
    if (!content.error.empty()) return print_error(content.error);
    const auto error = save_image(options.file, options.format.value_or(usual), content.octets);
    if (!error.empty()) return print_system_error(error);
    for (const auto& finding : sii_findings(content.octets)) print_note("warning: " + finding_text(finding));
    if (options.file != "-")
        print_out("{}: {} read into {}\n", eeprom.name(), counted(content.octets.size(), "octet"), options.file);
    return 0;
}

int dump(Eeprom& eeprom, const Options& options) {
    const auto content = read_all(eeprom, options);
    if (!content.error.empty()) return print_error(content.error);
    write_out(sii_text(content.octets));
    const auto fault = image_fault(content.octets);
    return fault.empty() ? 0 : print_error(fmt::format("the content of {} has faults: {}", eeprom.name(), fault));
}

// Returns why an image cannot be written to this EEPROM; empty when it can. The size of a blank EEPROM is unknown
// before writing, so a blank EEPROM is not checked for its size.
std::string image_size_fault(Eeprom& eeprom, Bytes image, const Options& options) {
    const auto wrong = image_fault(image);
    if (!wrong.empty() && (!options.force || image.size() % 2 != 0))
        return fmt::format("{} is not written: {}{}", options.file, wrong,
                           options.force ? "" : " (--force writes it nevertheless)");
    const auto size = options.size != 0 ? EepromSize{options.size} : eeprom_size(eeprom);
    if (size.error.empty() && image.size() > size.octets)
        return fmt::format("{} is not written: it has {}, the EEPROM of {} has {}{}", options.file,
                           counted(image.size(), "octet"), eeprom.name(), size.octets,
                           eeprom.known_size() != 0 ? "" : "; use --size if this is wrong");
    return {};
}

int write(Eeprom& eeprom, const Options& options) {
    const auto file = load_image(options.file);
    if (!file.error.empty()) return print_system_error(file.error);
    const auto refused = image_size_fault(eeprom, file.octets, options);
    if (!refused.empty()) return print_error(refused);
    for (const auto& finding : sii_findings(file.octets))
        if (finding.fault != wire::sii::Fault::size_mismatch) print_note("warning: " + finding_text(finding));
    ProgressLine line;
    const auto report = write_eeprom(eeprom, file.octets, progress_on(line));
    line.clear();
    if (!report.error.empty())
        return print_error(fmt::format("{}: {}\n{} of the {} written{}{}", eeprom.name(), report.error, report.written,
                                       counted(report.different, "word that differs was", "words that differ were"),
                                       report.left.empty() ? "" : "; ", report.left));
    print_out("{}: {} of {}, all verified\n", eeprom.name(), report.different,
              counted(report.words, "word was different and is written", "words were different and are written"));
    return 0;
}

int alias(Eeprom& eeprom, const Options& options) {
    const auto report = options.alias ? write_alias(eeprom, *options.alias, options.force) : read_alias(eeprom);
    if (!report.error.empty()) return print_error(fmt::format("{}: {}", eeprom.name(), report.error));
    if (!options.alias)
        print_out("0x{:04x}\n", report.after);
    else
        print_out("{}: alias 0x{:04x}, before 0x{:04x}; a slave uses it from its next power-up on\n", eeprom.name(),
                  report.after, report.before);
    return 0;
}

int act(Eeprom& eeprom, const Options& options) {
    switch (options.action) {
        case Action::read: return read(eeprom, options);
        case Action::write: return write(eeprom, options);
        case Action::dump: return dump(eeprom, options);
        case Action::alias: return alias(eeprom, options);
    }
    return 1;
}

int run_on_file(const Options& options) {
    if (options.number > 1) return fail("a file holds one image: NUMBER is 1, or left out", exit_code::kUsage);
    const auto path = options.source.source.substr(kFileSource.size());
    auto file = load_image(path);
    if (!file.error.empty()) return print_system_error(file.error);
    FileEeprom eeprom(path, std::move(file));
    return act(eeprom, options);
}

int run_on_slave(Source& source, const Options& options) {
    HostContext ctx(source.limits(Limits{.slaves = 2048}));
    const auto ready = source.begin(ctx);
    if (!ready) return print_error(sentence(ready.error()));
    const auto found = config_init(ctx);
    // Errors of single slaves are ignored: this program is used to repair slaves with a wrong EEPROM.
    if (!found && found.error().slave == 0) return print_error(sentence(found.error()));
    if (options.number == 0 || options.number > ctx.slaves().size())
        return fail(fmt::format("there is no slave {}: there are slaves 1 to {}", options.number, ctx.slaves().size()),
                    exit_code::kUsage);
    SlaveEeprom eeprom(ctx, options.number);
    const int status = act(eeprom, options);
    const bool writes = options.action == Action::write || options.alias.has_value();
    if (writes && status == 0 && options.source.source.starts_with("sim:"))
        print_note("note: a simulated slave forgets this when the program ends; file:NAME changes an image file");
    return status;
}

int run(const Options& options) {
    if (options.size % 2 != 0) return fail("--size: an EEPROM has a whole number of words", exit_code::kUsage);
    stop_at_signals();  // Ctrl-C stops the work between two words
    if (options.source.source.starts_with(kFileSource)) return run_on_file(options);
    if (options.number == 0) return fail("NUMBER of the slave is missing; 1 is the first slave", exit_code::kUsage);
    return run_on_source(options.source, [&](Source& source) { return run_on_slave(source, options); });
}

void add_commands(Arguments& arguments, Options& options) {
    const auto command = [&](const char* name, const char* text, Action action) -> Arguments& {
        return arguments.command(name, text, [&options, action] { options.action = action; });
    };
    const auto add_size = [&](Arguments& to) {
        to.option("--size", options.size, "size of the EEPROM in octets, when word 0x3e is blank or wrong",
                  Bounds{2, std::int64_t{8} * 1024 * 1024});
    };

    auto& read = command("read", "read the whole EEPROM into a file", Action::read);
    read.positional("FILE", options.file, "the file; - is standard output", Arguments::Presence::optional);
    read.choice<ImageFormat>("--format", options.format,
                             "bin or hex (Intel HEX); without it the extension of the file decides",
                             {{"bin", ImageFormat::binary}, {"hex", ImageFormat::intel_hex}});
    add_size(read);

    auto& write =
        command("write", "write a file (binary or Intel HEX, seen by its content) and verify it", Action::write);
    write.positional("FILE", options.file, "the file; - is standard input");
    add_size(write);
    write.flag("--force", options.force, "write the image in spite of its faults");

    add_size(command("dump",
                     "show the content, category by category; ends with 1 when the content has faults for "
                     "which `write` refuses an image",
                     Action::dump));

    auto& alias =
        command("alias", "show the station alias, or write it with its checksum and verify it", Action::alias);
    alias.positional("VALUE", options.alias, "the alias, decimal, or hexadecimal with 0x");
    alias.flag("--force", options.force, "write the alias although the old checksum is wrong");
}

struct EsiOptions {
    std::string file{};
    std::string type{};
    std::string output{};
};

int make_image(const EsiOptions& options) {
    const auto image = esi_image(options.file, options.type);
    for (const std::string& remark : image.remarks) print_note("note: " + remark);
    if (image.needs_type) return fail(image.error, exit_code::kUsage);
    if (!image.error.empty()) return print_system_error(image.error);
    if (options.output.empty()) {
        write_out(sii_text(image.octets));
        return 0;
    }
    const auto error = save_image(options.output, format_by_name(options.output), image.octets);
    if (!error.empty()) return print_system_error(error);
    if (options.output != "-")
        print_out("{}: the image of {}, {}\n", options.output, image.type, counted(image.octets.size(), "octet"));
    return 0;
}

// This command needs no slave, and so no SOURCE.
int run_esi(int argc, char** argv) {
    EsiOptions options;
    Arguments arguments("eepromtool esi",
                        "Makes the EEPROM image (SII) of a device from its ESI file, and shows it or writes "
                        "it into a file for `write`.");
    arguments.positional("FILE", options.file, "the ESI file");
    arguments.positional("TYPE", options.type,
                         "order code or name of the device, TYPE/REVISION for a revision that is not the greatest; not "
                         "needed if the file "
                         "describes one",
                         Arguments::Presence::optional);
    arguments.option("--output", options.output, "the file for the image; .hex is Intel HEX, - standard output");
    return arguments.run(argc, argv, [&] { return make_image(options); });
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 1 && std::string_view(argv[1]) == "esi") return run_esi(argc - 1, argv + 1);
    Options options;
    Arguments arguments("eepromtool",
                        "Reads, writes and shows the EEPROM (SII) of a slave. Puts the segment to PREOP. Do not use it "
                        "while another master is running. `eepromtool esi --help`: images from ESI files.");
    add_source_arguments(arguments, options.source, ", or an image file to be used like an EEPROM (file:NAME)");
    arguments.positional("NUMBER", options.number, "the slave, 1 is the first; not needed with file:");
    add_commands(arguments, options);
    return arguments.run(argc, argv, [&] { return run(options); });
}
