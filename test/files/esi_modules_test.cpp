// A modular device by its ESI: the configuration with the modules in its slots, on the simulated device.
#include <margay/files/esi.hpp>
#include <margay/host_configuration.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include "files/modules.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"

#include <gtest/gtest.h>

namespace margay::files {
namespace {

using namespace std::chrono_literals;

// The device "modular_io" as its manufacturer describes it.
constexpr std::string_view kCoupler = R"(<?xml version="1.0"?>
<EtherCATInfo>
  <Vendor><Id>#x4D47</Id><Name>Margay</Name></Vendor>
  <Descriptions>
    <Devices><Device Physics="YY">
      <Type ProductCode="#x5030" RevisionNo="1">MG5030</Type><Name>Coupler with four slots</Name>
      <Sm StartAddress="#x1000" DefaultSize="128" ControlByte="#x26" Enable="1">MBoxOut</Sm>
      <Sm StartAddress="#x1100" DefaultSize="128" ControlByte="#x22" Enable="1">MBoxIn</Sm>
      <Sm StartAddress="#x1200" ControlByte="#x64" Enable="1">Outputs</Sm>
      <Sm StartAddress="#x1300" ControlByte="#x20" Enable="1">Inputs</Sm>
      <Mailbox><CoE SdoInfo="1" CompleteAccess="1"/></Mailbox>
      <Slots MaxSlotCount="4" SlotPdoIncrement="1" SlotIndexIncrement="#x10" DownloadModuleIdentList="1">
        <Slot MinInstances="0" MaxInstances="4"><Name>Slot</Name>
          <ModuleIdent>#x104</ModuleIdent><ModuleIdent>#x208</ModuleIdent>
          <ModuleIdent>#x302</ModuleIdent><ModuleIdent>#x401</ModuleIdent></Slot>
      </Slots>
    </Device></Devices>
    <Modules>
      <Module><Type ModuleIdent="#x104">LAMPS</Type><Name>4 lamps</Name>
        <RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index><Name>Lamps</Name>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen>
            <Name>Lamp 1</Name><DataType>BOOL</DataType></Entry>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>2</SubIndex><BitLen>1</BitLen>
            <Name>Lamp 2</Name><DataType>BOOL</DataType></Entry>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>3</SubIndex><BitLen>1</BitLen>
            <Name>Lamp 3</Name><DataType>BOOL</DataType></Entry>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>4</SubIndex><BitLen>1</BitLen>
            <Name>Lamp 4</Name><DataType>BOOL</DataType></Entry></RxPdo>
      </Module>
      <Module><Type ModuleIdent="#x208">KEYS</Type><Name>8 keys</Name>
        <TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index><Name>Keys</Name>
          <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen>
            <Name>Keys</Name><DataType>USINT</DataType></Entry></TxPdo>
      </Module>
      <Module><Type ModuleIdent="#x302">METERS</Type><Name>2 meters</Name>
        <TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index><Name>Levels</Name>
          <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen>
            <Name>Level 1</Name><DataType>INT</DataType></Entry>
          <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>2</SubIndex><BitLen>16</BitLen>
            <Name>Level 2</Name><DataType>INT</DataType></Entry></TxPdo>
        <Mailbox><CoE><InitCmd><Transition>PS</Transition>
            <Index DependOnSlot="1">#x8000</Index><SubIndex>2</SubIndex><Data>F6FF</Data></InitCmd></CoE></Mailbox>
      </Module>
      <Module><Type ModuleIdent="#x401">COUNTER</Type><Name>Counter</Name>
        <TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A00</Index><Name>Count</Name>
          <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>32</BitLen>
            <Name>Count</Name><DataType>UDINT</DataType></Entry></TxPdo>
        <RxPdo Fixed="1" Sm="2"><Index DependOnSlot="1">#x1600</Index><Name>Preset</Name>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>1</SubIndex><BitLen>32</BitLen>
            <Name>Preset</Name><DataType>UDINT</DataType></Entry></RxPdo>
      </Module>
    </Modules>
  </Descriptions>
</EtherCATInfo>)";

// A master and the device, in PREOP.
struct CouplerBench {
    sim::Segment segment;
    VirtualOsal osal;
    SimulatedNic nic{segment, osal};
    HostContext ctx{Limits{.slaves = 4}};
    HostConfiguration owner;
    std::vector<std::byte> image = std::vector<std::byte>(256);

