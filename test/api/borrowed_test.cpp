// The library borrows configuration data, so passing a temporary does not compile. A helper for hosted systems owns a
// copy of the data.
#include "segment/bench.hpp"

#include <margay/host_configuration.hpp>

#include <type_traits>

namespace margay {
namespace {

template <class List>
concept SetupFrom = requires(List&& list) {
    SlaveSetup{.pdos = std::forward<List>(list)};
};
template <class List>
concept ExpectedFrom = requires(Context& ctx, List&& list) {
    expect(ctx, std::forward<List>(list));
};

TEST(Borrowed, ATemporaryListIsRefusedByTheCompiler) {
    EXPECT_TRUE((SetupFrom<const std::array<SmPdos, 2>&>));
    EXPECT_TRUE((SetupFrom<std::vector<SmPdos>&>));
    EXPECT_TRUE((SetupFrom<std::span<const SmPdos>>));
    EXPECT_TRUE((SetupFrom<const SmPdos(&)[2]>));
    EXPECT_FALSE((SetupFrom<std::array<SmPdos, 2>>));
    EXPECT_FALSE((SetupFrom<std::vector<SmPdos>>));
    EXPECT_FALSE((SetupFrom<SmPdos[2]>));
    EXPECT_TRUE((ExpectedFrom<std::vector<ExpectedSlave>&>));
    EXPECT_FALSE((ExpectedFrom<std::vector<ExpectedSlave>>));
    EXPECT_FALSE((std::is_constructible_v<Borrowed<std::byte>, std::vector<std::byte>>));
}

// The expressions are in a template, because an invalid expression outside a template is a compile error.
template <class List, class Element>
concept FromBraces = requires(List list, Element element) {
    list = {{element}};
};
template <class List, class Element>
concept FromTwoInBraces = requires(List list, Element element) {
    list = {{element, element}};
};
template <class Setup>
concept SetupFromBraces = requires {
    Setup{.startup = {{write_object(Transition::preop_to_safeop, 0x6060, 0, std::int8_t{8})}}};
};
template <class Setup, class Element>
concept SetupFromBracedPdos = requires(Element element) {
    Setup{.pdos = {{element}}};
};
template <class OfPdo, class Entry>
concept PdoFromBraces = requires(Entry entry) {
    OfPdo{0x1600, {{entry}}};
};
template <class Ctx, class Element>
concept ExpectedFromBraces = requires(Ctx& ctx, Element element) {
    expect(ctx, {{element}});
};

TEST(Borrowed, AListInBracesIsRefusedByTheCompiler) {
    EXPECT_FALSE((FromBraces<Borrowed<SmPdos>, SmPdos>));
    EXPECT_FALSE((FromTwoInBraces<Borrowed<SmPdos>, SmPdos>));
    EXPECT_FALSE((FromBraces<PdoLists, SmPdos>));
    EXPECT_FALSE((FromTwoInBraces<StartupCommands, StartupCommand>));
    EXPECT_FALSE((FromBraces<EntryList, EntryHandle*>));
    EXPECT_FALSE((FromTwoInBraces<EntryList, EntryHandle*>));
    EXPECT_FALSE((FromTwoInBraces<decltype(SdoDownload::data), std::byte>));
    EXPECT_FALSE((FromBraces<decltype(GroupConfiguration::copies), SlaveToSlave>));
    EXPECT_FALSE((SetupFromBraces<SlaveSetup>));
    EXPECT_FALSE((SetupFromBracedPdos<SlaveSetup, SmPdos>));
    EXPECT_FALSE((PdoFromBraces<Pdo, PdoEntry>));
    EXPECT_FALSE((ExpectedFromBraces<Context, ExpectedSlave>));
    Borrowed<SmPdos> none = {};
    none = {};
    EXPECT_TRUE(none.empty());
    EXPECT_TRUE((requires(Context & ctx) { expect(ctx, {}); }));
}

class HostConfigurationTest : public SegmentTest {};

TEST_F(HostConfigurationTest, OwnsAllThatItPointsAt) {
    HostConfiguration plan;
    for (std::uint16_t number = 1; number <= 3; ++number) {
        std::vector<PdoEntry> entries{{0x7000, 1, 16}, {0x7000, 2, static_cast<std::uint8_t>(8 * number)}};
        std::vector<Pdo> outputs{{0x1600, entries}};
        std::vector<SmPdos> pdos{{2, outputs}};
        std::vector<std::byte> data(12, static_cast<std::byte>(number));
        std::vector<StartupCommand> commands{write_register(Transition::init_to_preop, 0x0F80, data)};
        SlaveSetup setup{.pdos = pdos, .startup = commands};
        SlaveConfiguration config;
        config.setup = &setup;
        plan.add({.number = number}, config);
        // The data are overwritten before they are destroyed.
        std::ranges::fill(data, std::byte{0xEE});
        entries.assign(2, PdoEntry{});
        setup = {};
    }
    ASSERT_EQ(plan.expected().size(), 3U);
    for (std::uint16_t number = 1; number <= 3; ++number) {
        const SlaveSetup& setup = *plan.expected()[number - 1U].config->setup;
        ASSERT_EQ(setup.pdos.size(), 1U);
        ASSERT_EQ(setup.pdos[0].pdos.size(), 1U);
        EXPECT_EQ(setup.pdos[0].pdos[0].entries[1], (PdoEntry{0x7000, 2, static_cast<std::uint8_t>(8 * number)}));
        ASSERT_EQ(setup.startup[0].octets().size(), 12U);
        EXPECT_EQ(setup.startup[0].octets()[11], static_cast<std::byte>(number));
    }
    for (int n = 0; n < 3; ++n) plug("coupler");
    switch_on();
    ASSERT_TRUE(init(ctx, wire, osal));
    ASSERT_TRUE(expect(ctx, plan.expected()));
    ASSERT_TRUE(config_init(ctx));
    EXPECT_EQ(ctx.slave(2).config.setup, plan.expected()[1].config->setup);
}

}  // namespace
}  // namespace margay
