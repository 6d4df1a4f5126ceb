// The rescan of a client as a request of the library: it searches slaves while cycles run, or scans the segment if no
// process data is exchanged. poll() decides this when the request begins, so that no group can be mapped between the
// decision and the scan.
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
    RecoverRequest search;  // parameter of the search; never submitted
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
