#include "layers/matrix_check.hpp"

#include <algorithm>
#include <regex>

namespace margay::layers {
namespace {

// "FOLDER/SUITE.TEST" of every GoogleTest there is.
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
        return std::any_of(tree.begin(), tree.end(),
                           [&](const auto& file) { return file.path.rfind(path, 0) == 0; });
    };
    if (name.rfind("bench_", 0) == 0) return file_begins("test/bench/" + name.substr(6) + ".cpp");
    if (name.rfind("fuzz/", 0) == 0) return file_begins("test/" + name);
    if (name.rfind("install/", 0) == 0) return file_begins("test/install/");
    static const std::vector<std::string> nested = {"embedded/arm_builds", "clang/builds", "test/run.sh"};
    if (std::find(nested.begin(), nested.end(), name) != nested.end()) return true;
    return std::any_of(tests.begin(), tests.end(),
                       [&](const auto& test) { return test.rfind(name, 0) == 0; });
}

}  // namespace

Faults matrix_faults(const std::string& readme, const SourceTree& tree) {
    static const std::regex quoted("`((?:bench_|[a-z_]+/)[^`]*)`");
    const auto tests = tests_of(tree);
    Faults faults;
    for (const auto view : lines_of(readme)) {
        const std::string line(view);
        const auto status = line.find("| works |");
        if (line.rfind("| ", 0) != 0 ||
            (status == std::string::npos && line.find("| partly |") == std::string::npos))
            continue;
        const auto proof = line.substr(line.find("|", line.find(" |") + 2));
        std::size_t named = 0;
        for (std::sregex_iterator match(proof.begin(), proof.end(), quoted), end; match != end; ++match) {
            auto name = match->str(1);
            if (const auto open = name.find("…"); open != std::string::npos) name.resize(open);
            ++named;
            if (!there(name, tests, tree)) faults.push_back("README.md: no such test: " + match->str(1));
        }
        if (status != std::string::npos && named == 0)
            faults.push_back("README.md: works, but by which test? " + line);
    }
    return faults;
}

}  // namespace margay::layers
