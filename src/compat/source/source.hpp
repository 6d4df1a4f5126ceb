// The segment of a master of a facade, opened by its name: a NIC, and the system functions that belong to it.
//
//     eth0                          a network interface
//     sim:demo                      a simulated segment: a coupler with digital and analogue terminals
//     sim:coupler,drive,drive@3s    simulated slaves in a line, by the names of sim::device_names(); one that is
//                                   switched on 3 s (or 500ms) after the program has opened the segment; drive#16 has
//                                   the alias 16
//     sim:FILE.bin,FILE.bin         the same by SII images
//
// Simulated segments run in real time, because the threads of the program do.
#pragma once

#include "osal/osal.hpp"
#include "oshw/nic.hpp"

#include <memory>
#include <string>

namespace margay::compat {

// A source is used by one thread at a time, as its NIC is.
class Source {
  public:
    virtual ~Source() = default;
    [[nodiscard]] virtual Nic& nic() = 0;
    [[nodiscard]] virtual Osal& osal() = 0;
};

// A source, or a sentence that says why it could not be opened.
struct OpenedSource {
    std::unique_ptr<Source> source;
    std::string error;
};

[[nodiscard]] OpenedSource open_source(const std::string& text);

// The source that the user has bound to a master: that of the environment variable MARGAY_MASTER<index>, otherwise of
// the line `MARGAY_MASTER<index>=SOURCE` of the file that MARGAY_MASTERS names (without it /etc/margay/masters.conf).
// Lines of the file that begin with # are comments. Empty if nothing is bound.
[[nodiscard]] std::string bound_source(unsigned index);

// A simulated segment; `what` is the text behind "sim:".
[[nodiscard]] OpenedSource open_simulated(const std::string& what);

}  // namespace margay::compat
