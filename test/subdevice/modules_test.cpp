// Modular devices: objects, PDOs and assignment of the modules in the slots, the lists of ETG.5001.1, and the check
// before SAFEOP.
#include "subdevice/modules.hpp"

#include "bench_device.hpp"
#include "subdevice/sii_image.hpp"
#include "subdevice/standard_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

// A coupler with a status word of its own, and slots for modules of three kinds.
struct RackValues {
    using status = Field<std::uint16_t, 0>;
    static constexpr std::size_t bytes = status::end;
};
struct LampModuleValues {
    using lamps = Field<std::uint8_t, 0>;  // four
    using colour = Field<std::uint8_t, 4>;
    static constexpr std::uint16_t bytes = colour::end;
};
struct MeterModuleValues {
    using level = Field<std::int16_t, 0>;
    using gain = Field<std::uint16_t, level::end>;
    static constexpr std::uint16_t bytes = gain::end;
};
constexpr Entry kRackLamps[] = {entry_count(4),
                                flag<LampModuleValues::lamps>(1, "Lamp", od::kReadWrite | od::kRxMappable).times(4)};
constexpr Entry kRackColour[] = {entry_count(1), value<LampModuleValues::colour>(1, "Colour", od::kReadWrite, 7)};
constexpr Entry kRackLampPdo[] = {entry_count(4), mapped(1, 0x7000, 1, 1), mapped(2, 0x7000, 2, 1),
                                  mapped(3, 0x7000, 3, 1), mapped(4, 0x7000, 4, 1)};
constexpr Object kRackLampModule[] = {record(0x1600, "Lamps", kRackLampPdo, nullptr, DataType::pdo_mapping),
                                      array(0x7000, "Lamps", kRackLamps), record(0x8000, "Lamp settings", kRackColour)};
constexpr Entry kRackLevel[] = {entry_count(1),
                                value<MeterModuleValues::level>(1, "Level", od::kRead | od::kTxMappable)};
constexpr Entry kRackGain[] = {
    entry_count(1),
    value<MeterModuleValues::gain>(1, "Gain", od::kReadWrite | od::kBackup, 1000).within(kLimits<1, 5000>)};
constexpr Entry kRackLevelPdo[] = {entry_count(2), mapped(1, 0x6000, 1, 16), mapped(2, 0, 0, 8)};
constexpr Object kRackMeterModule[] = {record(0x1A01, "Level", kRackLevelPdo, nullptr, DataType::pdo_mapping),
                                       record(0x6000, "Level", kRackLevel), record(0x8000, "Gain", kRackGain)};
constexpr ModuleKind kRackKinds[] = {
    {.ident = 0x11, .name = "Lamps", .objects = kRackLampModule, .value_bytes = LampModuleValues::bytes},
    {.ident = 0x22,
     .name = "Meter",
     .profile = 0x00020191,
     .objects = kRackMeterModule,
     .value_bytes = MeterModuleValues::bytes},
    {.ident = 0x33, .name = "Power supply"}};
constexpr std::uint16_t kRackOwnTxPdos[] = {0x1A00};
constexpr ModularDevice kRackModular{
    .kinds = kRackKinds, .slots = 3, .index_distance = 0x20, .pdo_distance = 2, .own_tx_pdos = kRackOwnTxPdos};
using RackTables = ModuleTables<kRackModular, RackValues::bytes>;

constexpr Entry kRackStatus[] = {value<RackValues::status>(0, "Status", od::kRead | od::kTxMappable)};
constexpr Object kRackOwn[] = {variable(0x2000, "Status", kRackStatus)};
constexpr auto kRackObjects = joined(kRackOwn, RackTables::kObjects);
static_assert(well_formed(kRackObjects, RackTables::end, kRackModular));

