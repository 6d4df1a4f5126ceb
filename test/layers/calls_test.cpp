// The table "Coming from SOEM or IgH" of README.md names only functions and members that exist.
#include <places.hpp>
#include "layers/calls_check.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace margay::layers {
namespace {

const std::filesystem::path kProject = MARGAY_SOURCE_DIR;

// The identifiers of all headers below these folders, and the names of the headers.
std::set<std::string> names_in(const std::vector<std::string>& folders) {
    std::set<std::string> names;
    for (const auto& folder : folders)
        for (const auto& entry : std::filesystem::recursive_directory_iterator(kProject / folder)) {
            const auto extension = entry.path().extension();
            if (extension != ".h" && extension != ".hpp") continue;
            names.merge(identifiers_of(text_of(entry.path())));
            names.insert({entry.path().stem(), "hpp"});
        }
    return names;
}

TEST(Calls, ExistInTheTableForUsersOfOtherMasters) {
    CallNames names{names_in({"src/compat/soem/include", "src/compat/soem1/include"}),
                    names_in({"src/compat/ecrt/include"}), names_in({"include", "osal", "oshw"})};
    names[2].insert("eoe_bridge");  // a program
    const auto faults = call_faults(text_of(kProject / "README.md"), names);
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

TEST(Calls, CatchesNamesThatDoNotExist) {
    const CallNames names{identifiers_of("int ec_init(char *name);"), identifiers_of("ecrt_master_send"),
                          identifiers_of("Result<> init(Context& ctx);  // begins")};
    const auto faults_of = [&](const std::string& row) {
        return joined(call_faults(
            "## Coming from SOEM or IgH\n\n| SOEM | IgH | `x` |\n|---|---|---|\n" + row + "\n\n## Next\n| `y` | | |\n",
            names));
    };
    EXPECT_EQ(faults_of("| `ec_init` | `send` | `init(ctx)`, in words |"), "");
    EXPECT_EQ(faults_of("| | `master_send` | the loop |"), "");
    EXPECT_EQ(faults_of("| `ec_begin` | | |"), "\nREADME.md, column SOEM: no such name: ec_begin");
    EXPECT_EQ(faults_of("| | `receive` | |"), "\nREADME.md, column IgH: no such name: receive");
    EXPECT_EQ(faults_of("| | | `init(ctx, begins)` |"), "\nREADME.md, column Margay: no such name: begins");
    EXPECT_EQ(faults_of(""), "\nREADME.md: no table of calls");
    EXPECT_EQ(joined(call_faults("", names)), "\nREADME.md: no section \"Coming from SOEM or IgH\"");
}

}  // namespace
}  // namespace margay::layers
