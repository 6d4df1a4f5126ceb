// The includes of the project follow the table of layers, and the check detects violations.
#include <places.hpp>
#include "layers/include_check.hpp"

#include <gtest/gtest.h>

namespace margay::layers {
namespace {

TEST(Includes, OfTheProjectFollowTheTable) {
    const auto tree = load_tree(MARGAY_SOURCE_DIR);
    ASSERT_GT(tree.size(), 20U);
    const auto faults = include_faults(tree);
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

// A correct tree. Each test below adds one fault to it.
SourceTree sound_tree() {
    return {
        {"include/margay/time.hpp", "#include <chrono>\n"},
        {"oshw/nic.hpp", "#include <margay/time.hpp>\n"},
        {"oshw/linux/packet_nic.hpp", "#include \"oshw/nic.hpp\"\n#include <linux/if_packet.h>\n"},
        {"src/util/bytes.hpp", "#include <span>\n"},
        {"src/wire/esc.hpp", "#include \"util/bytes.hpp\"\n"},
        {"src/link/link.hpp", "#include \"oshw/nic.hpp\"\n#include \"wire/esc.hpp\"\n"},
        {"src/subdevice/device.hpp", "#include \"wire/esc.hpp\"\n"},
        {"src/sim/esc.hpp", "#include \"subdevice/device.hpp\"\n#include <vector>\n"},
        {"src/context.cpp", "// #include <iostream>\n#include \"link/link.hpp\"\n"},
        {"samples/slaveinfo.cpp", "#include <fmt/format.h>\n#include \"oshw/linux/packet_nic.hpp\"\n"},
    };
}

SourceTree with(const std::string& path, const std::string& line) {
    auto tree = sound_tree();
    for (auto& file : tree) {
        if (file.path == path) {
            file.text += line + "\n";
            return tree;
        }
    }
    tree.push_back({path, line + "\n"});
    return tree;
}

TEST(Includes, SoundTreeHasNoFault) { EXPECT_EQ(joined(include_faults(sound_tree())), ""); }

TEST(Includes, CatchesEachKindOfFault) {
    struct {
        const char* file;
        const char* include;
        const char* fault;
    } const cases[] = {
        {"src/wire/esc.hpp", "#include \"link/link.hpp\"",
         "src/wire/esc.hpp:2: wire may not include src/link/link.hpp"},
        {"src/util/bytes.hpp", "  #  include \"wire/esc.hpp\"",
         "src/util/bytes.hpp:2: util may not include src/wire/esc.hpp"},
        {"include/margay/time.hpp", "#include \"util/bytes.hpp\"",
         "time.hpp:2: include may not include src/util/bytes.hpp"},
        {"src/link/link.hpp", "#include \"oshw/linux/packet_nic.hpp\"",
         "link may not include oshw/linux/packet_nic.hpp"},
        {"src/link/link.hpp", "#include \"sim/esc.hpp\"", "link may not include src/sim/esc.hpp"},
        {"src/sim/esc.hpp", "#include \"link/link.hpp\"", "sim may not include src/link/link.hpp"},
        {"src/context.cpp", "#include \"subdevice/device.hpp\"",
         "context.cpp:3: api may not include src/subdevice/device.hpp"},
        {"src/compat/soem.hpp", "#include \"link/link.hpp\"", "compat may not include src/link/link.hpp"},
        {"oshw/linux/packet_nic.hpp", "#include \"../../samples/slaveinfo.cpp\"",
         "there is no ../../samples/slaveinfo.cpp"},
        {"src/sim/esc.hpp", "#include <iostream>", "esc.hpp:3: <iostream> needs more than core code may ask for"},
        {"src/link/link.hpp", "#include <vector>", "<vector> needs more"},
        {"src/link/link.hpp", "#include <sys/socket.h>", "<sys/socket.h> needs more"},
        {"src/sim/esc.hpp", "#include <fmt/format.h>", "<fmt/format.h> belongs to samples/ and test/ only"},
        {"oshw/linux/packet_nic.hpp", "#include <pcap/pcap.h>", "<pcap/pcap.h> belongs to oshw/pcap/ only"},
        {"samples/slaveinfo.cpp", "#include <gtest/gtest.h>", "<gtest/gtest.h> belongs to test/ only"},
        {"src/link/link.hpp", "#include \"link/gone.hpp\"", "there is no link/gone.hpp in the project"},
        {"src/link/link.hpp", "#include <margay/gone.hpp>", "there is no margay/gone.hpp in the project"},
        {"src/cellar/wine.hpp", "#include <span>", "src/cellar/wine.hpp:1: the table of layers has no row"},
    };
    for (const auto& c : cases) {
        const auto faults = include_faults(with(c.file, c.include));
        ASSERT_GE(faults.size(), 1U) << c.include;  // an include of a higher layer can also close a circle
        EXPECT_NE(faults[0].find(c.fault), std::string::npos) << c.include << joined(faults);
    }
}

TEST(Includes, CatchesCirclesWithinAFolder) {
    auto tree = with("src/wire/fmmu.hpp", "#include \"wire/sync_manager.hpp\"");
    tree.push_back({"src/wire/sync_manager.hpp", "#include \"esc.hpp\"\n#include \"fmmu.hpp\"\n"});
    const auto faults = include_faults(tree);
    ASSERT_EQ(faults.size(), 1U) << joined(faults);
    EXPECT_EQ(faults[0], "src/wire/fmmu.hpp: includes itself through src/wire/sync_manager.hpp");
    EXPECT_EQ(include_faults(with("src/wire/esc.hpp", "#include \"wire/esc.hpp\"")).size(), 1U);
}

}  // namespace
}  // namespace margay::layers
