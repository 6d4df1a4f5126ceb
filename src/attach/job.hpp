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

    // The submitted request. It lives until the job ends. Only the owner destroys a job with a busy request.
    [[nodiscard]] virtual Request& request() = 0;
    // Called after the success of the request: a sentence if the request could not do its work. Empty: answer() is
    // sent.
    [[nodiscard]] virtual std::string refusal() { return {}; }
    [[nodiscard]] virtual Octets answer() = 0;
    // Called after an error of the request: the text that the slave has sent with its error.
    [[nodiscard]] virtual std::string slave_text() { return {}; }
    // Octets that were transferred, and octets in total; both 0: no transfer.
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

// nullptr: the operation does not exist, a number is out of range, or the application does not allow the operation;
// then `refusal` is the sentence for the client.
[[nodiscard]] std::unique_ptr<Job> make_job(Operation operation, Arguments arguments, const AttachSettings& settings,
                                            std::string& refusal);

}  // namespace margay::attach
