// Only one program of a kind may use an interface. A second program is refused before it accesses the segment.
#pragma once

#include <string>
#include <vector>

namespace margay::samples {

// Reserves names of network interfaces until the object is destroyed, or until the program ends in any way. Each
// network namespace has its own names.
class InterfaceClaim {
  public:
    InterfaceClaim() = default;
    ~InterfaceClaim();
    InterfaceClaim(const InterfaceClaim&) = delete;
    InterfaceClaim& operator=(const InterfaceClaim&) = delete;

    // `source`: one interface, or two with '+' between their names. Returns a sentence if another process of `program`
    // has reserved one of them; empty when the interfaces are now reserved.
    [[nodiscard]] std::string take(const std::string& program, const std::string& source);

  private:
    std::vector<int> sockets_;
};

}  // namespace margay::samples
