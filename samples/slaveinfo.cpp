// slaveinfo: what is on the segment.
#include "common/dictionary_report.hpp"
#include "common/process_map.hpp"
#include "common/process_struct.hpp"
#include "common/slave_report.hpp"
#include "common/source.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <string>
#include <vector>

namespace {

struct Options {
    std::string source;
    std::string record;
    bool json = false;
    bool trace = false;
    bool map = false;
    bool cstruct = false;
    bool packed = false;
    bool sdo = false;
};

int print_error(const std::string& text) {
    fmt::print(stderr, "slaveinfo: {}\n", text);
    return 1;
}

bool has_coe(const margay::Slave& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & margay::mailbox_protocol::kCoE) != 0;
}

void print_segment(margay::Context& ctx, const Options& options, const margay::samples::ProcessMap* map) {
    using namespace margay::samples;
    if (options.cstruct && map != nullptr) {
        fmt::print("{}", map_cstruct(ctx, *map));
        return;
    }
    if (options.json) {
        auto segment = segment_json(ctx);
        if (map != nullptr) segment["process_image"] = map_json(ctx, *map);
        for (const margay::Slave& slave : ctx.slaves())
            if (options.sdo && has_coe(slave))
                segment["slaves"][slave.position - 1U]["dictionary"] =
                    dictionary_json(read_dictionary(ctx, slave.position));
        fmt::print("{}\n", segment.dump(2));
        return;
    }
    fmt::print("{} slave{} found\n\n", ctx.slaves().size(), ctx.slaves().size() == 1 ? "" : "s");
    for (const margay::Slave& slave : ctx.slaves()) {
        fmt::print("{}", slave_text(slave));
        if (options.sdo && has_coe(slave)) fmt::print("{}", dictionary_text(read_dictionary(ctx, slave.position)));
        fmt::print("\n");
    }
    fmt::print("{}", topology_text(ctx));
    if (map != nullptr) fmt::print("\n{}", map_text(ctx, *map));
}

// Maps all slaves, which go to SAFEOP for it, and lets them go back.
int map_and_print(margay::Context& ctx, const Options& options) {
    using namespace margay::samples;
    std::vector<std::byte> image(std::size_t{1} << 20);
    if (options.packed) ctx.group(0).config.packing = margay::Packing::bits;
    const auto mapped = margay::config_map(ctx, image);
    if (!mapped) return print_error(sentence(mapped.error()));
    const ProcessMap map = read_process_map(ctx);
    print_segment(ctx, options, &map);
    (void)margay::writestate(ctx, 0, margay::AlState::preop);
    return 0;
}

int scan_and_print(margay::samples::Source& source, const Options& options) {
    using margay::samples::sentence;
    margay::HostContext ctx(margay::Limits{.slaves = 2048, .process_frames = 256});
    const auto ready = margay::init(ctx, source.nic(), source.osal());
    if (!ready) return print_error(sentence(ready.error()));
    const auto found = margay::config_init(ctx);
    if (!found) return print_error(sentence(found.error()));
    int status = 0;
    if (options.map)
        status = map_and_print(ctx, options);
    else
        print_segment(ctx, options, nullptr);
    while (const auto error = ctx.errors().take()) (void)print_error(sentence(*error));
    while (const auto odd = ctx.warnings().take()) (void)print_error("warning: " + sentence(*odd));
    return status;
}

int run(const Options& options) {
    auto source = margay::samples::open_source(options.source, {.record = options.record, .trace = options.trace});
    if (!source) return print_error(source.error());
    const int status = scan_and_print(*source, options);
    const std::string remark = source->finish();
    return remark.empty() ? status : print_error(remark);
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    CLI::App app{"Finds all slaves, reads what they are, brings them to PREOP and prints it."};
    app.add_option("source", options.source,
                   "interface (eth0), simulated segment (sim:demo, sim:FILE, sim:a.bin,b.bin) or recording "
                   "(pcap:FILE)")
        ->required();
    app.add_flag("--json", options.json, "print JSON for programs");
    app.add_option("--record", options.record, "write every frame sent and received to this file, as pcap");
    app.add_flag("--trace", options.trace, "print a line for every datagram to standard error");
    auto* map =
        app.add_flag("--map", options.map,
                     "map the process data (slaves go to SAFEOP and back) and print what lies where in the image");
    app.add_flag("--sdo", options.sdo,
                 "read the object dictionary of every slave that has CoE, with values, and print it");
    app.add_flag("--cstruct", options.cstruct, "print the image as a header with a struct for C and C++")->needs(map);
    app.add_flag("--packed", options.packed, "lay out bits without gaps")->needs(map);
    CLI11_PARSE(app, argc, argv);
    return run(options);
}
