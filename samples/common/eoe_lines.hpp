// Slaves with EoE and the network interfaces of the kernel (TAP) that they have: one line is both ends.
#pragma once

#include "common/tap_nic.hpp"

#include <margay/margay.hpp>

#include <poll.h>

#include <memory>
#include <span>
#include <string>
#include <vector>

namespace margay::samples {

// eoe<master>s<position>, the first position is 0; for a slave with an alias eoe<master>a<alias>, if no other slave of
// `all` with EoE has this alias.
[[nodiscard]] std::string eoe_interface_name(unsigned master, const Slave& slave, std::span<const Slave> all);
// A sentence for a slave whose alias another slave with EoE has, too; empty for the others.
[[nodiscard]] std::string shared_alias(const Slave& slave, std::span<const Slave> all);
// Whether the slave exchanges Ethernet frames.
[[nodiscard]] bool has_eoe(const Slave& slave);

class EoeLines {
  public:
    // What has become of a line: a sentence about its failure. `refused`: by the slave or the library, or the name
    // exists already, so that other lines are not concerned.
    struct Opened {
        std::string problem{};
        bool refused = false;
        [[nodiscard]] explicit operator bool() const { return problem.empty(); }
    };
    // Opens a line, in the thread that owns the context. The lines must not outlive the context.
    [[nodiscard]] Opened open(Context& ctx, const Slave& slave, const std::string& name);
    // Ends all ports, from any thread. They are over when the owner has polled.
    void cancel();
    [[nodiscard]] bool busy() const;

    [[nodiscard]] bool empty() const { return lines_.empty(); }

    // The following functions are for one thread, which need not be the owner.

    // Passes frames between the interfaces and the ports, and returns whether there were any.
    bool pass();
    // Ends the lines whose interface was deleted.
    struct Ended {
        std::string what{};    // a sentence
        std::string report{};  // as of report()
    };
    [[nodiscard]] std::vector<Ended> end_deleted();
    // The interfaces whose slave can take a frame.
    void add_files(std::vector<pollfd>& files) const;
    // One line of text for each line: the frames in both directions.
    [[nodiscard]] std::vector<std::string> report() const;

  private:
    struct Line {
        std::string name;
        TapNic tap;
        EoePortMemory<64, 64, EoePort::kMostAtOnce> memory;
        EoePort port{memory};
        std::uint64_t not_taken = 0;  // frames that the kernel did not take
    };
    static bool pass(Line& line, std::span<std::byte> buffer);
    static std::string report(const Line& line);

    std::vector<std::unique_ptr<Line>> lines_;
    // Lines whose interface was deleted: their ports end later, in poll().
    std::vector<std::unique_ptr<Line>> ended_;
};

}  // namespace margay::samples
