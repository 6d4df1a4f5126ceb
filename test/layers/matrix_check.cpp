#include "layers/matrix_check.hpp"

#include <algorithm>
#include <regex>
#include <set>

namespace margay::layers {
namespace {

// "FOLDER/SUITE.TEST" of every GoogleTest in the tree.
std::vector<std::string> tests_of(const SourceTree& tree) {
    static const std::regex form(R"(TEST(?:_F|_P)?\((\w+),\s*(\w+)\))");
    std::vector<std::string> names;
    for (const auto& file : tree) {
        if (layer_of(file.path) != "test") continue;
        const auto folder = file.path.substr(5, file.path.rfind('/') - 5);
        for (std::sregex_iterator match(file.text.begin(), file.text.end(), form), end; match != end; ++match)
            names.push_back(folder + "/" + match->str(1) + "." + match->str(2));
    }
    return names;
}

bool there(const std::string& name, const std::vector<std::string>& tests, const SourceTree& tree) {
    const auto file_begins = [&](const std::string& path) {
        return std::any_of(tree.begin(), tree.end(), [&](const auto& file) { return file.path.rfind(path, 0) == 0; });
    };
    if (name.rfind("bench_", 0) == 0) return file_begins("test/bench/" + name.substr(6) + ".cpp");
    if (name.rfind("fuzz/", 0) == 0) return file_begins("test/" + name);
    if (name.rfind("install/", 0) == 0) return file_begins("test/install/");
    static const std::vector<std::string> nested = {"embedded/arm_builds",
                                                    "embedded/cortex_m0plus_builds",
                                                    "embedded/cortex_m7_builds",
                                                    "embedded/rv32_builds",
                                                    "embedded/rv32_read_modify_write",
                                                    "embedded/footprint",
                                                    "embedded/footprint_table",
                                                    "embedded/sizes",
                                                    "big_endian/wire",
                                                    "big_endian/engine",
                                                    "big_endian/segment",
                                                    "clang/builds",
                                                    "compat/soem1_rows",
                                                    "compat/soem1_layout_tree_plain",
                                                    "compat/soem1_simple_demo_over_veth",
                                                    "compat/soem1_firmware",
                                                    "compat/soem1_low_level",
                                                    "compat/soem1_no_link",
                                                    "compat/soem1_block_lrw",
                                                    "compat/soem1_mute",
                                                    "compat/soem1_partial",
                                                    "compat/soem1_ring",
                                                    "compat/soem1_services",
                                                    "compat/soem2_machine",
                                                    "compat/readme",
                                                    "compat/ecrt/user",
                                                    "compat/ecrt/ring",
                                                    "compat/ecrt/dc_ring",
                                                    "compat/ecrt/ip_stack",
                                                    "compat/ecrt/moved",
                                                    "compat/ecrt/after_silence",
                                                    "compat/ecrt/early_request",
                                                    "compat/ecrt/request_rules",
                                                    "compat/ecrt/starts_beside_mute",
                                                    "compat/ecrt/starts_of_many_by_domains",
                                                    "compat/ecrt/late_outputs",
                                                    "compat/ecrt/silent",
                                                    "compat/ecrt/user_over_veth",
                                                    "compat/ecrt/eoe_over_veth",
                                                    "test/run.sh"};
    if (std::find(nested.begin(), nested.end(), name) != nested.end()) return true;
    return std::any_of(tests.begin(), tests.end(), [&](const auto& test) { return test.rfind(name, 0) == 0; });
}

}  // namespace

Faults matrix_faults(const std::string& text, const SourceTree& tree, const std::string& file) {
    static const std::regex quoted("`((?:bench_|[a-z_]+/)[^`]*)`");
    const auto tests = tests_of(tree);
    Faults faults;
    for (const auto view : lines_of(text)) {
        const std::string line(view);
        const auto status = line.find("| works |");
        if (line.rfind("| ", 0) != 0 || (status == std::string::npos && line.find("| partly |") == std::string::npos &&
                                         line.find("| planned |") == std::string::npos))
            continue;
        const auto proof = line.substr(line.find("|", line.find(" |") + 2));
        std::size_t named = 0;
        for (std::sregex_iterator match(proof.begin(), proof.end(), quoted), end; match != end; ++match) {
            auto name = match->str(1);
            if (const auto open = name.find("…"); open != std::string::npos) name.resize(open);
            ++named;
            if (!there(name, tests, tree)) faults.push_back(file + ": no such test: " + match->str(1));
        }
        if (status != std::string::npos && named == 0) faults.push_back(file + ": works, but by which test? " + line);
    }
    return faults;
}

Faults thread_faults(const std::string& text, const std::string& file) {
    static const std::regex thread("`([A-Z]#[0-9]+)`");
    static const std::regex status(R"(\| (works|partly|planned) \|)");
    std::set<std::string> seen;
    Faults faults;
    for (const auto view : lines_of(text)) {
        const std::string line(view);
        if (line.rfind("| ", 0) != 0) continue;
        for (std::sregex_iterator match(line.begin(), line.end(), thread), end; match != end; ++match) {
            if (!seen.insert(match->str(1)).second) faults.push_back(file + ": named twice: " + match->str(1));
            if (!std::regex_search(line, status)) faults.push_back(file + ": no status: " + match->str(1));
        }
    }
    return faults;
}

}  // namespace margay::layers