// Mistakes that the compiler finds.
template <class Change>
constexpr bool right_with(Change change) {
    ModularDevice device = kRackModular;
    change(device);
    return well_formed(kRackObjects, RackTables::end, device);
}
constexpr Object kWithOwnLamps[] = {variable(0x7040, "Lamps of the device", kRackStatus)};
constexpr ModuleKind kTwins[] = {kRackKinds[0], kRackKinds[0]};
constexpr ModuleKind kTooSmall[] = {{.ident = 0x11, .objects = kRackLampModule, .value_bytes = 4}};
constexpr ModuleKind kNoIdent[] = {{.objects = kRackLampModule, .value_bytes = 5}};
constexpr Object kWideObjects[] = {record(0x7000, "Lamps", kRackLamps), record(0x7020, "More lamps", kRackLamps)};
constexpr ModuleKind kTooWide[] = {{.ident = 0x11, .objects = kWideObjects, .value_bytes = 5}};
static_assert(right_with([](ModularDevice&) {}));
static_assert(!right_with([](ModularDevice& d) { d.slots = 0; }));
static_assert(!right_with([](ModularDevice& d) { d.kinds = kTwins; }));
static_assert(!right_with([](ModularDevice& d) { d.kinds = kTooSmall; }), "values beside those of the module");
static_assert(!right_with([](ModularDevice& d) { d.kinds = kNoIdent; }));
static_assert(!right_with([](ModularDevice& d) { d.kinds = kTooWide; }), "an object of slot 1 is one of slot 2");
static_assert(!right_with([](ModularDevice& d) { d.index_distance = 0; }));
static_assert(!right_with([](ModularDevice& d) { d.pdo_distance = 0; }));
static_assert(!right_with([](ModularDevice& d) { d.index_distance = 0x800; }), "slot 3 has objects of another area");
static_assert(!well_formed(kWithOwnLamps, RackTables::end, kRackModular), "an object of slot 3");

constexpr DeviceDescription kRackDevice{
    .vendor_id = 0x4D47,
    .product_code = 0x78,
    .name = "Rack",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128}},
    .outputs = {.sync_manager = 2, .start = 0x1400, .max_bytes = RackTables::most_bytes(true)},
    .inputs = {.sync_manager = 3, .start = 0x1480, .max_bytes = RackTables::most_bytes(false) + 2}};
static_assert(kRackDevice.outputs.max_bytes == 2 && kRackDevice.inputs.max_bytes == 11);
using RackStack = StandardDevice<kRackDevice, kRackObjects, std::array<std::byte, RackTables::end>, 0, 0x1389,
                                 RackTables::kMostMapped + 1>;

class Rack final : public Application {
  public:
    explicit Rack(std::initializer_list<std::uint32_t> idents) {
        unsigned slot = 0;
        for (const auto ident : idents) slots.detect(++slot, ident);
    }
    const DeviceDescription& description() const override { return kRackDevice; }
    ModuleLayout* modules() override { return &slots; }

  private:
    ModuleMemory<RackTables> memory_;

  public:
    Modules slots{memory_};
};

struct RackBench {
    PlainEsc esc;
    RackStack::Memory memory;
    Rack rack;
    RackStack stack{esc, rack, memory};
    MailHand hand{esc};

    explicit RackBench(std::initializer_list<std::uint32_t> idents) : rack(idents) {
        stack.device.start(esc.time);
        hand.configure(128);
        EXPECT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)stack.device.step(esc.time);
        return esc.al_status();
    }
    // SAFEOP, with SyncManagers for this many octets.
    AlStatus to_safeop(std::uint16_t outputs, std::uint16_t inputs) {
        esc.configure(2, {0x1400, outputs, 0x64, outputs != 0 ? std::uint8_t{1} : std::uint8_t{0}});
        esc.configure(3, {0x1480, inputs, 0x20, inputs != 0 ? std::uint8_t{1} : std::uint8_t{0}});
        return request(4);
    }
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, data)));
        for (int n = 0; n < 4; ++n) (void)stack.device.step(esc.time);
        auto reply = hand.fetch();
        (void)stack.device.step(esc.time);
        if (reply.size() < wire::kMailboxHeaderBytes) return {};
        reply.resize(wire::kMailboxHeaderBytes + wire::load_mailbox_header(reply).length);
        reply.erase(reply.begin(), reply.begin() + wire::kMailboxHeaderBytes);
        return reply;
    }
    // The value of an SDO upload of up to four octets; the negative abort code.
    std::int64_t number(int index, int subindex) {
        const auto reply = exchange(sdo_request(0x40, index, subindex));
        if (const auto abort = abort_of(reply); abort != Abort::none) return -static_cast<std::int64_t>(abort);
        if (reply.size() < 10) return INT64_MIN;
        const unsigned unused = (std::to_integer<unsigned>(reply[2]) >> 2) & 3;
        return load_le<std::uint32_t>(reply, 6) & (0xFFFFFFFFU >> (8 * unused));
    }
    Abort write(int index, int subindex, std::uint32_t value, unsigned bytes) {
        return abort_of(exchange(sdo_request(static_cast<int>(0x23 | (4 - bytes) << 2), index, subindex, value)));
    }
    void configure_modules(int list, std::span<const std::uint32_t> values) {
        EXPECT_EQ(write(list, 0, 0, 1), Abort::none);
        int slot = 0;
        for (const auto value : values) EXPECT_EQ(write(list, ++slot, value, list == 0xF020 ? 2 : 4), Abort::none);
        EXPECT_EQ(write(list, 0, static_cast<std::uint32_t>(slot), 1), Abort::none);
    }
    std::vector<int> indices(std::uint16_t first, std::uint16_t last) {
        std::vector<int> all;
        for (const Object& object : stack.dictionary.objects())
            if (object.index >= first && object.index <= last) all.push_back(object.index);
        return all;
    }
};

