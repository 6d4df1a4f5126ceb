// slaveinfo: what is on the segment.
#include "common/slave_report.hpp"
#include "common/source.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <string>

namespace {

struct Options {
    std::string source;
    std::string record;
    bool json = false;
    bool trace = false;
};

int print_error(const std::string& text) {
    fmt::print(stderr, "slaveinfo: {}\n", text);
    return 1;
}

void print_segment(margay::Context& ctx, const Options& options) {
    using namespace margay::samples;
    if (options.json) {
        fmt::print("{}\n", segment_json(ctx).dump(2));
        return;
    }
    fmt::print("{} slave{} found\n\n", ctx.slaves().size(), ctx.slaves().size() == 1 ? "" : "s");
    for (const margay::Slave& slave : ctx.slaves()) fmt::print("{}\n", slave_text(slave));
    fmt::print("{}", topology_text(ctx));
}

int scan_and_print(margay::samples::Source& source, const Options& options) {
    using margay::samples::sentence;
    margay::HostContext ctx(margay::Limits{.slaves = 2048});
    const auto ready = margay::init(ctx, source.nic(), source.osal());
    if (!ready) return print_error(sentence(ready.error()));
    const auto found = margay::config_init(ctx);
    if (!found) return print_error(sentence(found.error()));
    print_segment(ctx, options);
    while (const auto error = ctx.errors().take()) (void)print_error(sentence(*error));
    return 0;
}

int run(const Options& options) {
    auto source =
        margay::samples::open_source(options.source, {.record = options.record, .trace = options.trace});
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
    CLI11_PARSE(app, argc, argv);
    return run(options);
}
