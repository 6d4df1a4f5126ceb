// Connects slaves with EoE to network interfaces of the kernel (TAP). A line is the connection of one slave with its
// interface.
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
// A sentence for a slave that shares its alias with another slave with EoE; empty for all other slaves.
[[nodiscard]] std::string shared_alias(const Slave& slave, std::span<const Slave> all);
// Whether the slave exchanges Ethernet frames.
[[nodiscard]] bool has_eoe(const Slave& slave);

class EoeLines {
  public:
    // The result of open(). `problem`: a sentence about a failure. `refused`: the slave or the library has refused the
    // line, or the name exists already. In this case other lines are not affected.
    struct Opened {
        std::string problem{};
        bool refused = false;
        [[nodiscard]] explicit operator bool() const { return problem.empty(); }
    };
    // Opens a line, in the thread that owns the context. The lines must not outlive the context.
    [[nodiscard]] Opened open(Context& ctx, const Slave& slave, const std::string& name);
    // Ends all ports, from any thread. They have ended when the owner has polled.
    void cancel();
    [[nodiscard]] bool busy() const;

    [[nodiscard]] bool empty() const { return lines_.empty(); }

    // The following functions are for one thread, which need not be the owner.

    // Passes frames between the interfaces and the ports. Returns whether there were frames.
    bool pass();
    // Ends the lines whose interface was deleted.
    struct Ended {
        std::string what{};    // a sentence
        std::string report{};  // the text of report()
    };
    [[nodiscard]] std::vector<Ended> end_deleted();
    // Adds the interfaces whose slave can accept a frame.
    void add_files(std::vector<pollfd>& files) const;
    // One line of text for each line: the frames in both directions.
    [[nodiscard]] std::vector<std::string> report() const;

  private:
    struct Line {
        std::string name;
        TapNic tap;
        EoePortMemory<64, 64, EoePort::kMostAtOnce> memory;
        EoePort port{memory};
        std::uint64_t not_taken = 0;  // frames that the kernel did not accept
    };
    static bool pass(Line& line, std::span<std::byte> buffer);
    static std::string report(const Line& line);

    std::vector<std::unique_ptr<Line>> lines_;
    // Lines whose interface was deleted. Their ports end later, in poll().
    std::vector<std::unique_ptr<Line>> ended_;
};

}  // namespace margay::samples