constexpr std::int64_t absent(Abort code) { return -static_cast<std::int64_t>(code); }

TEST(Modules, EachSlotHasTheObjectsOfItsModule) {
    RackBench bench{0x22, 0x11, 0x11};
    EXPECT_EQ(bench.indices(0x1600, 0x1FFF), (std::vector{0x1602, 0x1604, 0x1A00, 0x1A01, 0x1C00, 0x1C12, 0x1C13}));
    EXPECT_EQ(bench.indices(0x2000, 0xFFFF), (std::vector{0x2000, 0x6000, 0x7020, 0x7040, 0x8000, 0x8020, 0x8040,
                                                          0xF000, 0xF010, 0xF020, 0xF030, 0xF050}));
    EXPECT_EQ(bench.number(0x8000, 1), 1000) << "gain";
    EXPECT_EQ(bench.number(0x8020, 1), 7) << "colour";
    EXPECT_EQ(bench.number(0x7000, 1), absent(Abort::no_object)) << "slot 1 has no lamps";
    EXPECT_EQ(bench.number(0x6020, 1), absent(Abort::no_object));
    // Each slot has its own values.
    EXPECT_EQ(bench.write(0x8020, 1, 3, 1), Abort::none);
    EXPECT_EQ(bench.number(0x8020, 1), 3);
    EXPECT_EQ(bench.number(0x8040, 1), 7);
    EXPECT_EQ(LampModuleValues::colour::load(bench.rack.slots.values(2)), 3);
    EXPECT_EQ(bench.write(0x8000, 1, 5001, 2), Abort::value_too_high);
    EXPECT_EQ(bench.rack.slots.in_use(1)->name, "Meter");
    EXPECT_EQ(bench.rack.slots.in_use(4), nullptr);
    EXPECT_TRUE(bench.rack.slots.values(0).empty());
}

TEST(Modules, PdosMapTheObjectsOfTheirSlot) {
    RackBench bench{0x22, 0x11, 0x11};
    EXPECT_EQ(bench.number(0x1C12, 0), 2);
    EXPECT_EQ(bench.number(0x1C12, 1), 0x1602);
    EXPECT_EQ(bench.number(0x1C12, 2), 0x1604);
    EXPECT_EQ(bench.number(0x1C13, 0), 2);
    EXPECT_EQ(bench.number(0x1C13, 1), 0x1A00) << "the PDO of the device itself is the first";
    EXPECT_EQ(bench.number(0x1C13, 2), 0x1A01);
    EXPECT_EQ(bench.number(0x1602, 1), 0x70200101);
    EXPECT_EQ(bench.number(0x1604, 4), 0x70400401);
    EXPECT_EQ(bench.number(0x1A01, 1), 0x60000110);
    EXPECT_EQ(bench.number(0x1A01, 2), 8) << "a gap stays a gap";
    EXPECT_EQ(bench.write(0x1C12, 0, 0, 1), Abort::read_only);
    EXPECT_EQ(bench.write(0x1602, 0, 0, 1), Abort::read_only);
    // Complete access, and the default value of the SDO information service.
    const auto whole = bench.exchange(sdo_request(0x50, 0x1604, 0));
    ASSERT_EQ(whole.size(), 10U + 18);
    EXPECT_EQ(load_le<std::uint32_t>(whole, 12), 0x70400101U);
    const auto entry = bench.exchange(raw({0x00, 0x80, 0x05, 0, 0, 0, 0x04, 0x16, 2, 0x10}));
    ASSERT_GE(entry.size(), 20U);
    EXPECT_EQ(load_le<std::uint32_t>(entry, 16), 0x70400201U);
}

