// The commands foe_read, foe_write, sii_read, sii_write, alias.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include "common/counted.hpp"
#include "common/sii_text.hpp"
#include "ethercat/session_eeprom.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <filesystem>

namespace margay::ethercat {
namespace {

Answer<Session::FileTransfer> transfer_of(const Call& call, std::string name) {
    const auto password = call.option_number("password", 0, UINT32_MAX);
    if (!password) return password.problem();
    return Session::FileTransfer{
        .name = std::move(name), .password = static_cast<std::uint32_t>(*password), .boot = call.has("boot")};
}

Answer<> write_one_alias(const Call& call, const SelectedSlave& slave, std::uint16_t alias, Output& output) {
    SessionEeprom eeprom(slave.session(), slave.position());
    const auto report = samples::write_alias(eeprom, alias, call.has("force"));
    if (!report.error.empty()) return eeprom.problem(report.error);
    if (call.has("verbose"))
        output.text += fmt::format("Slave {}: alias {}, it was {}\n", slave.position(), report.after, report.before);
    output.json["slaves"].push_back(
        {{"position", slave.position()}, {"before", report.before}, {"after", report.after}});
    return {};
}

}  // namespace

int run_foe_read(Call& call) {
    const auto transfer = transfer_of(call, call.words()[0]);
    if (!transfer) return call.fail(transfer.problem());
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const auto content = slave->session().foe_read(slave->position(), *transfer);
    if (!content) return call.fail(content.problem());
    Output output;
    output.json = place_json(*slave);
    output.json["name"] = transfer->name;
    output.json["octets"] = hex(*content);
    return call.print(output, *content);
}

int run_foe_write(Call& call) {
    const auto& path = call.words()[0];
    if (path == "-" && !call.has("output-file"))
        return call.fail({"standard input has no name: --output-file is the name of the file in the slave",
                          samples::exit_code::kUsage});
    const auto name =
        call.has("output-file") ? call.value("output-file") : std::filesystem::path(path).filename().string();
    const auto transfer = transfer_of(call, name);
    if (!transfer) return call.fail(transfer.problem());
    const auto content = read_octets(path);
    if (!content) return call.fail(content.problem());
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const auto done = slave->session().foe_write(slave->position(), *transfer, *content);
    if (!done) return call.fail(done.problem());
    Output output;
    output.json = place_json(*slave);
    output.json["name"] = name;
    output.json["bytes"] = content->size();
    if (call.has("verbose"))
        output.text = fmt::format("{}: {} written\n", name, samples::counted(content->size(), "octet"));
    return call.print(output);
}

int run_sii_read(Call& call) {
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    SessionEeprom eeprom(slave->session(), slave->position());
    const auto content = samples::read_used_part(eeprom, samples::no_progress());
    if (!content.error.empty()) return call.fail(eeprom.problem(content.error));
    Output output;
    output.json = place_json(*slave);
    output.json["octets"] = hex(content.octets);
    output.text = samples::sii_text_of_used_part(content.octets);
    return call.print(output, call.has("verbose") ? std::as_bytes(std::span(output.text)) : std::span(content.octets));
}

int run_sii_write(Call& call) {
    const auto image = samples::load_image(call.words()[0]);
    if (!image.error.empty()) return call.fail({image.error, samples::exit_code::kSystem});
    if (image.octets.size() % 2 != 0)
        return call.fail({fmt::format("{}: {} not a whole number of words", call.words()[0],
                                      samples::counted(image.octets.size(), "octet is", "octets are"))});
    const auto fault = call.has("force") ? std::string() : samples::image_fault(image.octets);
    if (!fault.empty())
        return call.fail({fmt::format("{}: {}: use --force to write it nevertheless", call.words()[0], fault)});
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    SessionEeprom eeprom(slave->session(), slave->position());
    const auto size = samples::eeprom_size(eeprom);  // the size of a blank EEPROM is unknown
    if (!call.has("force") && size.error.empty() && image.octets.size() > size.octets)
        return call.fail(
            {fmt::format("{}: it has {}, the EEPROM of {} has {}: use --force to write it nevertheless",
                         call.words()[0], samples::counted(image.octets.size(), "octet"), eeprom.name(), size.octets)});
    const auto report = samples::write_eeprom(eeprom, image.octets, samples::no_progress());
    if (!report.error.empty())
        return call.fail(eeprom.problem(report.error + (report.left.empty() ? "" : "; " + report.left)));
    Output output;
    output.json = place_json(*slave);
    output.json["words"] = report.words;
    output.json["changed"] = report.different;
    if (call.has("verbose"))
        output.text = fmt::format("{}, {} of them changed\n", samples::counted(report.words, "word"), report.different);
    return call.print(output);
}

int run_alias(Call& call) {
    const auto alias = Call::number("ALIAS", call.words()[0], 0xFFFF);
    if (!alias) return call.fail(alias.problem());
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto selected = call.some_selected(master);
        if (!selected) return selected.problem();
        if (selected->size() > 1 && !call.has("force"))
            return Problem{
                fmt::format("{} slaves are selected: use --force to write the alias of all of them", selected->size()),
                samples::exit_code::kUsage};
        output.json["slaves"] = nlohmann::ordered_json::array();
        for (const SlaveFacts& slave : *selected) {
            const auto done = write_one_alias(call, {&master, slave}, static_cast<std::uint16_t>(*alias), output);
            if (!done) return done;
        }
        return {};
    });
}

}  // namespace margay::ethercat
