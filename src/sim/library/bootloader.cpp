// "bootloader" and "bootloader_open": devices whose firmware is replaced by FoE in BOOT. A valid image is used from the
// next start of the firmware, which happens on the transition to INIT. The revision in the SII and in object 0x1018 is
// the version of the firmware. Without a valid image the device refuses PREOP. "bootloader" has a password and
// mailboxes of its own for BOOT, "bootloader_open" has neither, and 32 MiB of flash memory.
#include "sim/library/bootloader.hpp"

#include "sim/library/device_tables.hpp"

#include <algorithm>

namespace margay::sim {

namespace {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr std::uint32_t kFirstRevision = 0x0001'0000;  // version 1.0

constexpr DeviceDescription kDevice{
    .vendor_id = kVendorId,
    .product_code = Bootloader::kProduct,
    .revision = kFirstRevision,
    .name = "Device with bootloader",
    .order_code = "MG5B00",
    .group = "Tools",
    .protocols = {.coe = true, .foe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128, .min_bytes = 34, .max_bytes = 256},
                {.start = 0x1100, .size_bytes = 128, .min_bytes = 34, .max_bytes = 256}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 512}, {.start = 0x1400, .size_bytes = 512}},
    .inputs = {.sync_manager = 3, .start = 0x1800, .max_bytes = 2},
};

constexpr DeviceDescription kOpenDevice{
    .vendor_id = kVendorId,
    .product_code = Bootloader::kOpenProduct,
    .revision = kFirstRevision,
    .name = "Device with open bootloader",
    .order_code = "MG5B01",
    .group = "Tools",
    .protocols = {.coe = true, .foe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 1024, .min_bytes = 34, .max_bytes = 1024},
                {.start = 0x1400, .size_bytes = 1024, .min_bytes = 34, .max_bytes = 1024}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 1024}, {.start = 0x1400, .size_bytes = 1024}},
    .inputs = {.sync_manager = 3, .start = 0x1800, .max_bytes = 2},
};

constexpr Bootloader::Variant kVariant{.description = &kDevice, .password = Bootloader::kPassword};
constexpr Bootloader::Variant kOpenVariant{.description = &kOpenDevice, .flash_bytes = 32 * 1024 * 1024};

struct Values {
    using uptime = Field<std::uint16_t, 0>;
    using revision = Field<std::uint32_t, 2>;
    static constexpr std::size_t bytes = revision::end;
};

MutableBytes version_text(const ObjectAccess& access) {
    return static_cast<Bootloader*>(access.application)->version_text();
}
constexpr ObjectHooks kVersionHooks{.memory = version_text};

constexpr Entry kSoftware[] = {provided(0, "Software version", DataType::visible_string, 0, od::kReadOnly)};
constexpr Entry kUptime[] = {value<Values::uptime>(0, "Seconds since start", od::kRead | od::kTxMappable)};
constexpr Entry kTxPdo[] = {entry_count(1), mapped(1, 0x2000, 0, 16)};
constexpr Entry kTxAssignment[] = {entry_count(1), assigned(1, 0x1A00)};

constexpr std::array<Entry, 5> identity_of(const DeviceDescription& device) {
    auto entries = identity_entries(device);
    entries[3] = value<Values::revision>(3, "Revision", od::kReadOnly);
    return entries;
}

template <const DeviceDescription& Device>
struct Tables {
    using Common = CommonObjects<Device, 0>;
    static constexpr std::array<Entry, 5> kIdentity = identity_of(Device);
    static constexpr Object kObjects[] = {
        Common::device_type,
        Common::error_history,
        Common::device_name,
        Common::hardware,
        variable(0x100A, "Software version", kSoftware, &kVersionHooks),
        record(0x1018, "Identity", kIdentity, nullptr, DataType::identity),
        Common::diagnosis,
        record(0x1A00, "TxPDO", kTxPdo, nullptr, DataType::pdo_mapping),
        Common::sync_manager_types,
        array(0x1C13, "TxPDO assignment", kTxAssignment),
        variable(0x2000, "Seconds since start", kUptime),
    };
};
static_assert(well_formed(Tables<kDevice>::kObjects, Values::bytes));

constexpr std::string_view kFile = "firmware";
constexpr Duration kErase = 30ms;
constexpr Duration kCheckAndStore = 50ms;

// CRC-32 of IEEE 802.3, the common CRC-32 of files.
std::uint32_t crc32(Bytes data) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const auto octet : data) {
        crc ^= std::to_integer<std::uint32_t>(octet);
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xEDB88320u : 0u);
    }
    return ~crc;
}

}  // namespace

const DeviceDescription& Bootloader::description() const { return *variant_.description; }

std::vector<std::byte> Bootloader::make_image(std::uint16_t major, std::uint16_t minor, std::size_t code_bytes,
                                              std::uint32_t product) {
    std::vector<std::byte> image(ImageLayout::bytes + code_bytes);
    for (std::size_t i = 0; i < code_bytes; ++i)
        image[ImageLayout::bytes + i] = static_cast<std::byte>(i * 7 + i / 256);
    ImageLayout::magic::store(image, ImageLayout::kMagic);
    ImageLayout::product::store(image, product);
    ImageLayout::minor::store(image, minor);
    ImageLayout::major::store(image, major);
    ImageLayout::checksum::store(image, crc32(Bytes(image).subspan(ImageLayout::product::offset)));
    return image;
}

