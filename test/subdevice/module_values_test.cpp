// Values of modules: stored values and modules that are exchanged, values larger than the staging buffer, and lists of
// fewer modules than slots.
#include "bench_device.hpp"
#include "memory_store.hpp"
#include "subdevice/modules.hpp"
#include "subdevice/standard_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

// Two kinds of modules with the same objects, and a third kind with a large value.
struct ScaleValues {
    Le<std::uint16_t> gain;
};
struct TextValues {
    std::array<char, 300> label;
};
constexpr Entry kScaleGain[] = {entry_count(1),
                                value<&ScaleValues::gain>(1, "Gain", od::kReadWrite | od::kBackup, 1000)};
constexpr Object kCoarseScale[] = {record(0x8000, "Scale", kScaleGain)};
constexpr Object kFineScale[] = {record(0x8000, "Scale", kScaleGain)};
constexpr Entry kScaleLabel[] = {entry_count(1),
                                 octets<&TextValues::label>(1, "Label", DataType::octet_string, od::kReadWrite)};
constexpr Object kLabelModule[] = {record(0x8000, "Label", kScaleLabel)};
constexpr ModuleKind kScaleKinds[] = {
    {.ident = 0x51, .name = "Coarse scale", .objects = kCoarseScale, .value_bytes = sizeof(ScaleValues)},
    {.ident = 0x52, .name = "Fine scale", .objects = kFineScale, .value_bytes = sizeof(ScaleValues)},
    {.ident = 0x53, .name = "Label", .objects = kLabelModule, .value_bytes = sizeof(TextValues)}};
constexpr ModularDevice kScales{.kinds = kScaleKinds, .slots = 3};
using ScaleTables = ModuleTables<kScales, 0>;
constexpr DeviceDescription kScaleDevice{
    .name = "Scales",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128}, {.start = 0x1100, .size_bytes = 128}}};
constexpr auto kScaleObjects = ScaleTables::kObjects;

class ScaleApplication final : public Application {
  public:
    explicit ScaleApplication(std::initializer_list<std::uint32_t> idents) {
        unsigned slot = 0;
        for (const auto ident : idents) slots.detect(++slot, ident);
    }
    const DeviceDescription& description() const override { return kScaleDevice; }
    ModuleLayout* modules() override { return &slots; }

  private:
    ModuleMemory<ScaleTables> memory_;

  public:
    Modules slots{memory_};
};

// A device after power-up, with these modules and the values of the store.
struct ScaleRack {
    ScaleRack(MemoryStore& store, std::initializer_list<std::uint32_t> idents)
        : application(idents), dictionary(kScaleObjects, image, &application), stored(dictionary, store, buffer) {
        application.slots.lay_out(dictionary);
        loaded = stored.load();
    }
    std::uint16_t gain(unsigned slot) { return values_in<ScaleValues>(application.slots.values(slot)).gain; }
    void set_gain(unsigned slot, std::uint16_t gain) {
        auto values = values_in<ScaleValues>(application.slots.values(slot));
        values.gain = gain;
        store_values(application.slots.values(slot), values);
    }
    std::array<std::byte, ScaleTables::end> image{};
    std::array<std::byte, kStoredHeadBytes + ScaleTables::kStoredBytes> buffer{};
    ScaleApplication application;
    ObjectDictionary dictionary;
    StoredValues stored;
    bool loaded = false;
};

TEST(ModuleValues, StoredValuesBelongToModulesOfTheSameKindInTheSameSlot) {
    MemoryStore store;
    {
        ScaleRack rack(store, {0x51, 0x52});
        EXPECT_FALSE(rack.loaded);
        rack.set_gain(1, 11);
        rack.set_gain(2, 22);
        ASSERT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    }
    ScaleRack same(store, {0x51, 0x52});
    EXPECT_TRUE(same.loaded);
    EXPECT_EQ(same.gain(1), 11);
    EXPECT_EQ(same.gain(2), 22);
    struct Case {
        const char* what;
        std::initializer_list<std::uint32_t> idents;
        std::initializer_list<int> gains;
    };
    const Case cases[] = {{"exchanged", {0x52, 0x51}, {1000, 1000}},
                          {"another kind with the same objects", {0x51, 0x51}, {11, 1000}},
                          {"moved to other slots", {0, 0x51, 0x52}, {0, 1000, 1000}},
                          {"one is gone", {0x51}, {11}},
                          {"the first is gone", {0, 0x52}, {0, 22}},
                          {"one more", {0x51, 0x52, 0x51}, {11, 22, 1000}}};
    for (const auto& one : cases) {
        SCOPED_TRACE(one.what);
        ScaleRack other(store, one.idents);
        EXPECT_TRUE(other.loaded);
        for (unsigned slot = 1; slot <= one.idents.size(); ++slot)
            EXPECT_EQ(other.gain(slot), std::data(one.gains)[slot - 1]) << slot;
    }
    // A damaged block, and a block that was truncated between two parts.
    const auto whole = store.cells;
    for (std::size_t n = 0; n < whole.size(); ++n) {
        store.cells = whole;
        store.cells[n] ^= std::byte{1};
        ScaleRack damaged(store, {0x51, 0x52});
        EXPECT_FALSE(damaged.loaded) << n;
        EXPECT_EQ(damaged.gain(1), 1000) << n;
        store.cells.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n));
        EXPECT_FALSE(ScaleRack(store, {0x51, 0x52}).loaded) << n;
    }
}

