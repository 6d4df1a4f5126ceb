// The SII of a slave of a session, for the functions that work on any EEPROM.
#pragma once

#include "common/eeprom.hpp"
#include "ethercat/session.hpp"

#include <cstdint>
#include <string>

namespace margay::ethercat {

// `session` must outlive the object.
class SessionEeprom final : public samples::Eeprom {
  public:
    SessionEeprom(Session& session, std::uint16_t position) : session_(session), position_(position) {}

    [[nodiscard]] std::string name() const override { return "position " + std::to_string(position_); }
    [[nodiscard]] std::string read(std::uint32_t word, MutableBytes into) override {
        return said(session_.read_sii(position_, word, into));
    }
    // One word at a time, so that each counted word was read back.
    [[nodiscard]] Written write(std::uint32_t word, Bytes octets) override {
        Written written;
        for (; !octets.empty(); octets = octets.subspan(2), ++written.words) {
            const auto done =
                session_.write_sii(position_, word + static_cast<std::uint32_t>(written.words), octets.first(2));
            if (done) continue;
            written.error = said(done);
            written.refused = done.problem().refused;
            break;
        }
        return written;
    }
    // The problem of a function that worked on this EEPROM, with the exit code of the first read() or write() that
    // failed: the end of the application is a system error, a slave that does not respond is not.
    [[nodiscard]] Problem problem(std::string text) const { return {std::move(text), code_}; }

  private:
    std::string said(const Answer<>& answer) {
        if (!answer && !failed_) code_ = answer.problem().code;
        failed_ |= !answer;
        return answer.problem().text;
    }

    Session& session_;
    std::uint16_t position_;
    bool failed_ = false;
    int code_ = samples::exit_code::kSegment;
};

}  // namespace margay::ethercat
