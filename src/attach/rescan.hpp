// The rescan of a client as a request of the library: it looks for slaves beside the cycle, or scans where nothing is
// exchanged. Which of both is decided in poll(), when it begins: so no group can be mapped in between.
#pragma once

#include "attach/facts.hpp"
#include "attach/job.hpp"

#include <margay/attach/server.hpp>
#include <margay/supervision.hpp>

namespace margay::attach {

struct RescanRequest : Request {
    RescanRequest();
    bool whole = false;  // a scan is allowed
    RescanFacts facts;   // result
    // Result: nothing was done, because the application has not scanned its segment yet.
    bool too_early = false;
    RecoverRequest search;  // never submitted: what the search needs
};

class RescanJob final : public Job {
  public:
    explicit RescanJob(AttachScan allowed);
    [[nodiscard]] Request& request() override { return request_; }
    [[nodiscard]] Octets answer() override;
    [[nodiscard]] std::string refusal() override;

  private:
    RescanRequest request_;
};

}  // namespace margay::attach
