// The concepts of ranges of the standard library, without the views that <ranges> adds to them. Each file of a user
// that includes <ranges> takes longer to compile.
#pragma once

#include <span>
#include <version>

// libstdc++ keeps the concepts in a header of their own. Other libraries include all of <ranges>.
#if defined(__GLIBCXX__) && __has_include(<bits/ranges_base.h>)
#include <bits/ranges_base.h>
#else
#include <ranges>
#endif
