// Durations and time points of the standard library, without the calendars and time zones that <chrono> adds to them
// in C++20. <chrono> costs each file of a user about half a second of compiling; this header costs a third of that.
#pragma once

#include <version>

// libstdc++ keeps durations, time points and clocks in a header of their own. Other libraries include all of <chrono>.
#if defined(__GLIBCXX__) && __has_include(<bits/chrono.h>)
#include <bits/chrono.h>
#else
#include <chrono>
#endif
