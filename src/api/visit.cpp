// The request that lets another thread read the facts of a context.
#include <margay/visit.hpp>

#include "api/master.hpp"
#include "api/operation.hpp"

namespace margay {

static Error check(Network&, const VisitRequest& request) {
    return request.visit != nullptr ? Error{} : invalid(Argument::work, Step::none);
}

static Task<Result<>> run(Network&, VisitRequest& request) {
    request.visit(*RequestAccess::context(request), request.user);
    co_return Nothing{};
}

// The request reserves nothing, so no error names it as the operation in the way of another one.
static constexpr OperationDescription kVisit =
    describe_operation<VisitRequest, check, run>(Operation::none, Step::none);
VisitRequest::VisitRequest() : Request(kVisit) {}

}  // namespace margay
