// "odd_device": 64 KiB of objects, including slow objects, PDOs with free mapping, and outputs that are copied to the
// inputs. Other unusual behaviour is activated by quirks (quirks.hpp).
#include "sim/library/device_tables.hpp"

namespace margay::sim {

namespace {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr unsigned kBlocks = 64;
constexpr std::size_t kBlockBytes = 1024;
constexpr std::uint16_t kFirstBlock = 0x2000;
constexpr unsigned kWords = 32;  // words of process data in each direction
constexpr std::size_t kMappingEntries = 16;

struct Values {
    static constexpr std::size_t blocks = 0;
    static constexpr std::size_t outputs = blocks + kBlocks * kBlockBytes;
    static constexpr std::size_t inputs = outputs + 2 * kWords;
    using slow = Field<std::uint32_t, inputs + 2 * kWords>;
    static constexpr std::size_t pdos = slow::end;  // 0x1600, 0x1601, 0x1A00, 0x1A01
    static constexpr std::size_t pdo_bytes = kListBytes<std::uint32_t, kMappingEntries>;
    static constexpr std::size_t rx_assignment = pdos + 4 * pdo_bytes;
    static constexpr std::size_t tx_assignment = rx_assignment + kListBytes<std::uint16_t, 2>;
    static constexpr std::size_t bytes = tx_assignment + kListBytes<std::uint16_t, 2>;
};

constexpr DeviceDescription kDevice{
    .vendor_id = kVendorId,
    .product_code = 0x0DD0,
    .revision = 1,
    .name = "Device of odd manners",
    .order_code = "MG0DD0",
    .group = "Tools",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128, .min_bytes = 34, .max_bytes = 1024},
                {.start = 0x1400, .size_bytes = 128, .min_bytes = 34, .max_bytes = 1024}},
    .outputs = {.sync_manager = 2, .start = 0x1800, .max_bytes = 2 * kWords, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1A00, .max_bytes = 2 * kWords},
    .dc = {.supported = true},
    .free_run_cycle = 1ms,
};
using Common = CommonObjects<kDevice, 0>;

// --- A slow object: 0.5 s to read, 0.2 s to write ---

class OddDevice;
HookAnswer slow_read(const ObjectAccess& access);
HookAnswer slow_write(const ObjectAccess& access, Bytes data);
constexpr ObjectHooks kSlowHooks{.before_read = slow_read, .before_write = slow_write};

// --- Tables ---

constexpr Entry block(unsigned n) {
    return octets(0, "Block of 1024 octets", DataType::octet_string, od::kReadWrite | od::kBackup,
                  Values::blocks + n * kBlockBytes, kBlockBytes);
}
constexpr auto kBlockEntries = [] {
    std::array<std::array<Entry, 1>, kBlocks> entries{};
    for (unsigned n = 0; n < kBlocks; ++n) entries[n][0] = block(n);
    return entries;
}();
constexpr Entry kSlow[] = {value<Values::slow>(0, "Slow object", od::kReadWrite)};

constexpr Entry words(const char* name, std::uint16_t access, std::size_t offset) {
    return Entry{.subindex = 1,
                 .count = kWords,
                 .storage = Storage::image,
                 .type = DataType::unsigned16,
                 .access = access,
                 .bits = 16,
                 .offset = static_cast<std::uint32_t>(offset),
                 .name = name};
}
constexpr Entry kInputs[] = {entry_count(kWords), words("Word", od::kRead | od::kTxMappable, Values::inputs)};
constexpr Entry kOutputs[] = {entry_count(kWords), words("Word", od::kReadWrite | od::kRxMappable, Values::outputs)};

constexpr auto pdo(unsigned n, std::uint16_t index, std::uint8_t first, std::uint8_t count) {
    std::array<std::uint32_t, kMappingEntries> entries{};
    for (std::uint8_t i = 0; i < count; ++i) entries[i] = map(index, static_cast<std::uint8_t>(first + i), 16);
    return changeable_list<std::uint32_t, kMappingEntries>(Values::pdos + n * Values::pdo_bytes, count, "Mapping entry",
                                                           entries);
}
constexpr auto kRxPdo1 = pdo(0, 0x7000, 1, 4);
constexpr auto kRxPdo2 = pdo(1, 0x7000, 5, 8);
constexpr auto kTxPdo1 = pdo(2, 0x6000, 1, 4);
constexpr auto kTxPdo2 = pdo(3, 0x6000, 5, 8);
constexpr auto kRxAssignment = changeable_list<std::uint16_t, 2>(Values::rx_assignment, 1, "Assigned PDO", {0x1600});
constexpr auto kTxAssignment = changeable_list<std::uint16_t, 2>(Values::tx_assignment, 1, "Assigned PDO", {0x1A00});

constexpr auto kObjects = [] {
    std::array<Object, 14 + kBlocks + 3> objects{};
    std::size_t n = 0;
    for (const auto& object :
         {Common::device_type, Common::error_history, Common::device_name, Common::hardware, Common::software,
          Common::identity, Common::diagnosis,
          record(0x1600, "RxPDO 1", kRxPdo1, &kPdoMappingHooks, DataType::pdo_mapping),
          record(0x1601, "RxPDO 2", kRxPdo2, &kPdoMappingHooks, DataType::pdo_mapping),
          record(0x1A00, "TxPDO 1", kTxPdo1, &kPdoMappingHooks, DataType::pdo_mapping),
          record(0x1A01, "TxPDO 2", kTxPdo2, &kPdoMappingHooks, DataType::pdo_mapping), Common::sync_manager_types,
          array(0x1C12, "RxPDO assignment", kRxAssignment, &kPdoAssignmentHooks),
          array(0x1C13, "TxPDO assignment", kTxAssignment, &kPdoAssignmentHooks)})
        objects[n++] = object;
    for (unsigned b = 0; b < kBlocks; ++b)
        objects[n++] = variable(static_cast<std::uint16_t>(kFirstBlock + b), "Block", kBlockEntries[b]);
    objects[n++] = variable(0x2100, "Slow object", kSlow, &kSlowHooks);
    objects[n++] = array(0x6000, "Inputs", kInputs);
    objects[n++] = array(0x7000, "Outputs", kOutputs);
    return objects;
}();
static_assert(well_formed(kObjects, Values::bytes));

class OddDevice final : public Model {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return kDevice; }
    void start(const Surroundings& around, Time) override {
        image_ = around.dictionary->image();
        ready_ = kNever;
        for (std::size_t i = 0; i < kBlocks * kBlockBytes; ++i) image_[i] = static_cast<std::byte>(i / kBlockBytes + i);
    }
    void cycle(Time, bool) override {
        std::copy_n(image_.begin() + Values::outputs, 2 * kWords, image_.begin() + Values::inputs);
    }
    HookAnswer delay_answer(Time now, Duration how_long) {
        if (ready_ == kNever) ready_ = now + how_long;
        if (now < ready_) return HookAnswer::later(ready_);
        ready_ = kNever;
        return Abort::none;
    }

  private:
    MutableBytes image_;
    Time ready_ = kNever;
};

HookAnswer slow_read(const ObjectAccess& access) {
    return static_cast<OddDevice*>(access.application)->delay_answer(access.now, 500ms);
}
HookAnswer slow_write(const ObjectAccess& access, Bytes) {
    return static_cast<OddDevice*>(access.application)->delay_answer(access.now, 200ms);
}

}  // namespace

constexpr Blueprint kOddDevice = blueprint<OddDevice>("odd_device", kDevice, kObjects, Values::bytes);

}  // namespace margay::sim