FoeAnswer Bootloader::check_image(Bytes image) const {
    if (image.size() < ImageLayout::bytes || ImageLayout::magic::load(image) != ImageLayout::kMagic)
        return FoeAnswer::error(FoeError::no_file_header, "this is no firmware image");
    if (ImageLayout::checksum::load(image) != crc32(image.subspan(ImageLayout::product::offset)))
        return FoeAnswer::error(FoeError::wrong_checksum, "the checksum of the image is wrong");
    if (ImageLayout::product::load(image) != variant_.description->product_code)
        return FoeAnswer::error(FoeError::file_incompatible, "the image is for another product");
    return FoeAnswer::go();
}

Bootloader::Bootloader(const Variant& variant)
    : variant_(variant), flash_(make_image(1, 0, 4096, variant.description->product_code)) {}

void Bootloader::start(const Surroundings& around, Time now) {
    image_ = around.dictionary->image();
    started_ = now;
    restart_ = false;
    valid_ = check_image(flash_).goes();
    text_ = {};
    const std::uint32_t known = sii_revision_.stored() != 0 ? sii_revision_.stored() : kFirstRevision;
    const auto revision =
        valid_ ? std::uint32_t{ImageLayout::major::load(flash_)} << 16 | ImageLayout::minor::load(flash_) : known;
    Values::revision::store(image_, revision);
    sii_revision_.start(*around.esc, known, revision);
    if (!valid_) return;
    auto at = text_.begin();
    const auto number = [&](unsigned value) {
        for (unsigned scale = 10000; scale > 0; scale /= 10)
            if (value >= scale || scale == 1) *at++ = static_cast<std::byte>('0' + value / scale % 10);
    };
    number(ImageLayout::major::load(flash_));
    *at++ = std::byte{'.'};
    number(ImageLayout::minor::load(flash_));
    text_bytes_ = static_cast<std::size_t>(at - text_.begin());
}

void Bootloader::cycle(Time now, bool) {
    Values::uptime::store(image_, static_cast<std::uint16_t>((now - started_) / 1s));
}

Verdict Bootloader::may(subdevice::Transition transition, Time) {
    if (transition == subdevice::Transition{AlState::init, AlState::preop} && !valid_)
        return Verdict::refuse(AlStatusCode::no_valid_firmware);
    return Verdict::go();
}

// A new image is started when the device leaves BOOT.
void Bootloader::after(subdevice::Transition transition, Time) {
    if (transition == subdevice::Transition{AlState::boot, AlState::init} && loaded_) restart_ = true;
}

bool Bootloader::wants_restart() {
    const bool wanted = restart_;
    restart_ = false;
    if (wanted) loaded_ = false;
    return wanted;
}

// ------------------------------------------------------------------ the firmware file

FoeAnswer Bootloader::check(const FoeFile& file) const {
    if (file.state != AlState::boot) return FoeAnswer::error(FoeError::bootstrap_only);
    if (file.name != kFile) return FoeAnswer::error(FoeError::not_found, "the only file is 'firmware'");
    if (variant_.password && file.password != *variant_.password)
        return FoeAnswer::error(FoeError::no_rights, "wrong password");
    return FoeAnswer::go();
}

FoeAnswer Bootloader::open_to_read(const FoeFile& file, Time) { return check(file); }

FoeAnswer Bootloader::read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time) {
    bytes = std::min(into.size(), flash_.size() - std::min(offset, flash_.size()));
    std::copy_n(flash_.begin() + static_cast<std::ptrdiff_t>(offset), bytes, into.begin());
    return FoeAnswer::go();
}

// The flash must be erased first, which takes time. From now on there is no valid firmware.
FoeAnswer Bootloader::open_to_write(const FoeFile& file, Time now) {
    if (const auto refused = check(file); !refused.goes()) return refused;
    flash_.clear();
    valid_ = false;
    loaded_ = false;
    busy_until_ = now + kErase;
    finishing_ = false;
    return FoeAnswer::go();
}

FoeAnswer Bootloader::write(std::size_t offset, Bytes data, Time now) {
    if (now < busy_until_) return busy(now, kErase, "erasing");
    if (offset != flash_.size()) return FoeAnswer::error(FoeError::illegal);
    if (flash_.size() + data.size() > variant_.flash_bytes)
        return FoeAnswer::error(FoeError::disk_full, "the image is larger than the flash");
    flash_.insert(flash_.end(), data.begin(), data.end());
    return FoeAnswer::go();
}

FoeAnswer Bootloader::finish_write(std::size_t, Time now) {
    if (!finishing_) busy_until_ = now + kCheckAndStore;
    finishing_ = true;
    if (now < busy_until_) return busy(now, kCheckAndStore, "checking");
    if (const auto verdict = check_image(flash_); !verdict.goes()) return verdict;
    valid_ = loaded_ = true;
    return FoeAnswer::go();
}

FoeAnswer Bootloader::busy(Time now, Duration all, std::string_view what) const {
    const auto left = busy_until_ - now;
    return FoeAnswer::busy(static_cast<std::uint16_t>((all - left) * 100 / all), 100, what);
}

namespace {

class WithPassword final : public Bootloader {
  public:
    WithPassword() : Bootloader(kVariant) {}
};
class Open final : public Bootloader {
  public:
    Open() : Bootloader(kOpenVariant) {}
};

}  // namespace

constexpr Blueprint kBootloader =
    blueprint<WithPassword>("bootloader", kDevice, Tables<kDevice>::kObjects, Values::bytes, {.pdi_control = kSpi});
constexpr Blueprint kOpenBootloader = blueprint<Open>("bootloader_open", kOpenDevice, Tables<kOpenDevice>::kObjects,
                                                      Values::bytes, {.pdi_control = kSpi});

}  // namespace margay::sim
