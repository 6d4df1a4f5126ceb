// The undefined symbols of the core archives: no heap, no exceptions, no RTTI, no clock, no printing.
#include <places.hpp>
#include "layers/source_tree.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <regex>

namespace margay::layers {
namespace {

// The output of a command, or nothing when it could not be executed.
std::optional<std::string> output_of(const std::string& command) {
    std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), [](FILE* f) { return pclose(f); });
    if (!pipe) return {};
    std::string out;
    std::array<char, 4096> part{};
    while (const auto n = fread(part.data(), 1, part.size(), pipe.get())) out.append(part.data(), n);
    return pclose(pipe.release()) == 0 ? std::optional(out) : std::nullopt;
}

// Lines of `nm -A --undefined-only` ("archive:member: U symbol") with a symbol that the core must not use.
Faults symbol_faults(const std::string& nm_output) {
    static const std::regex forbidden(
        "(malloc|calloc|realloc|free|aligned_alloc|posix_memalign|strdup"  // heap
        "|_Zn[wa].*|_Zd[la].*"                                             // operator new, delete
        "|__cxa_(throw|rethrow|allocate_exception|begin_catch|bad_.*)|_Unwind_.*|_ZSt[0-9]+__throw_.*"
        "|__dynamic_cast|_ZTVN10__cxxabiv1.*"
        "|clock_gettime|gettimeofday|time|nanosleep|clock_nanosleep|_ZNSt6chrono.*3nowEv"
        "|v?[fsd]?n?printf|__[a-z]*printf_chk|puts|_ZNSo.*|_ZSt4cout|_ZSt4cerr)(@.*)?");
    Faults faults;
    for (const auto line : lines_of(nm_output)) {
        const auto name = line.substr(line.rfind(' ') + 1);
        if (std::regex_match(name.begin(), name.end(), forbidden)) faults.emplace_back(line);
    }
    return faults;
}

TEST(Symbols, OfTheCoreArchives) {
    std::size_t archives = 0;
    for (const auto archive : lines_of(MARGAY_CORE_ARCHIVES)) {
        if (archive.empty()) continue;
        ++archives;
        const auto symbols = output_of("nm -A --undefined-only '" + std::string(archive) + "'");
        ASSERT_TRUE(symbols) << "nm could not read " << archive;
        const auto faults = symbol_faults(*symbols);
        EXPECT_TRUE(faults.empty()) << joined(faults);
    }
    EXPECT_GE(archives, 1U);
}

TEST(Symbols, OfThisProgramAreCaught) {
    // This test program uses the heap and exceptions, so the check must find them in it.
    const auto symbols = output_of("nm -A --undefined-only '" MARGAY_BIN_DIR "/test_layers'");
    ASSERT_TRUE(symbols);
    const auto all = joined(symbol_faults(*symbols));
    EXPECT_NE(all.find(" _Znwm"), std::string::npos) << all;
    EXPECT_NE(all.find(" __cxa_begin_catch"), std::string::npos) << all;
}

TEST(Symbols, EachForbiddenOneIsCaught) {
    for (const auto* name : {"malloc", "free", "_Znwm", "_Znam", "_ZdlPvm", "_ZdaPv", "_ZnwmRKSt9nothrow_t",
                             "__cxa_throw", "_Unwind_Resume", "_ZSt20__throw_length_errorPKc", "__dynamic_cast",
                             "clock_gettime", "_ZNSt6chrono3_V212steady_clock3nowEv", "snprintf", "__snprintf_chk",
                             "_ZTVN10__cxxabiv120__si_class_type_infoE", "_Znwm@GLIBCXX_3.4"})
        EXPECT_EQ(symbol_faults("libx.a:y.o:                 U " + std::string(name) + "\n").size(), 1U) << name;
    for (const auto* name : {"memcpy", "memset", "memmove", "__stack_chk_fail", "_ZN6margay7to_textENS_4ErrcE",
                             "_ZN6margay5Arena4freeEPv", "__cxa_pure_virtual", "strlen"})
        EXPECT_EQ(symbol_faults("libx.a:y.o:                 U " + std::string(name) + "\n").size(), 0U) << name;
}

}  // namespace
}  // namespace margay::layers
