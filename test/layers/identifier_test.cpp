// The sources of the core use no heap, exceptions, RTTI, clocks and streams. symbol_test.cpp checks the same for the
// archives.
#include <places.hpp>
#include "layers/identifier_check.hpp"

#include <gtest/gtest.h>

namespace margay::layers {
namespace {

TEST(Identifiers, OfTheProjectAreAllowed) {
    const auto faults = identifier_faults(load_tree(MARGAY_SOURCE_DIR));
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

std::size_t faults_of(const std::string& path, const std::string& code) {
    return identifier_faults({{path, code}}).size();
}

TEST(Identifiers, CatchesEachForbiddenOneInCore) {
    for (const auto* code : {
             "throw 1;",
             "try {",
             "} catch (...) {",
             "p = malloc(4);",
             "std::calloc (1, 2)",
             "realloc(p, 3)",
             "std::free(p);",
             "x = ::free(p);",
             "auto* p = new int;",
             "return new std::byte[4];",
             "new(std::nothrow) int",
             "new ::margay::Link",
             "(delete p);",
             "std::ifstream f",
             "delete p;",
             "if (p) delete p;",
             "delete[] p;",
             "delete [] (p);",
             "std::function<void()> f;",
             "dynamic_cast<A*>(b)",
             "typeid(a)",
             "std::chrono::steady_clock::now()",
             "clock_gettime(CLOCK_MONOTONIC, &t)",
             "std::this_thread::sleep_for(x)",
             "printf(\"%d\", 1)",
             "std::snprintf(a, 1, \"\")",
             "std::cout << 1",
             "std::ostream& o",
             "std::stringstream s",
             "std::unique_ptr<int> p",
             "struct __attribute__((packed)) A {",
             "#pragma pack(1)",
             "struct [[gnu::packed]] A {",
             "reinterpret_cast<Header*>(p)",
             "reinterpret_cast<const std::uint16_t*>(p)",
         })
        EXPECT_EQ(faults_of("src/link/link.cpp", code), 1U) << code;
}

TEST(Identifiers, LeavesTheRestAlone) {
    for (const auto* code : {
             "// throw malloc(",
             "/* new int\n throw */",
             "log(\"throw new printf\");",
             "R\"(throw)\"",
             "x = 'n'; // delete p",
             "new (place) T{};",
             "::new (static_cast<void*>(at)) T;",
             "static void* operator new(std::size_t, Arena&) noexcept;",
             "void operator delete(void* p);",
             "A(const A&) = delete;",
             "A(A&&) =  delete ;",
             "int renewed = 1;",
             "newest::store(head, 1);",
             "bool stream = false;",
             "deleter(p);",
             "deleted = 1;",
             "arena.free(block);",
             "arena->malloc_count",
             "std::free_list",
             "bool thrown;",
             "#include <new>",
             "reinterpret_cast<const char*>(p)",
             "reinterpret_cast<std::uintptr_t>(p)",
             "auto x = 1'000'000; // 'throw'",
             "int delete_count;",
             "the_throwing = 1;",
             "Stream s; bit_stream b;",
         })
        EXPECT_EQ(faults_of("src/link/link.cpp", code), 0U) << code;
}

TEST(Identifiers, TheRulesFitTheFolder) {
    EXPECT_EQ(faults_of("src/sim/esc.cpp", "auto p = std::make_unique<int>(); q = new int;"), 0U);
    EXPECT_EQ(faults_of("src/sim/esc.cpp", "steady_clock::now();"), 1U);
    EXPECT_EQ(faults_of("src/sim/esc.cpp", "throw 1;"), 1U);
    EXPECT_EQ(faults_of("osal/linux/linux_osal.cpp", "clock_gettime(CLOCK_MONOTONIC, &t);"), 0U);
    EXPECT_EQ(faults_of("osal/virtual/virtual_osal.cpp", "clock_gettime(CLOCK_MONOTONIC, &t);"), 1U);
    EXPECT_EQ(faults_of("oshw/linux/packet_nic.cpp", "throw 1;"), 1U);
    EXPECT_EQ(faults_of("samples/slaveinfo.cpp", "throw 1; auto* p = new int; printf(\"\");"), 0U);
}

TEST(Identifiers, NamesFileAndLine) {
    const auto faults = identifier_faults({{"src/util/a.cpp", "int a;\n/* two\nlines */ int b; throw b;\n"}});
    ASSERT_EQ(faults.size(), 1U);
    EXPECT_EQ(faults[0], "src/util/a.cpp:3: an exception: throw");
}

}  // namespace
}  // namespace margay::layers