    CouplerBench() {
        segment.add(sim::make_device("modular_io").value().assemble());
        EXPECT_TRUE(segment.connect_master({0, 0}));
        segment.power_up(osal.now());
        EXPECT_TRUE(init(ctx, nic, osal).ok());
        EXPECT_TRUE(config_init(ctx).ok());
    }
    // Configures the device with these modules, and goes to SAFEOP.
    AlStatus map(const std::vector<std::uint32_t>& modules) {
        const auto esi = read_esi(kCoupler);
        EXPECT_TRUE(esi) << to_text(esi.problem);
        if (!esi) return {};
        const auto made = configure(*esi, esi->devices[0], {.modules = modules}, owner);
        EXPECT_NE(made.config, nullptr) << made.error;
        if (made.config == nullptr) return {};
        const ExpectedSlave expected[] = {{.number = 1, .config = made.config}};
        EXPECT_TRUE(expect(ctx, expected).ok());
        (void)config_init(ctx);  // 0xF030 is written in INIT→PREOP
        (void)config_map(ctx, image);
        return ctx.slave(1).al;
    }
};

TEST(EsiModules, TheModulesOfTheFileAreMapped) {
    CouplerBench bench;
    EXPECT_EQ(check_modules(bench.ctx, 1, std::array<std::uint32_t, 4>{0x104, 0x208, 0x302, 0x401}), "");
    ASSERT_EQ(bench.map({0x104, 0x208, 0x302, 0x401}), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(bench.ctx.slave(1).image.outputs.bytes.size(), 5U);
    EXPECT_EQ(bench.ctx.slave(1).image.inputs.bytes.size(), 9U);
    EXPECT_EQ(*SDOread<std::uint32_t>(bench.ctx, 1, 0xF030, 3, 1s), 0x302U);
    EXPECT_EQ(*SDOread<std::int16_t>(bench.ctx, 1, 0x8020, 2, 1s), -10) << "the command of the module in slot 3";
}

TEST(EsiModules, OtherModulesAreRefused) {
    CouplerBench bench;
    EXPECT_EQ(check_modules(bench.ctx, 1, std::array<std::uint32_t, 3>{0x104, 0x302, 0x208}),
              "slave 1, slot 1: module 0x00000208 is there, and 0x00000302 is wanted");
    EXPECT_NE(bench.map({0x104, 0x302, 0x208, 0x401}).state, AlState::safeop);
    EXPECT_NE(bench.ctx.slave(1).error.code, Errc::none);
}

// The idents that the commands of a configuration write to 0xF030.
std::vector<std::uint32_t> written(const EsiConfiguration& made) {
    EXPECT_NE(made.config, nullptr) << made.error;
    return made.config == nullptr ? std::vector<std::uint32_t>{} : configured_modules(made.config->startup());
}

TEST(EsiModules, WithoutAChoiceASlotHasAsManyModulesAsItDemands) {
    const std::string_view slot =
        R"(<Slot MinInstances="0" MaxInstances="4"><Name>Slot</Name>
          <ModuleIdent>#x104</ModuleIdent><ModuleIdent>#x208</ModuleIdent>
          <ModuleIdent>#x302</ModuleIdent><ModuleIdent>#x401</ModuleIdent></Slot>)";
    const auto with = [&](std::string_view slots) {
        std::string text(kCoupler);
        const auto at = text.find(slot);
        EXPECT_NE(at, std::string::npos);
        text.replace(at, slot.size(), slots);
        const auto esi = read_esi(text);
        EXPECT_TRUE(esi) << to_text(esi.problem);
        HostConfiguration owner;
        return esi ? written(configure(*esi, esi->devices[0], {}, owner)) : std::vector<std::uint32_t>{};
    };
    using Idents = std::vector<std::uint32_t>;
    EXPECT_EQ(with(slot), Idents{});
    EXPECT_EQ(with(R"(<Slot MinInstances="1" MaxInstances="4"><ModuleIdent>#x104</ModuleIdent></Slot>)"),
              Idents{0x104});
    EXPECT_EQ(with(R"(<Slot MinInstances="0" MaxInstances="1"><ModuleIdent>#x208</ModuleIdent></Slot>
                      <Slot MinInstances="2" MaxInstances="3"><ModuleIdent>#x104</ModuleIdent></Slot>)"),
              (Idents{0, 0x104, 0x104}));
}

// The PDOs of the modules name no SyncManager. The SyncManagers of the device have names of their own. Then the
// SyncManager of the inputs is missing.
TEST(EsiModules, PdosWithoutSyncManagerHaveTheUsualOneOrAreAnError) {
    std::string text(kCoupler);
    const auto replace = [&](std::string_view from, std::string_view to) {
        for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
            text.replace(at, from.size(), to);
    };
    replace(R"( Sm="2")", "");
    replace(R"( Sm="3")", "");
    replace(">Outputs<", ">MyOut<");
    replace(">Inputs<", ">MyIn<");
    replace(">MBoxOut<", ">MyMailOut<");
    replace(">MBoxIn<", ">MyMailIn<");
    HostConfiguration owner;
    const auto esi = read_esi(text);
    ASSERT_TRUE(esi) << to_text(esi.problem);
    const std::vector<std::uint32_t> modules{0x104, 0x208};
    const auto made = configure(*esi, esi->devices[0], {.modules = modules}, owner);
    ASSERT_EQ(made.pdos.size(), 2U) << made.error;
    EXPECT_EQ(made.pdos[0].sync_manager, 2);
    EXPECT_EQ(made.pdos[1].sync_manager, 3);
    replace(R"(<Sm StartAddress="#x1300" ControlByte="#x20" Enable="1">MyIn</Sm>)", "");
    const auto less = read_esi(text);
    ASSERT_TRUE(less) << to_text(less.problem);
    EXPECT_EQ(configure(*less, less->devices[0], {.modules = modules}, owner).error,
              "slot 1: module 0x00000208: PDO 0x1a01 has no SyncManager, and the device has none of inputs");
}

TEST(EsiModules, ACouplerWithoutModulesGetsAnEmptyList) {
    const auto esi = read_esi(kCoupler);
    ASSERT_TRUE(esi) << to_text(esi.problem);
    for (const auto& none : {std::vector<std::uint32_t>{}, std::vector<std::uint32_t>{0, 0}}) {
        HostConfiguration owner;
        const auto made = configure(*esi, esi->devices[0], {.modules = none}, owner);
        ASSERT_NE(made.config, nullptr) << made.error;
        ASSERT_EQ(made.config->startup().size(), 1U);
        const StartupCommand& command = made.config->startup()[0];
        EXPECT_EQ(command.index, 0xF030);
        EXPECT_EQ(command.subindex, 0);
        EXPECT_EQ(std::vector(command.octets().begin(), command.octets().end()), std::vector{std::byte{0}});
    }
}

}  // namespace
}  // namespace margay::files
