// One request of a client, from its arguments to the octets of its answer.
#pragma once

#include "attach/facts.hpp"
#include "attach/message.hpp"

#include <margay/attach/server.hpp>
#include <margay/visit.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace margay::attach {

using Octets = std::vector<std::byte>;

class Job {
  public:
    virtual ~Job() = default;
    Job() = default;
    Job(const Job&) = delete;
    Job& operator=(const Job&) = delete;

    // What is submitted. Lives until the job ends; a job with a busy request is destroyed by the owner alone.
    [[nodiscard]] virtual Request& request() = 0;
    // After the success of the request: a sentence when there was nothing to do it with. Empty: answer() counts.
    [[nodiscard]] virtual std::string refusal() { return {}; }
    [[nodiscard]] virtual Octets answer() = 0;
    // After its error: the words of the slave.
    [[nodiscard]] virtual std::string slave_text() { return {}; }
    // Octets that have been transferred, and all of them; 0 of 0: not a transfer.
    [[nodiscard]] virtual std::pair<std::size_t, std::size_t> progress() { return {0, 0}; }
};

// A value of a few octets as the octets of an answer.
template <class T>
Octets octets_of(const T& value) {
    Octets out(256);
    Writer into(out);
    into(value);
    out.resize(into.written().size());
    return out;
}

// Whether the operation changes a slave, or the application.
[[nodiscard]] bool writes(Operation operation);

// nullptr: there is no such operation, a number is out of range, or the application does not allow it; `refusal` is the
// sentence then.
[[nodiscard]] std::unique_ptr<Job> make_job(Operation operation, Arguments arguments, const AttachSettings& settings,
                                            std::string& refusal);

}  // namespace margay::attach
