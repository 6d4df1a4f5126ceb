// slaveinfo: prints the slaves of a segment, their process image and their object dictionaries.
#include "common/counted.hpp"
#include "common/dictionary_report.hpp"
#include "common/json_text.hpp"
#include "common/new_file.hpp"
#include "common/process_map.hpp"
#include "common/process_struct.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "common/xml_files.hpp"

#include <margay/files/esi.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace {

struct Options {
    margay::samples::SourceArguments source;
    bool json = false;
    bool map = false;
    bool cstruct = false;
    bool packed = false;
    bool sdo = false;
    std::string eni{};
    std::string write_eni{};
    std::string write_esi{};
};

bool has_coe(const margay::Slave& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & margay::mailbox_protocol::kCoE) != 0;
}

// The process image of a group.
struct GroupMap {
    std::size_t group = 0;
    margay::samples::ProcessMap map{};
};

// An ENI with several Cyclic elements has a group with its own image for each of them.
void add_maps(margay::Context& ctx, nlohmann::ordered_json& segment, const std::vector<GroupMap>& maps) {
    using margay::samples::map_json;
    if (maps.size() == 1) segment["process_image"] = map_json(ctx, maps[0].map);
    if (maps.size() < 2) return;
    for (const auto& [group, map] : maps) {
        nlohmann::ordered_json one{{"group", group}};
        one.update(map_json(ctx, map));
        segment["process_images"].push_back(std::move(one));
    }
}

void print_segment(margay::Context& ctx, const Options& options, const std::vector<GroupMap>& maps) {
    using namespace margay::samples;
    if (options.cstruct && !maps.empty()) {
        write_out(map_cstruct(ctx, maps[0].map));
        return;
    }
    if (options.json) {
        auto segment = segment_json(ctx);
        add_maps(ctx, segment, maps);
        for (const margay::Slave& slave : ctx.slaves())
            if (options.sdo && has_coe(slave))
                segment["slaves"][slave.number - 1U]["dictionary"] =
                    dictionary_json(read_dictionary(ctx, slave.number));
        write_out(json_text(segment));
        return;
    }
    print_out("{} found\n\n", counted(ctx.slaves().size(), "slave"));
    for (const margay::Slave& slave : ctx.slaves()) {
        write_out(slave_text(slave));
        if (options.sdo && has_coe(slave)) write_out(dictionary_text(read_dictionary(ctx, slave.number)));
        write_out("\n");
    }
    write_out(topology_text(ctx));
    for (const auto& [group, map] : maps)
        write_out("\n" + (maps.size() == 1 ? std::string() : fmt::format("Group {}: ", group)) + map_text(ctx, map));
}

int save(const std::string& path, const margay::files::Written& written) {
    using namespace margay::samples;
    if (!written) return fail(written.error);
    for (const std::string& remark : written.remarks) warn("warning: " + remark);
    NewFile file(path);
    std::string error = file.write(written.text);
    if (error.empty()) error = file.commit();
    return error.empty() ? 0 : fail(error, exit_code::kSystem);
}

// Maps all slaves, which puts them to SAFEOP, prints the process image, and puts the slaves back to PREOP.
int map_and_print(margay::Context& ctx, const Options& options, const margay::files::EniConfiguration* eni) {
    using namespace margay::samples;
    std::vector<std::byte> image(std::size_t{1} << 20);
    if (options.packed) ctx.group(0).config.packing = margay::Packing::bits;
    const auto mapped = map_groups(ctx, eni, image);
    std::vector<GroupMap> maps;
    for (std::size_t n = 0; n < ctx.limits().groups; ++n)
        if (ctx.group(n).mapped) maps.push_back({n, read_process_map(ctx, static_cast<std::uint8_t>(n))});
    if (maps.empty() && !mapped) return fail(sentence(mapped.error()));
    if (options.cstruct && maps.size() > 1)
        return fail("--cstruct describes one process image, and the ENI has several Cyclic elements");
    print_segment(ctx, options, maps);
    const int status = options.write_eni.empty() ? 0 : save(options.write_eni, margay::files::write_eni(ctx));
    const auto back = margay::writestate(ctx, 0, margay::AlState::preop);
    return back || status != 0 ? status : fail(sentence(back.error()));
}