// Another firmware of the device, whose modules have not changed.
TEST(ModuleValues, ABlockOfAnotherTableOfTheDeviceIsNotLoaded) {
    MemoryStore store;
    ScaleRack rack(store, {0x51});
    rack.set_gain(1, 11);
    ASSERT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    static constexpr Entry kOwnValue[] = {value<Field<std::uint8_t, 0>>(0, "Own", od::kReadWrite | od::kBackup)};
    static constexpr std::array kOwnObject{variable(0x2000, "Own", kOwnValue)};
    static constexpr auto kOtherObjects = joined(kOwnObject, kScaleObjects);
    ScaleApplication application({0x51});
    std::array<std::byte, ScaleTables::end> image{};
    std::array<std::byte, kStoredHeadBytes + ScaleTables::kStoredBytes + 1> buffer{};
    ObjectDictionary dictionary(kOtherObjects, image, &application);
    StoredValues stored(dictionary, store, buffer);
    application.slots.lay_out(dictionary);
    EXPECT_FALSE(stored.load());
    EXPECT_FALSE(stored.load_module(1));
    EXPECT_EQ(values_in<ScaleValues>(application.slots.values(1)).gain, 1000);
}

TEST(ModuleValues, AModuleThatIsPluggedInLaterGetsWhatIsStoredForItsKindAndSlot) {
    MemoryStore store;
    {
        ScaleRack rack(store, {0x51, 0x52});
        rack.set_gain(1, 11);
        rack.set_gain(2, 22);
        ASSERT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    }
    ScaleRack rack(store, {0x51});
    rack.set_gain(1, 33);
    const auto plug = [&](unsigned slot, std::uint32_t ident) {
        rack.application.slots.detect(slot, ident);
        rack.application.slots.lay_out(rack.dictionary);
        return rack.stored.load_module(slot);
    };
    EXPECT_FALSE(plug(2, 0x51)) << "another kind";
    EXPECT_EQ(rack.gain(2), 1000);
    EXPECT_TRUE(plug(2, 0x52));
    EXPECT_EQ(rack.gain(2), 22);
    EXPECT_EQ(rack.gain(1), 33) << "the other slot keeps what it has";
    EXPECT_FALSE(plug(3, 0x52)) << "another slot";
    EXPECT_EQ(rack.gain(3), 1000);
    EXPECT_FALSE(rack.stored.load_module(0));
    EXPECT_FALSE(rack.stored.load_module(4));
}

// The master has sent "save" to a slow memory, and INIT before the answer.
TEST(ModuleValues, ASaveThatWasGivenUpDoesNotKeepAModuleFromItsValues) {
    MemoryStore store;
    {
        ScaleRack rack(store, {0x51, 0x52});
        rack.set_gain(2, 22);
        ASSERT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    }
    ScaleRack rack(store, {0x51});
    store.busy = 1;
    ASSERT_TRUE(rack.stored.save(Time{}).waits());
    rack.application.slots.detect(2, 0x52);
    rack.application.slots.lay_out(rack.dictionary);
    EXPECT_TRUE(rack.stored.load_module(2));
    EXPECT_EQ(rack.gain(2), 22);
    // The memory finishes the block of the first command. The next command stores the values of its own time.
    rack.set_gain(2, 44);
    EXPECT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    EXPECT_EQ(ScaleRack(store, {0x51, 0x52}).gain(2), 44);
}

TEST(ModuleValues, ARestoreAfterASaveThatWasGivenUpErasesTheMemory) {
    MemoryStore store;
    ScaleRack rack(store, {0x51});
    store.busy = 1;
    ASSERT_TRUE(rack.stored.save(Time{}).waits());
    EXPECT_EQ(rack.stored.restore(Time{}).abort, Abort::none);
    EXPECT_TRUE(store.cells.empty());
    // The same with the commands in the other order.
    store.busy = 1;
    ASSERT_TRUE(rack.stored.restore(Time{}).waits());
    rack.set_gain(1, 55);
    EXPECT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    EXPECT_EQ(ScaleRack(store, {0x51}).gain(1), 55);
}

// A module was exchanged, and the old layout is used until INIT. The values belong to the old module.
TEST(ModuleValues, ASaveBeforeTheNewLayoutIsOneOfTheOldModules) {
    MemoryStore store;
    {
        ScaleRack rack(store, {0x51});
        rack.set_gain(1, 11);
        rack.application.slots.detect(1, 0x52);
        ASSERT_EQ(rack.stored.save(Time{}).abort, Abort::none);
    }
    ScaleRack fine(store, {0x52});
    EXPECT_TRUE(fine.loaded);
    EXPECT_EQ(fine.gain(1), 1000);
    ScaleRack coarse(store, {0x51});
    EXPECT_TRUE(coarse.loaded);
    EXPECT_EQ(coarse.gain(1), 11);
}

