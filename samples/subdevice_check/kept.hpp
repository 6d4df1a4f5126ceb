// The values of an object before a check changes them. The object always gets its old values back at the end of the
// check, because a value of the check must not stay in the device.
#pragma once

#include "subdevice_check/check.hpp"

namespace margay::samples::conformance {

class Kept {
  public:
    // One entry. Throws NotJudged when it cannot be read.
    Kept(Session& session, std::uint16_t index, std::uint8_t subindex);
    // A list: subindex 0 is the number of its values, and is 0 while they are written. Throws like the other.
    [[nodiscard]] static Kept list(Session& session, std::uint16_t index) { return {session, index}; }
    Kept(const Kept&) = delete;
    Kept& operator=(const Kept&) = delete;
    // Writes the old values in PREOP, again and again where the line loses frames. What cannot be put back is an error
    // of the device that refuses it, or stands in Session::left_changed.
    ~Kept();

    [[nodiscard]] const std::vector<std::vector<std::byte>>& values() const { return values_; }

  private:
    Kept(Session& session, std::uint16_t index);
    void keep(std::uint8_t subindex);
    [[nodiscard]] Abort write();
    [[nodiscard]] bool differs();
    [[nodiscard]] std::string put_back();
    [[nodiscard]] std::string name() const;

    Session& session_;
    std::uint16_t index_;
    std::uint8_t first_;
    bool list_;
    std::vector<std::vector<std::byte>> values_;
};

}  // namespace margay::samples::conformance
