// Texts for people, without invisible characters.
#include "common/visible_text.hpp"

#include <gtest/gtest.h>

namespace margay::samples {
namespace {

TEST(VisibleText, CharactersThatAreNotSeenAreReplaced) {
    for (const std::string hidden : {"\u202A", "\u202E", "\u2066", "\u2069", "\u200B", "\u200F", "\u061C", "\u2028",
                                     "\uFEFF", "\u00AD", "\u2060", "\U000E0041"})
        EXPECT_EQ(visible("a" + hidden + "b"), "a?b");
}

TEST(VisibleText, ACharacterThatIsCutHidesNoneBehindIt) {
    for (const std::string cut : {"\xC3", "\xE2", "\xE2\x80", "\xF0", "\xF0\x9F", "\xF0\x9F\x98", "\xFF"})
        EXPECT_EQ(visible(cut + "\u202E" + "b"), cut + "?b");
}

TEST(VisibleText, WhatIsSeenAndWhatIsNoTextStays) {
    for (const std::string text :
         {"Klemme für Öl … – µs", "日本語 😀", "tab\tand\nline", "\x1B[2J", "\xE4\xF6\xFC", "cut \xE2\x80", "\x80\xFF"})
        EXPECT_EQ(visible(text), text);
}

}  // namespace
}  // namespace margay::samples
