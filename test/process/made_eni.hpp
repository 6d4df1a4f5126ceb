// ENI files that are made of a simulated segment.
#pragma once

#include "common/source.hpp"

#include <margay/expected.hpp>
#include <margay/files/eni.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <vector>

namespace margay::process {

// An ENI with SYNC0 in one slave. `reference`: the slave with the reference clock; 0: the first clock.
inline std::string clocked_eni(const std::string& segment, std::uint16_t slave, Duration cycle,
                               std::uint16_t reference = 0) {
    static constexpr SlaveSetup kSetup{
        .dc = {.source = SyncSettings::Source::application, .shift = std::chrono::microseconds(100)}};
    auto source = samples::open_source(segment);
    EXPECT_TRUE(source) << source.error();
    HostContext ctx;
    std::vector<std::byte> image(4096);
    EXPECT_TRUE(source->begin(ctx));
    EXPECT_TRUE(config_init(ctx));
    ctx.slave(slave).config.setup = &kSetup;
    EXPECT_TRUE(configdc(ctx, {.reference = reference, .cycle = cycle}));
    EXPECT_TRUE(config_map(ctx, image));
    const auto written = files::write_eni(ctx, {.cycle = cycle});
    EXPECT_TRUE(written) << written.error;
    return written.text;
}

// An ENI with two drives, each in a Cyclic element of its own. The first drive has a start-up command for 0x6060.
inline std::string eni_of_two_groups() {
    static constexpr StartupCommand kCommands[] = {
        write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8})};
    static constexpr SlaveSetup kSetup{.startup = kCommands};
    auto source = samples::open_source("sim:drive,drive");
    EXPECT_TRUE(source) << source.error();
    HostContext ctx(Limits{.groups = 2});
    std::vector<std::byte> image(4096);
    EXPECT_TRUE(source->begin(ctx));
    EXPECT_TRUE(config_init(ctx));
    ctx.slave(1).config.setup = &kSetup;
    ctx.slave(2).config.group = 1;
    const auto used = config_map(ctx, image, 0);
    EXPECT_TRUE(used);
    EXPECT_TRUE(config_map(ctx, std::span(image).subspan(used ? *used : 0), 1));
    const auto written = files::write_eni(ctx);
    EXPECT_TRUE(written) << written.error;
    return written.text;
}

// An ENI with a hot connect group of the last `members` slaves. The alias of the first of them identifies the group.
inline std::string eni_with_group(const std::string& segment, std::uint16_t slaves, std::uint16_t alias,
                                  std::uint16_t members = 1) {
    std::vector<ExpectedSlave> list(slaves);
    const auto first = static_cast<std::uint16_t>(slaves - members);
    for (std::uint16_t n = 0; n < first; ++n) list[n].number = static_cast<std::uint16_t>(n + 1);
    for (std::uint16_t n = first; n < slaves; ++n) list[n].hot_connect = 1;
    list[first].alias = alias;
    auto source = samples::open_source("sim:" + segment);
    EXPECT_TRUE(source) << source.error();
    HostContext ctx;
    std::vector<std::byte> image(4096);
    EXPECT_TRUE(source->begin(ctx));
    EXPECT_TRUE(expect(ctx, list));
    EXPECT_TRUE(config_init(ctx));
    EXPECT_TRUE(config_map(ctx, image));
    const auto written = files::write_eni(ctx);
    EXPECT_TRUE(written) << written.error;
    return written.text;
}

}  // namespace margay::process
