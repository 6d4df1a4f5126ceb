// Errors as sentences: slave, step, cause.
#include <margay/error.hpp>

#include <gtest/gtest.h>

#include <array>
#include <string>

namespace margay {
namespace {

std::string sentence(const Error& error) {
    std::array<char, 300> buffer{};
    return std::string(describe(error, buffer));
}

TEST(Describe, NamesSlaveStepAndCause) {
    EXPECT_EQ(sentence({.code = Errc::al_status,
                        .step = Step::request_state,
                        .slave = 3,
                        .detail = 0x1E,
                        .expected = 4,
                        .actual = 2}),
              "slave 3: requesting a state: the slave refused (wanted SAFEOP, is in PREOP, AL status code "
              "0x001e: invalid input "
              "configuration)");
    EXPECT_EQ(sentence({.code = Errc::sii_nack, .step = Step::read_sii, .slave = 12, .index = 0x40}),
              "slave 12: reading the SII at word 0x0040: the EEPROM did not acknowledge");
    EXPECT_EQ(
        sentence(
            {.code = Errc::working_counter, .step = Step::assign_address, .slave = 2, .index = 0x10, .expected = 1}),
        "slave 2: assigning station addresses at register 0x0010: wrong working counter (expected 1, got 0)");
    EXPECT_EQ(sentence({.code = Errc::capacity, .step = Step::count_slaves, .expected = 100, .actual = 64}),
              "counting slaves: the application gives too little memory for it: Limits::slaves (needed 100, there is "
              "room for 64)");
}

TEST(Describe, EveryCodeAndStepHasWords) {
    for (int code = 1; code <= static_cast<int>(Errc::supervised); ++code)
        EXPECT_NE(to_text(static_cast<Errc>(code)), "unknown error") << code;
    for (int step = 1; step <= static_cast<int>(Step::application_hook); ++step)
        EXPECT_FALSE(to_text(static_cast<Step>(step)).empty()) << step;
}

TEST(Describe, CutsWhatDoesNotFit) {
    std::array<char, 10> small{};
    EXPECT_EQ(describe({.code = Errc::timeout, .slave = 3}, small), "slave 3: t");
    EXPECT_EQ(describe({.code = Errc::timeout}, std::span<char>()), "");
}

}  // namespace
}  // namespace margay
