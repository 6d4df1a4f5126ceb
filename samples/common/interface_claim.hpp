// One program of a kind for each interface: a second one is refused before it touches the segment.
#pragma once

#include <string>
#include <vector>

namespace margay::samples {

// Holds names of network interfaces until it is destroyed, or until the program ends in any way. Each network
// namespace has names of its own.
class InterfaceClaim {
  public:
    InterfaceClaim() = default;
    ~InterfaceClaim();
    InterfaceClaim(const InterfaceClaim&) = delete;
    InterfaceClaim& operator=(const InterfaceClaim&) = delete;

    // `source`: one interface, or two with '+' between their names. Returns a sentence if another process of `program`
    // holds one of them; empty when the interfaces are held now.
    [[nodiscard]] std::string take(const std::string& program, const std::string& source);

  private:
    std::vector<int> sockets_;
};

}  // namespace margay::samples
