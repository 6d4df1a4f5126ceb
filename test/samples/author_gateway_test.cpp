// A device with all mailbox protocols except SoE, a bootloader and two SyncManagers of outputs, as its author writes it
// with the README and the headers of the slave stack. Also the program of a user of the library that communicates with
// this device.
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "subdevice/aoe_server.hpp"
#include "subdevice/eoe_server.hpp"
#include "subdevice/foe_server.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"
#include "subdevice/sync_objects.hpp"
#include "subdevice/voe_server.hpp"
#include "subdevice_check/check.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <optional>

namespace margay::subdevice {
namespace {

using namespace std::chrono_literals;

// ------------------------------------------------------------------ the device

constexpr ProcessDataArea kGateMoreOutputs[] = {{.sync_manager = 4, .start = 0x1A00, .max_bytes = 4, .watchdog = true}};
constexpr DeviceDescription kGate{
    .vendor_id = 0x4D47,
    .product_code = 0x0FF2,
    .revision = 1,
    .name = "Gate",
    .order_code = "G-1",
    .group = "Gates",
    .protocols = {.aoe = true, .eoe = true, .coe = true, .foe = true, .voe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 256}, {.start = 0x1100, .size_bytes = 256}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 512}, {.start = 0x1200, .size_bytes = 512}},
    .outputs = {.sync_manager = 2, .start = 0x1800, .max_bytes = 2, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1900, .max_bytes = 4},
    .more_outputs = kGateMoreOutputs,
    .dc = {.supported = true}};

struct GateValues {
    using offset_value = Field<std::int16_t, 0>;
    using wanted = Field<std::int32_t, offset_value::end>;
    using actual = Field<std::int32_t, wanted::end>;
    static constexpr std::size_t sync = actual::end;
    static constexpr std::size_t sync4 = sync + SyncValues<sync>::bytes;
    static constexpr std::size_t bytes = sync4 + MoreSyncValues<sync4>::bytes;
};
constexpr auto kGateOut = od::kReadWrite | od::kRxMappable;
constexpr Entry kGateOffset[] = {value<GateValues::offset_value>(0, "Offset", kGateOut)};
constexpr Entry kGateWanted[] = {value<GateValues::wanted>(0, "Wanted", kGateOut)};
constexpr Entry kGateActual[] = {value<GateValues::actual>(0, "Actual", od::kRead | od::kTxMappable)};
constexpr Entry kGateRx2[] = {entry_count(1), mapped(1, 0x7000, 0, 16)};
constexpr Entry kGateRx4[] = {entry_count(1), mapped(1, 0x7001, 0, 32)};
constexpr Entry kGateAssigned2[] = {entry_count(1), assigned(1, 0x1600)};
constexpr Entry kGateAssigned4[] = {entry_count(1), assigned(1, 0x1601)};
constexpr auto kGateSync2 = sync_output_entries<GateValues::sync>(kGate);
constexpr auto kGateSync3 = sync_input_entries<GateValues::sync>(kGate);
constexpr auto kGateSync4 = more_sync_output_entries<GateValues::sync, GateValues::sync4>(kGate);
constexpr Object kGateObjects[] = {record(0x1600, "Offset", kGateRx2, nullptr, DataType::pdo_mapping),
                                   record(0x1601, "Wanted", kGateRx4, nullptr, DataType::pdo_mapping),
                                   array(0x1C12, "RxPDO assignment of SM2", kGateAssigned2),
                                   array(0x1C14, "RxPDO assignment of SM4", kGateAssigned4),
                                   record(0x1C32, "Synchronization of SM2", kGateSync2, &kSyncParameterHooks),
                                   record(0x1C33, "Synchronization of SM3", kGateSync3, &kSyncParameterHooks),
                                   record(0x1C34, "Synchronization of SM4", kGateSync4, &kSyncParameterHooks),
                                   variable(0x6000, "Actual", kGateActual),
                                   variable(0x7000, "Offset", kGateOffset),
                                   variable(0x7001, "Wanted", kGateWanted)};
using GateStack = StandardDevice<kGate, kGateObjects, std::array<std::byte, GateValues::bytes>, 4>;

class Gate final : public Application, public FoeStore, public VoeApplication, public EoeApplication, public AoeDevice {
  public:
    explicit Gate(MutableBytes values) : values_(values) {}
    const DeviceDescription& description() const override { return kGate; }
    void cycle(Time, bool) override {
        GateValues::actual::store(values_, GateValues::wanted::load(values_) + GateValues::offset_value::load(values_));
    }

