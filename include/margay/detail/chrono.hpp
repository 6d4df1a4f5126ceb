// Durations and time points of the standard library, without the calendars and time zones that <chrono> adds to them
// in C++20. A file with this header compiles in a small part of the time that a file with <chrono> takes.
#pragma once

#include <version>

// libstdc++ keeps durations, time points and clocks in a header of their own. Other libraries include all of <chrono>.
#if defined(__GLIBCXX__) && __has_include(<bits/chrono.h>)
#include <bits/chrono.h>
#else
#include <chrono>
#endif
