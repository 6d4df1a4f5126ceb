// Another thread reads the facts of a context by a copy that the owner makes.
#pragma once

#include <margay/request.hpp>

namespace margay {

// poll() calls `visit` once, in the thread of the owner, between its other work. The function may call all functions
// that only return known facts (slaves(), slave(), group(), statistics(), slave_clock() …), and copies the facts that
// it needs. The copies belong to the other thread when the request is over. The function must be short, because the
// cycle waits for it: it must neither wait, nor poll, nor submit, nor allocate memory, and must not throw. Errors:
// invalid_argument (no function).
//
//     margay::AlStatus al;                             // lives until the request is over
//     margay::VisitRequest request;
//     request.visit = [](margay::Context& ctx, void* user) {
//         *static_cast<margay::AlStatus*>(user) = ctx.slave(1).al;
//     };
//     request.user = &al;
//     margay::submit(ctx, request);                    // from any thread
struct VisitRequest : Request {
    VisitRequest();
    void (*visit)(Context& ctx, void* user) = nullptr;
    void* user = nullptr;
};

}  // namespace margay
