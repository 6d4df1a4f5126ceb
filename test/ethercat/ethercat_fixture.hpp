// Calls of the program ethercat.
#pragma once

#include <places.hpp>
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <string>

namespace margay::process {

class EthercatTest : public testing::Test {
  protected:
    ShellFolder folder;
    const std::string program = std::string(MARGAY_BIN_DIR) + "/ethercat";

    // `segment`: the value of MARGAY_MASTER0.
    [[nodiscard]] Ran ethercat(const std::string& segment, const std::string& arguments) const {
        return folder.run("export MARGAY_MASTER0='" + segment + "'\n" + program + " " + arguments);
    }
    // The output of a call that must succeed without a message.
    [[nodiscard]] std::string out(const std::string& segment, const std::string& arguments) const {
        const auto ran = ethercat(segment, arguments);
        EXPECT_EQ(ran.status, 0) << arguments << "\n" << ran.err;
        EXPECT_EQ(ran.err, "") << arguments;
        return ran.out;
    }
    // A call that must fail with this code and this message.
    void fails(const std::string& segment, const std::string& arguments, int code, const std::string& message) const {
        const auto ran = ethercat(segment, arguments);
        EXPECT_EQ(ran.status, code) << arguments << "\n" << ran.err;
        EXPECT_TRUE(contains(ran.err, message)) << arguments << "\n" << ran.err;
        EXPECT_TRUE(ran.err.starts_with("ethercat: ")) << ran.err;
    }
};

}  // namespace margay::process