// All slaves that were read, each kind once. The vendor of the file is that of the first slave.
int write_esi(margay::Context& ctx, const std::string& path) {
    using namespace margay;
    files::EsiFile esi;
    for (const Slave& slave : ctx.slaves()) {
        auto device = files::describe_slave(ctx, slave.number);
        if (!device) {
            samples::warn(fmt::format("slave {}: {}", slave.number, to_text(device.problem)));
            continue;
        }
        if (esi.devices.empty()) esi.vendor = device->identity.vendor;  // an EEPROM without an identity has vendor 0
        const bool other = device->identity.vendor != esi.vendor;
        if (other)
            samples::warn(fmt::format("slave {} is of another vendor, and an ESI has one: left out", slave.number));
        if (!other && !samples::has_device(esi, device->identity)) esi.devices.push_back(std::move(*device));
    }
    esi.vendor_name = fmt::format("Vendor 0x{:08x}", esi.vendor);
    return save(path, files::write_esi(esi));
}

int scan_and_print(margay::samples::Source& source, const Options& options) {
    using namespace margay::samples;
    EniFile eni;
    if (!options.eni.empty()) eni = load_eni(options.eni);
    if (!eni.error.empty()) return fail(eni.error, exit_code::kSystem);
    const auto* plan = eni.configuration ? &*eni.configuration : nullptr;
    margay::HostContext ctx(source.limits(with_room({.slaves = 2048, .process_frames = 256}, plan)));
    const auto ready = source.begin(ctx);
    if (!ready) return fail(sentence(ready.error()));
    const auto found = scan_by(ctx, plan);
    if (!found && found.error().slave == 0) return fail(sentence(found.error()));
    int status = 0;
    if (!options.write_esi.empty()) status = write_esi(ctx, options.write_esi);
    if (status != 0) return status;
    if (options.map || !options.write_eni.empty())
        status = map_and_print(ctx, options, plan);
    else
        print_segment(ctx, options, {});
    bool told = found.ok();
    while (const auto error = ctx.errors().take()) {
        told |= *error == found.error();
        warn(sentence(*error));
        status = exit_code::kSegment;
    }
    if (!told) status = fail(sentence(found.error()));
    while (const auto odd = ctx.warnings().take()) warn("warning: " + sentence(*odd));
    if (const auto ring = ring_remark(ctx); !ring.empty()) warn("warning: " + ring);
    return status;
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    margay::samples::Arguments arguments("slaveinfo",
                                         "Finds all slaves, puts them to PREOP and prints their properties.");
    add_source_arguments(arguments, options.source);
    arguments.flag("--json", options.json, "print JSON for programs");
    arguments.flag("--map", options.map,
                   "map the process data (slaves go to SAFEOP and back) and print the layout of the process image");
    arguments.flag("--sdo", options.sdo,
                   "read the object dictionary of every slave that has CoE, with values, and print it");
    arguments.flag("--cstruct", options.cstruct, "print the image as a header with a struct for C and C++", "--map");
    arguments.flag("--packed", options.packed, "pack process data bit by bit", "--map");
    arguments.option("--eni", options.eni, "expect and configure the slaves as this ENI file says");
    arguments.option("--write-eni", options.write_eni,
                     "write the segment as an ENI file (slaves go to SAFEOP and back)");
    arguments.option("--write-esi", options.write_esi, "write the slaves as an ESI file, by their SII and dictionary");
    return arguments.run(argc, argv, [&] {
        if (options.json && options.cstruct)
            return margay::samples::fail("--json and --cstruct are two forms of output: give one of them",
                                         margay::samples::exit_code::kUsage);
        return run_on_source(options.source,
                             [&](margay::samples::Source& source) { return scan_and_print(source, options); });
    });
}