    FoeAnswer open_to_read(const FoeFile& file, Time) override {
        return file.name == "firmware" ? FoeAnswer::go() : FoeAnswer::error(FoeError::not_found);
    }
    FoeAnswer read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time) override {
        bytes = std::min(into.size(), firmware_.size() - offset);
        std::copy_n(firmware_.begin() + static_cast<std::ptrdiff_t>(offset), bytes, into.begin());
        return FoeAnswer::go();
    }
    FoeAnswer open_to_write(const FoeFile& file, Time) override {
        if (file.state != AlState::boot) return FoeAnswer::error(FoeError::bootstrap_only);
        firmware_.clear();
        return FoeAnswer::go();
    }
    FoeAnswer write(std::size_t, Bytes data, Time) override {
        firmware_.insert(firmware_.end(), data.begin(), data.end());
        return FoeAnswer::go();
    }
    FoeAnswer finish_write(std::size_t, Time) override { return FoeAnswer::go(); }
    void give_up() override {}

    bool received(VoeServer& server, const subdevice::VoeHeader& header, Bytes data, Time) override {
        return header.vendor_id == kGate.vendor_id && server.send(header, data);
    }
    Time step(VoeServer&, Time) override { return kNever; }
    void received(EoeServer& server, Bytes frame, Time) override { (void)server.send(frame); }
    Time step(EoeServer&, Time) override { return kNever; }
    EoeResult set_ip(const EoeIp& ip) override {
        ip_ = ip;
        return EoeResult::success;
    }
    EoeResult get_ip(EoeIp& ip) override {
        ip = ip_;
        return EoeResult::success;
    }
    using AoeDevice::write;
    AoeError read(AoeIndex index, MutableBytes into, std::size_t& bytes, Time) override {
        if (index.group != 1) return AoeError::invalid_group;
        if (into.size() != 4) return AoeError::invalid_size;
        bytes = into.size();
        store_le(into, 0, GateValues::actual::load(values_));
        return AoeError::none;
    }

  private:
    MutableBytes values_;
    std::vector<std::byte> firmware_;
    EoeIp ip_;
};

// The main program of the device.
class GateFirmware final : public sim::Firmware {
  public:
    void start(EscAccess& esc, Time now) override {
        all_.emplace(esc);
        all_->stack.device.start(now);
    }
    Time step(Time now) override { return std::min(all_->stack.device.step(now), now + 50us); }  // this device polls

  private:
    struct All {
        explicit All(EscAccess& esc)
            : stack(esc, gate, memory,
                    {{{wire::MailboxType::foe, &foe, true},
                      {wire::MailboxType::voe, &voe},
                      {wire::MailboxType::eoe, &eoe},
                      {wire::MailboxType::aoe, &aoe}}}) {}
        GateStack::Memory memory;
        Gate gate{memory.values};
        FoeServer foe{gate};
        std::array<std::byte, 600> messages{};
        VoeServer voe{gate, messages};
        std::array<std::byte, 1518> frame{};
        std::array<std::byte, 4096> frames{};
        EoeServer eoe{gate, frame, frames};
        std::array<AoeRoute, 1> routes{{{&gate, 1}}};
        AoeServer aoe{routes};
        GateStack stack;
    };
    std::optional<All> all_;
};

sim::Device make_gate() {
    std::array<std::byte, GateValues::bytes> values{};
    const ObjectDictionary dictionary(GateStack::Objects::kObjects, values);
    SiiWorkspace<4, 8> workspace;
    sim::Device device{.chip = *sim::chip_by_name("et1100"), .sii = std::vector<std::byte>(2048), .firmware = {}};
    const auto written = write_sii(kGate, {}, dictionary, workspace, device.sii);
    EXPECT_TRUE(written.ok()) << to_text(written.fault);
    device.firmware = std::make_unique<GateFirmware>();
    return device;
}

// ------------------------------------------------------------------ a program of a user

class AuthorsGateway : public ::testing::Test {
  protected:
    sim::Segment segment;
    VirtualOsal osal;
    SimulatedNic nic{segment, osal};
    HostContext ctx{Limits{.slaves = 4}};

    void SetUp() override {
        segment.add(make_gate().assemble());
        ASSERT_TRUE(segment.connect_master({0, 0}));
        segment.power_up(osal.now());
        ASSERT_TRUE(init(ctx, nic, osal).ok());
    }
    void idle(Duration time) {
        for (const Time end = osal.now() + time; osal.now() < end;) {
            osal.wait(std::min(poll(ctx, osal.now()), osal.now() + 1ms), -1);
            segment.advance(osal.now());
        }
    }
    void to(AlState state) {
        StateRequest request;
        request.slave = 1;
        request.wanted = state;
        ASSERT_TRUE(submit(ctx, request).ok());
        ASSERT_TRUE(wait(ctx, request).ok());
    }
};

