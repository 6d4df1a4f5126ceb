// Texts of emergency error codes: some lines of the table in ETG.1000.6. The text of the most specific line is used.
#include "wire/emergency_code.hpp"

#include <gtest/gtest.h>

namespace margay::wire {
namespace {

TEST(EmergencyCode, SaysWhatTheStandardSays) {
    EXPECT_EQ(emergency_text(0x0000), "error reset or no error");
    EXPECT_EQ(emergency_text(0x1000), "generic error");
    EXPECT_EQ(emergency_text(0x2310), "current, device output side");
    EXPECT_EQ(emergency_text(0x2400), "current");
    EXPECT_EQ(emergency_text(0x3210), "voltage inside the device");
    EXPECT_EQ(emergency_text(0x4310), "temperature");
    EXPECT_EQ(emergency_text(0x7500), "communication") << "IEC 61800-7-201";
    EXPECT_EQ(emergency_text(0x7305), "sensor");
    EXPECT_EQ(emergency_text(0x8611), "positioning controller");
    EXPECT_EQ(emergency_text(0x8210), "PDO not processed, wrong length");
    EXPECT_EQ(emergency_text(0x8211), "protocol error");
    EXPECT_EQ(emergency_text(0xA001), "SAFEOP to OP not successful");
    EXPECT_EQ(emergency_text(0xA0FF), "EtherCAT state machine");
    EXPECT_EQ(emergency_text(0xFF42), "device specific");
    EXPECT_EQ(emergency_text(0xB000), "unknown code");
}

}  // namespace
}  // namespace margay::wire
