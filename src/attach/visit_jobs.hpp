// The jobs that read facts. Their functions run in the thread that owns the context, in poll(): they copy into memory
// that the job has, allocate nothing, and each of them copies a bounded amount.
#pragma once

#include "attach/job.hpp"

namespace margay::attach {

class VisitJob final : public Job {
  public:
    using Copy = void (*)(Context& ctx, const Arguments& arguments, Writer& into);
    VisitJob(Copy copy, Arguments arguments, std::size_t bytes);
    [[nodiscard]] Request& request() override { return request_; }
    [[nodiscard]] Octets answer() override;

  private:
    Copy copy_;
    Arguments arguments_;
    Octets memory_;
    std::size_t written_ = 0;
    bool fits_ = true;
    VisitRequest request_;
};

[[nodiscard]] std::unique_ptr<Job> make_visit(Operation operation, Arguments arguments);

}  // namespace margay::attach
