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
        "slave 2: assigning station addresses at register 0x0010: wrong working counter (expected 1, got 0): the slave "
        "does not answer");
    EXPECT_EQ(sentence({.code = Errc::capacity, .step = Step::count_slaves, .expected = 100, .actual = 64}),
              "counting slaves: not enough memory: Limits::slaves (needed 100, there is "
              "room for 64)");
}

TEST(Describe, NamesTheArgumentThatIsOutOfRange) {
    const auto said = [](Step step, Argument argument, std::uint32_t expected = 0, std::uint32_t actual = 0) {
        return sentence({.code = Errc::invalid_argument,
                         .step = step,
                         .detail = static_cast<std::uint32_t>(argument),
                         .expected = expected,
                         .actual = actual});
    };
    EXPECT_EQ(said(Step::open_nic, Argument::limit_groups, 256, 0),
              "opening the network interface: argument out of range: Limits::groups is 0, it must be 1 to 256");
    EXPECT_EQ(said(Step::sdo_upload, Argument::priority),
              "SDO upload: argument out of range: the priority must be 0 "
              "to 3");
    EXPECT_EQ(said(Step::none, Argument::unknown), "argument out of range");
    EXPECT_TRUE(said(Step::command_ps, Argument::limit_slaves).ends_with("): argument out of range"))
        << "the detail of a command is not an argument";
}

TEST(Describe, NamesNoObjectWhenTheRequestAsAWholeFailed) {
    EXPECT_EQ(sentence({.code = Errc::timeout, .step = Step::sdo_download}), "SDO download: timed out");
    EXPECT_EQ(sentence({.code = Errc::canceled, .step = Step::soe_read, .slave = 2}),
              "slave 2: SoE read: the request was canceled");
    EXPECT_TRUE(sentence({.code = Errc::in_callback, .step = Step::sdo_upload, .slave = 2})
                    .starts_with("slave 2: SDO upload: this call is not possible in a callback"));
    EXPECT_EQ(sentence({.code = Errc::sdo_abort, .step = Step::sdo_upload, .slave = 2, .detail = 0x06020000}),
              "slave 2: SDO upload of 0x0000:0: the slave aborted the transfer (abort code 0x06020000: object does not "
              "exist)")
        << "an object that was asked for";
    EXPECT_EQ(sentence({.code = Errc::unknown_group, .step = Step::map_process_data}),
              "mapping process data of group 0: there is no such group, or nothing is mapped in it: call config_map()");
    EXPECT_EQ(sentence({.code = Errc::wrong_state, .step = Step::sdo_upload, .slave = 2, .index = 0x1000}),
              "slave 2: SDO upload of 0x1000:0: not possible in this state (the mailbox of the slave is closed: the "
              "slave is in INIT, or was not read)");
}

TEST(Describe, SaysThatANicCouldNotBeOpened) {
    EXPECT_EQ(sentence({.code = Errc::nic, .step = Step::open_nic, .actual = 19}),
              "opening the network interface: the network interface could not be opened (system error 19): problem() "
              "of the NIC says why");
    EXPECT_EQ(sentence({.code = Errc::nic, .step = Step::read_state, .actual = 19}),
              "reading the state: the network interface refused the frame (system error 19)");
}

TEST(Describe, DistinguishesASilentSlaveFromOneThatDoesNotExist) {
    EXPECT_EQ(sentence({.code = Errc::missing_slave, .step = Step::recover, .slave = 2}),
              "slave 2: recovering the slave: the slave does not answer: check its power and its cable");
    EXPECT_EQ(sentence({.code = Errc::unknown_slave, .step = Step::recover, .slave = 4, .expected = 3}),
              "slave 4: recovering the slave: there is no such slave (there are 3)");
    EXPECT_EQ(sentence({.code = Errc::missing_slave, .step = Step::recover}),
              "recovering the slave: no lost slave was found");
}

TEST(Describe, OneOctetIsNotSeveral) {
    EXPECT_NE(sentence({.code = Errc::pdo_unknown, .step = Step::discover_pdos, .slave = 1, .expected = 1})
                  .find("(used: 1 octet, as the SII says)"),
              std::string::npos);
    EXPECT_NE(sentence({.code = Errc::pdo_unknown, .step = Step::discover_pdos, .slave = 1, .expected = 2})
                  .find("(used: 2 octets, as the SII says)"),
              std::string::npos);
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