// ------------------------------------------------------------------ over a mailbox

template <std::size_t LargestValue>
struct ScaleBench {
    using Stack = StandardDevice<kScaleDevice, kScaleObjects, std::array<std::byte, ScaleTables::end>, 0, 0x1389,
                                 ScaleTables::kMostMapped + 1, LargestValue>;
    PlainEsc esc;
    typename Stack::Memory memory;
    ScaleApplication application;
    Stack stack{esc, application, memory};
    MailHand hand{esc};

    explicit ScaleBench(std::initializer_list<std::uint32_t> idents) : application(idents) {
        stack.device.start(esc.time);
        hand.configure(128);
        EXPECT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)stack.device.step(esc.time);
        return esc.al_status();
    }
    // The data of the reply, from the CoE header on.
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, data)));
        for (int n = 0; n < 4; ++n) (void)stack.device.step(esc.time);
        auto reply = hand.fetch();
        (void)stack.device.step(esc.time);
        if (reply.size() < 16) return std::vector<std::byte>(10);
        reply.resize(wire::kMailboxHeaderBytes + wire::load_mailbox_header(reply).length);
        reply.erase(reply.begin(), reply.begin() + wire::kMailboxHeaderBytes);
        return reply;
    }
    // A download by complete access in one message.
    Abort write_list(int index, int subindex, const std::vector<std::byte>& value) {
        auto message = sdo_request(0x31, index, subindex, static_cast<std::uint32_t>(value.size()));
        message.insert(message.end(), value.begin(), value.end());
        return abort_of(exchange(message));
    }
};

// All octets of the label are equal when the upload begins, and change before its second segment.
TEST(ModuleValues, ALargeValueIsReadAsAWholeOrNotAtAll) {
    ScaleBench<ScaleTables::kLargestValue> bench({0x53});
    const auto label = bench.application.slots.values(1);
    std::ranges::fill(label, std::byte{1});
    auto reply = bench.exchange(sdo_request(0x40, 0x8000, 1));
    ASSERT_EQ(abort_of(reply), Abort::none);
    std::vector<std::byte> got(reply.begin() + 10, reply.end());
    std::ranges::fill(label, std::byte{2});
    for (int toggle = 0; got.size() < 300; toggle ^= 0x10) {
        reply = bench.exchange(raw({0x00, 0x20, 0x60 | toggle, 0, 0, 0, 0, 0, 0, 0}));
        ASSERT_GT(reply.size(), 3u);
        got.insert(got.end(), reply.begin() + 3, reply.end());
    }
    EXPECT_EQ(got, std::vector<std::byte>(300, std::byte{1}));

    // The author has not declared that modules have large values.
    ScaleBench<0> small({0x53});
    EXPECT_EQ(abort_of(small.exchange(sdo_request(0x40, 0x8000, 1))), Abort::out_of_memory);
}

TEST(ModuleValues, CompleteAccessWritesAListOfFewerModulesThanSlots) {
    ScaleBench<0> bench({0x51, 0x52});
    auto& dictionary = bench.stack.dictionary;
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({3, 0, 0x51, 0, 0, 0, 0x52, 0, 0, 0, 0x77, 0, 0, 0})), Abort::none);
    EXPECT_EQ(bench.request(4), (AlStatus{AlState::preop, true, 0x0070}));
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({2, 0, 0x51, 0, 0, 0, 0x52, 0, 0, 0})), Abort::none);
    EXPECT_EQ(dictionary.number(0xF030, 0), 2u);
    EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0})) << "the third module counts no more";
    (void)bench.request(2);
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({2, 0, 0x52, 0, 0, 0, 0x51, 0, 0, 0})), Abort::none);
    EXPECT_EQ(bench.request(4), (AlStatus{AlState::preop, true, 0x0070}));
    EXPECT_EQ(bench.write_list(0xF030, 1, raw({0x51, 0, 0, 0, 0x52, 0, 0, 0})), Abort::none) << "from subindex 1 on";
    EXPECT_EQ(dictionary.number(0xF030, 0), 2u) << "the count stays";
    EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0}));
    (void)bench.request(2);
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({0, 0})), Abort::none) << "no expectation";
    EXPECT_EQ(bench.request(4), (AlStatus{AlState::safeop, false, 0}));
    (void)bench.request(2);
    // The data have fewer or more elements than the count.
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({2, 0, 0x51, 0, 0, 0})), Abort::length_too_low);
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({1, 0, 0x51, 0, 0, 0, 0x52, 0, 0, 0})), Abort::length_too_high);
    EXPECT_EQ(bench.write_list(0xF030, 0, raw({4, 0})), Abort::value_too_high);
    EXPECT_EQ(dictionary.number(0xF030, 0), 0u);
}

}  // namespace
}  // namespace margay::subdevice
