// AL states: the requests of masters and the reports of slaves, as a list of changes.
#pragma once

#include "analyse/slave_tracks.hpp"

namespace margay::analyse {

class StateWatch {
  public:
    StateWatch(Analysis& analysis, SlaveTracks& slaves) : analysis_(analysis), slaves_(slaves) {}
    void look(const Exchanged& e, SlaveTrack* slave);

  private:
    struct Known {
        std::optional<std::uint16_t> control{};
        std::optional<std::size_t> event{};  // index of the present state in Analysis::states
    };
    void requested(const Exchanged& e, std::optional<std::size_t> slave, std::uint16_t control);
    void reported(const Exchanged& e, std::size_t slave, std::uint16_t status, std::optional<std::uint16_t> code);
    void all_reported(const Exchanged& e, std::uint16_t status);
    void code_reported(std::size_t slave, std::uint16_t code);

    Analysis& analysis_;
    SlaveTracks& slaves_;
    std::vector<Known> known_{};
    std::optional<std::uint16_t> all_control_{};
    [[nodiscard]] Known& known(std::size_t slave);
};

}  // namespace margay::analyse