TEST_F(AuthorsGateway, SpeaksAllItsProtocols) {
    ASSERT_TRUE(config_init(ctx).ok());
    std::array<std::byte, 2048> memory{};
    VoeInbox inbox(memory);
    inbox.only_slave = 1;
    inbox.vendor_id = kGate.vendor_id;
    inbox.look_every = 5ms;
    ASSERT_TRUE(listen(ctx, inbox).ok());
    std::array<std::byte, 100> message{};
    message[5] = std::byte{9};
    std::array<std::byte, 200> into{};
    ASSERT_TRUE(VOEsend(ctx, 1, {.vendor_id = kGate.vendor_id, .vendor_type = 1}, message).ok());
    const auto echo = VOEreceive(ctx, inbox, into);
    ASSERT_TRUE(echo.ok());
    EXPECT_EQ(echo->bytes, message.size());
    EXPECT_EQ(into[5], std::byte{9});

    const AoeAddress target{{{1, 2, 3, 4, 5, 6}}, 1};
    ASSERT_TRUE(AOEset_net_id(ctx, 1, target.net_id).ok());
    std::array<std::byte, 4> actual{};
    EXPECT_TRUE(AOEread(ctx, 1, target, 1, 0, actual).ok());
    EXPECT_EQ(AOEread(ctx, 1, target, 2, 0, actual).error().code, Errc::aoe_result);

    EXPECT_TRUE(EOEset_ip(ctx, 1, {.address = Ipv4Address{192, 168, 5, 2}}).ok());
    EXPECT_EQ(EOEget_ip(ctx, 1)->address, (Ipv4Address{192, 168, 5, 2}));
    EoePortMemory<8, 8> frames{};
    EoePort port(frames);
    port.slave = 1;
    ASSERT_TRUE(submit(ctx, port).ok());
    std::array<std::byte, 1514> frame{};
    frame[20] = std::byte{3};
    ASSERT_TRUE(port.send(frame));
    idle(100ms);
    std::array<std::byte, kEoeFrameBytes> back{};
    const auto received = port.receive(back);
    ASSERT_TRUE(received);
    EXPECT_EQ(received->bytes, frame.size());
    EXPECT_EQ(back[20], std::byte{3});
}

TEST_F(AuthorsGateway, TakesItsFirmwareInBoot) {
    ASSERT_TRUE(config_init(ctx).ok());
    const std::vector<std::byte> firmware(5000, std::byte{7});
    EXPECT_EQ(FOEwrite(ctx, 1, "firmware", 0, firmware).error().detail, 0x8008U) << "in BOOT only";
    to(AlState::boot);
    ASSERT_TRUE(FOEwrite(ctx, 1, "firmware", 0, firmware).ok());
    std::vector<std::byte> back(6000);
    const auto read = FOEread(ctx, 1, "firmware", 0, back);
    ASSERT_TRUE(read.ok());
    EXPECT_EQ(Bytes(back).first(*read).size(), firmware.size());
    to(AlState::init);
    to(AlState::preop);
    EXPECT_EQ(FOEread(ctx, 1, "nothing", 0, back).error().detail, 0x8001U) << "not found";
}

TEST_F(AuthorsGateway, ExchangesBothSyncManagersOfItsOutputs) {
    ASSERT_TRUE(config_init(ctx).ok());
    std::array<std::byte, 64> image{};
    ASSERT_TRUE(config_map(ctx, image).ok());
    ASSERT_TRUE(reach(ctx, AlState::op, 5s).ok());
    const auto& data = ctx.slave(1).image;
    ASSERT_EQ(data.outputs.bytes.size(), 6U);
    store_le<std::int16_t>(data.outputs.bytes, 0, -3);
    store_le<std::int32_t>(data.outputs.bytes, 2, 100'000);
    for (int n = 0; n < 5; ++n) {
        osal.advance(1ms);
        ASSERT_TRUE(send_processdata(ctx).ok());
        ASSERT_TRUE(receive_processdata(ctx, 500us).ok());
    }
    EXPECT_EQ(load_le<std::int32_t>(data.inputs.bytes), 99'997);
}

TEST_F(AuthorsGateway, KeepsTheRulesOfTheStandard) {
    using namespace samples::conformance;
    const auto checked = check_device(ctx, osal, nic.wait_handle(), 1, {.write_eeprom = true});
    EXPECT_EQ(checked.error, "");
    EXPECT_TRUE(checked.report.conforms()) << report_text(checked.report, true);
}

}  // namespace
}  // namespace margay::subdevice
