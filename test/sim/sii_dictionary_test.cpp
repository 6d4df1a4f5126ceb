// The object dictionary of a device that is known only by its SII.
#include "sim/sii_dictionary.hpp"
#include <places.hpp>
#include "sim/sii_mailbox.hpp"
#include "wire/sii_image.hpp"

#include <gtest/gtest.h>

#include <random>

namespace margay::sim {
namespace {

struct Objects {
    explicit Objects(Bytes image)
        : model(read_sii_model(image)),
          made(image, model),
          values(made.image_bytes()),
          dictionary(made.objects(), values) {}
    SiiModel model;
    SiiDictionary made;
    std::vector<std::byte> values;
    subdevice::ObjectDictionary dictionary;

    // A list object as numbers: count, then values.
    [[nodiscard]] std::vector<std::uint64_t> list(std::uint16_t index) const {
        std::vector<std::uint64_t> all{dictionary.number(index, 0)};
        for (unsigned n = 1; n <= all[0]; ++n) all.push_back(dictionary.number(index, n));
        return all;
    }
};

using List = std::vector<std::uint64_t>;

TEST(SiiDictionary, SaysOfAMadeUpDeviceWhatItsSiiSays) {
    const auto image = wire::sii::MadeUpDevice{}.image();
    const Objects objects(image);
    ASSERT_TRUE(subdevice::well_formed(objects.made.objects(), objects.made.image_bytes()));
    EXPECT_EQ(objects.dictionary.number(0x1018, 1), objects.model.fixed.identity.vendor);
    EXPECT_EQ(objects.dictionary.number(0x1018, 2), objects.model.fixed.identity.product);
    EXPECT_EQ(objects.list(0x1C00), (List{4, 1, 2, 3, 4}));
    EXPECT_EQ(objects.list(0x1C12), (List{1, 0x1600}));
    EXPECT_EQ(objects.list(0x1C13), (List{1, 0x1A00}));
    EXPECT_EQ(objects.list(0x1600), (List{1, 0x60400010}));
    EXPECT_EQ(objects.list(0x1A00), (List{3, 0x60410010, 0x00000003, 0x60600101}));
    const auto* status = objects.dictionary.find(0x6041);
    ASSERT_NE(status, nullptr);
    EXPECT_EQ(status->name, "Status word");
    EXPECT_EQ(status->type, subdevice::DataType::unsigned16);
    EXPECT_EQ(status->entry(0)->access, subdevice::od::kReadOnly | subdevice::od::kTxMappable);
}

// The defaults in the SII of the AKD: PDOs 0x1701 and 0x1B01. (A master had configured other PDOs in the recorded
// drive.)
TEST(SiiDictionary, TakesADrivesDefaultsFromItsSii) {
    if (!wire::sii::have_images()) GTEST_SKIP() << "MARGAY_SII_DIR is not set";
    const Objects objects(wire::sii::image_of("akd.bin"));
    ASSERT_TRUE(subdevice::well_formed(objects.made.objects(), objects.made.image_bytes()));
    EXPECT_EQ(objects.dictionary.number(0x1000, 0), 0x20192U);
    EXPECT_EQ(objects.list(0x1C12), (List{1, 0x1701}));
    EXPECT_EQ(objects.list(0x1C13), (List{1, 0x1B01}));
    EXPECT_EQ(objects.list(0x1701), (List{2, 0x60C10120, 0x60400010}));
    EXPECT_EQ(objects.list(0x1B01), (List{2, 0x60630020, 0x60410010}));
}

// No object extends beyond its memory or exists twice, because every master would find it.
TEST(SiiDictionary, IsWellFormedWhateverTheSiiSays) {
    const auto whole = wire::sii::MadeUpDevice{}.image();
    std::mt19937 random(11);
    for (int round = 0; round < 2000; ++round) {
        auto image = whole;
        for (int n = 0; n < 1 + round % 40; ++n)
            image[0x40 + random() % (image.size() - 0x40)] = static_cast<std::byte>(random());
        const Objects objects(image);
        ASSERT_TRUE(subdevice::well_formed(objects.made.objects(), objects.made.image_bytes())) << round;
        SiiMailbox mailbox(image, objects.model);
        for (std::uint8_t sm = 0; sm < 4; ++sm) (void)mailbox.assigned_bytes(sm);
        mailbox.show(true, objects.values);
    }
}

}  // namespace
}  // namespace margay::sim
