// A segment in virtual time for programs that link the objects of the facade. It replaces the segment that the
// environment names. One source file of a program includes this file.
#pragma once

#include <check.h>
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/segment.hpp"
#include "osal/virtual/virtual_osal.hpp"

#include <ecrt.h>
#include <cerrno>
#include <cstdio>
#include <string>

using namespace margay;

namespace {

std::string segment;
VirtualOsal* osal = nullptr;
Time opened;

// Ends the thread that polls until activation, because this thread would advance the time. Then advances to a time
// after the opening.
[[maybe_unused]] void go_to(const ec_master_t& master, Duration after) {
    master.bus->stop_idle();
    if (osal->now() < opened + after) osal->advance(opened + after - osal->now());
}

}  // namespace

namespace margay::compat::ecrt {

std::string bound_source(unsigned) { return segment; }

hosted::OpenedSource open_segment(const std::string& name) {
    auto source = hosted::open_source(name);
    if (!source) return source;
    osal = static_cast<VirtualOsal*>(&source->osal());
    opened = osal->now();
    return source;
}

}  // namespace margay::compat::ecrt