TEST(Modules, ProcessDataAreThoseOfTheModules) {
    RackBench bench{0x11, 0x22, 0x11};
    MeterModuleValues::level::store(bench.rack.slots.values(2), -300);
    RackValues::status::store(bench.memory.values, 0x1234);
    ASSERT_EQ(bench.to_safeop(1, 5), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_TRUE(bench.esc.ecat_write(0x1400, raw({0xA5})));
    bench.esc.time += std::chrono::milliseconds(2);
    (void)bench.stack.device.step(bench.esc.time);
    ASSERT_EQ(bench.request(8), (AlStatus{AlState::op, false, 0}));
    const Bytes first = bench.rack.slots.values(1);
    const Bytes third = bench.rack.slots.values(3);
    for (std::size_t n = 0; n < 4; ++n) {
        EXPECT_EQ(first[n], std::byte((0x5U >> n) & 1)) << n;
        EXPECT_EQ(third[n], std::byte((0xAU >> n) & 1)) << n;
    }
    std::vector<std::byte> inputs(5);
    ASSERT_TRUE(bench.esc.ecat_read(0x1480, inputs));
    EXPECT_EQ(load_le<std::uint16_t>(inputs), 0x1234);
    EXPECT_EQ(load_le<std::int16_t>(inputs, 2), -300);
}

TEST(Modules, TheListsNameProfilesAndIdents) {
    RackBench bench{0x22, 0, 0x33};
    EXPECT_EQ(bench.number(0xF000, 1), 0x20);
    EXPECT_EQ(bench.number(0xF000, 2), 3);
    EXPECT_EQ(bench.number(0xF010, 0), 3);
    EXPECT_EQ(bench.number(0xF010, 1), 0x00020191);
    EXPECT_EQ(bench.number(0xF010, 2), 0);
    EXPECT_EQ(bench.number(0xF010, 3), 5001);
    EXPECT_EQ(bench.number(0xF050, 0), 3);
    EXPECT_EQ(bench.number(0xF050, 1), 0x22);
    EXPECT_EQ(bench.number(0xF050, 2), 0);
    EXPECT_EQ(bench.number(0xF050, 3), 0x33);
    EXPECT_EQ(bench.number(0xF030, 0), 0);
    EXPECT_EQ(bench.write(0xF030, 0, 4, 1), Abort::value_too_high);
    EXPECT_EQ(bench.write(0xF050, 1, 1, 4), Abort::read_only);
    EXPECT_EQ(bench.number(0x1C12, 0), 0) << "no module has outputs";
    EXPECT_EQ(bench.to_safeop(0, 5), (AlStatus{AlState::safeop, false, 0}));
}

TEST(Modules, SafeopIsRefusedWhereTheListsDiffer) {
    struct Case {
        const char* what;
        std::initializer_list<std::uint32_t> found;
        std::vector<std::uint32_t> expected;
        bool right;
        int list = 0xF030;
    };
    const Case cases[] = {{"no expectation", {0x33, 0x33}, {}, true},
                          {"equal", {0x33, 0x33, 0x33}, {0x33, 0x33, 0x33}, true},
                          {"empty slots behind the modules", {0x33}, {0x33, 0, 0}, true},
                          {"an empty slot between", {0x33, 0, 0x33}, {0x33, 0, 0x33}, true},
                          {"a module without a kind", {0x777}, {0x777}, true},
                          {"another module", {0x33, 0x777}, {0x33, 0x33}, false},
                          {"a module is missing", {0x33}, {0x33, 0x33}, false},
                          {"a module too many", {0x33, 0x777}, {0x33}, false},
                          {"exchanged", {0x33, 0x777}, {0x777, 0x33}, false},
                          {"addresses", {0x33, 0, 0x33}, {1, 0, 3}, true, 0xF020},
                          {"an address too many", {0x33, 0, 0x33}, {1, 2, 3}, false, 0xF020},
                          {"exchanged addresses", {0x33, 0x33}, {2, 1}, false, 0xF020}};
    for (const Case& one : cases) {
        SCOPED_TRACE(one.what);
        RackBench bench(one.found);
        bench.configure_modules(one.list, one.expected);
        const AlStatus status = bench.to_safeop(0, 2);
        EXPECT_EQ(status.state, one.right ? AlState::safeop : AlState::preop);
        EXPECT_EQ(status.code, one.right ? 0 : 0x0070);
    }
}

// A master that was configured for other modules sets SyncManagers of other sizes, too.
TEST(Modules, AMismatchIsToldBeforeTheSizesThatFollowFromIt) {
    RackBench missing{0x11};
    missing.configure_modules(0xF030, std::array<std::uint32_t, 2>{0x11, 0x22});
    EXPECT_EQ(missing.to_safeop(1, 5), (AlStatus{AlState::preop, true, 0x0070}));
    RackBench plugged{0x11};
    plugged.rack.slots.detect(2, 0x22);
    EXPECT_EQ(plugged.to_safeop(1, 5), (AlStatus{AlState::preop, true, 0x0021}));
    RackBench right{0x11, 0x22};
    EXPECT_EQ(right.to_safeop(1, 2), (AlStatus{AlState::preop, true, 0x001E})) << "only the size is wrong";
}

TEST(Modules, ANewLayoutNeedsInit) {
    RackBench bench{0x22, 0x11};
    EXPECT_EQ(bench.write(0x8000, 1, 42, 2), Abort::none);
    EXPECT_EQ(bench.write(0x8020, 1, 5, 1), Abort::none);
    ASSERT_EQ(bench.to_safeop(1, 5), (AlStatus{AlState::safeop, false, 0}));
    bench.rack.slots.detect(2, 0x22);
    bench.rack.slots.detect(3, 0x11);
    bench.rack.slots.detect(4, 0x11);  // there is no such slot
    EXPECT_EQ(bench.number(0xF050, 0), 3);
    EXPECT_EQ(bench.number(0xF050, 2), 0x22) << "at once";
    EXPECT_EQ(bench.number(0x8020, 1), 5) << "the objects stay";
    EXPECT_EQ(bench.esc.al_status(), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
    EXPECT_EQ(bench.to_safeop(1, 5), (AlStatus{AlState::preop, true, 0x0021})) << "needs INIT";
    bench.configure_modules(0xF030, std::array<std::uint32_t, 2>{0x22, 0x11});
    EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::preop, true, 0x0070})) << "the old list is wrong now";
    bench.configure_modules(0xF030, std::array<std::uint32_t, 3>{0x22, 0x22, 0x11});

    EXPECT_EQ(bench.request(0x11), (AlStatus{AlState::init, false, 0}));
    EXPECT_EQ(bench.request(2), (AlStatus{AlState::preop, false, 0}));
    EXPECT_EQ(bench.number(0x8000, 1), 42) << "a module that stays keeps its values";
    EXPECT_EQ(bench.number(0x8020, 1), 1000) << "another one has its initial values";
    EXPECT_EQ(bench.number(0x8040, 1), 7);
    EXPECT_EQ(bench.number(0x7020, 1), absent(Abort::no_object));
    EXPECT_EQ(bench.number(0x1C12, 1), 0x1604);
    EXPECT_EQ(bench.to_safeop(1, 8), (AlStatus{AlState::safeop, false, 0}));
}

TEST(Modules, TheSiiHasThePdosOfTheModules) {
    PlainEsc esc;
    RackStack::Memory memory;
    Rack rack{0x11, 0x22};
    RackStack stack{esc, rack, memory};
    rack.slots.lay_out(stack.dictionary);
    SiiWorkspace<8, 32> workspace;
    std::vector<std::byte> image(1024);
    ASSERT_TRUE(write_sii(kRackDevice, {}, stack.dictionary, workspace, image).ok());
    EXPECT_EQ(workspace.pdos[0].index, 0x1600);
    EXPECT_EQ(workspace.pdos[0].sync_manager, 2);
    EXPECT_EQ(workspace.pdos[0].entries[3].index, 0x7000);
    EXPECT_EQ(workspace.pdos[1].index, 0x1A00);
    EXPECT_EQ(workspace.pdos[2].index, 0x1A03);
    EXPECT_EQ(workspace.pdos[2].entries[0].index, 0x6020);
    EXPECT_EQ(workspace.pdos[2].entries[0].name, "Level");
}

}  // namespace
}  // namespace margay::subdevice
