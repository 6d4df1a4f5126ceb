// The description of one kind of request. Each operation of the public API is one file of this folder with the
// description of the operation, its check, its sequence, and the function that waits for it. Submitting, queueing,
// cancelling and waiting are written once, in queue.cpp and wait.cpp.
//
//     static Error check(Network& network, const ScanRequest& request);
//     static Task<Result<>> run(Network& network, ScanRequest& request);
//     static constexpr OperationDescription kScan =
//         describe_operation<ScanRequest, check, run>(Operation::scan, Step::count_slaves, Needs::segment);
//     ScanRequest::ScanRequest() : Request(kScan) {}
#pragma once

#include "api/queue.hpp"
#include "network/network.hpp"
#include "util/task.hpp"

#include <margay/request.hpp>

namespace margay {

// What a busy request reserves: no other request may use it at the same time.
enum class Needs : std::uint8_t {
    nothing,
    its_slave,  // the slave of a SlaveRequest; slave 0: the segment
    segment,
    segment_to_begin,  // begins only while no operation uses the segment; other operations may begin while it is busy
};

// How a request of this kind ends: when its work is finished, or only when it is cancelled.
enum class Ends : std::uint8_t { by_itself, when_canceled };

// Which part of the library ends a request when its timeout is over.
enum class Timing : std::uint8_t {
    by_queue,
    by_sequence,  // its own sequence, because its error is more precise; later, the queue
    // Only the sequence; cancel() only requests the end, because a slave may be damaged if the sequence is destroyed in
    // the middle. The sequence calls reason_to_end() at the points where it may end.
    by_sequence_alone,
};

struct OperationDescription {
    Operation operation;
    Step step;  // for errors of the request as a whole
    Needs needs;
    Ends ends;
    Timing timing;
    // The slave of the request; 0: all slaves, or no particular slave.
    std::uint16_t (*slave)(const Request& request);
    // Checks the parameters; code none: they are right. Called again when the request begins, because the segment may
    // have changed since submit().
    Error (*check)(Network& network, const Request& request);
    // The sequence of the operation. Its error becomes the error of the request.
    Task<Result<>> (*sequence)(Network& network, Request& request);
};

template <class R>
constexpr std::uint16_t slave_number(const R& request) {
    if constexpr (requires { request.address.slave; })
        return request.address.slave;
    else if constexpr (requires { request.slave; })
        return request.slave;
    else
        return 0;
}

template <class R, Error (*Check)(Network&, const R&), Task<Result<>> (*Run)(Network&, R&)>
constexpr OperationDescription describe_operation(Operation operation, Step step, Needs needs = Needs::nothing,
                                                  Ends ends = Ends::by_itself, Timing timing = Timing::by_queue) {
    return {operation,
            step,
            needs,
            ends,
            timing,
            [](const Request& request) { return slave_number(static_cast<const R&>(request)); },
            [](Network& network, const Request& request) { return Check(network, static_cast<const R&>(request)); },
            [](Network& network, Request& request) { return Run(network, static_cast<R&>(request)); }};
}

// Adds an error of the segment to errors(); the errors of slaves have been added already.
inline void note_of_segment(Network& network, const Error& error) {
    if (error.code != Errc::none && error.slave == 0) network.note(error);
}

// For Timing::by_sequence_alone: canceled or timeout if the request should end; none if it continues.
[[nodiscard]] inline Errc reason_to_end(Request& request, Time now) {
    if (RequestAccess::cancel_asked(request).load(std::memory_order_acquire)) return Errc::canceled;
    return RequestAccess::deadline(request) <= now ? Errc::timeout : Errc::none;
}

// ------------------------------------------------------------------ checks for several operations

// The error of an argument that is out of range. `index` and `subindex` name the object, the IDN or the register.
[[nodiscard]] Error invalid(Argument argument, Step step, std::uint16_t slave = 0, std::uint16_t index = 0,
                            std::uint8_t subindex = 0);

template <class R>
Error check_nothing(Network&, const R&) {
    return {};
}

[[nodiscard]] Error check_slave(Network& network, std::uint16_t slave, Step step);
// The same for a request that writes to the slave: the slave must be present, and its identity must not be in doubt.
[[nodiscard]] Error check_same_slave(Network& network, std::uint16_t slave, Step step);
// Slave 0 means all slaves.
[[nodiscard]] Error check_slave_or_all(Network& network, std::uint16_t slave, Step step);

}  // namespace margay
