// slaveinfo: prints the slaves of a segment, their process image and their object dictionaries.
#include "common/dictionary_report.hpp"
#include "common/process_map.hpp"
#include "common/process_struct.hpp"
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"

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
};

bool has_coe(const margay::Slave& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & margay::mailbox_protocol::kCoE) != 0;
}

void print_segment(margay::Context& ctx, const Options& options, const margay::samples::ProcessMap* map) {
    using namespace margay::samples;
    if (options.cstruct && map != nullptr) {
        write_out(map_cstruct(ctx, *map));
        return;
    }
    if (options.json) {
        auto segment = segment_json(ctx);
        if (map != nullptr) segment["process_image"] = map_json(ctx, *map);
        for (const margay::Slave& slave : ctx.slaves())
            if (options.sdo && has_coe(slave))
                segment["slaves"][slave.number - 1U]["dictionary"] =
                    dictionary_json(read_dictionary(ctx, slave.number));
        write_out(segment.dump(2) + "\n");
        return;
    }
    print_out("{} slave{} found\n\n", ctx.slaves().size(), ctx.slaves().size() == 1 ? "" : "s");
    for (const margay::Slave& slave : ctx.slaves()) {
        write_out(slave_text(slave));
        if (options.sdo && has_coe(slave)) write_out(dictionary_text(read_dictionary(ctx, slave.number)));
        write_out("\n");
    }
    write_out(topology_text(ctx));
    if (map != nullptr) write_out("\n" + map_text(ctx, *map));
}

// Maps all slaves, which puts them to SAFEOP, prints the process image, and puts the slaves back to PREOP.
int map_and_print(margay::Context& ctx, const Options& options) {
    using namespace margay::samples;
    std::vector<std::byte> image(std::size_t{1} << 20);
    if (options.packed) ctx.group(0).config.packing = margay::Packing::bits;
    const auto mapped = margay::config_map(ctx, image);
    if (!mapped && !ctx.group(0).mapped) return fail(sentence(mapped.error()));
    const ProcessMap map = read_process_map(ctx);
    print_segment(ctx, options, &map);
    (void)margay::writestate(ctx, 0, margay::AlState::preop);
    return 0;
}

int scan_and_print(margay::samples::Source& source, const Options& options) {
    using namespace margay::samples;
    margay::HostContext ctx(source.limits(margay::Limits{.slaves = 2048, .process_frames = 256}));
    const auto ready = source.begin(ctx);
    if (!ready) return fail(sentence(ready.error()));
    const auto found = margay::config_init(ctx);
    if (!found && found.error().slave == 0) return fail(sentence(found.error()));
    int status = 0;
    if (options.map)
        status = map_and_print(ctx, options);
    else
        print_segment(ctx, options, nullptr);
    while (const auto error = ctx.errors().take()) {
        warn(sentence(*error));
        status = exit_code::kSegment;
    }
    while (const auto odd = ctx.warnings().take()) warn("warning: " + sentence(*odd));
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
    return arguments.run(argc, argv, [&] {
        return run_on_source(options.source,
                             [&](margay::samples::Source& source) { return scan_and_print(source, options); });
    });
}
