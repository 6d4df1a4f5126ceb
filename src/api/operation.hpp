// What the library knows of one kind of request. Each operation of the public API is one file of this folder: the
// description of the operation, its check, its sequence, and the function that waits for it. Submitting, queueing,
// cancelling and waiting are written once, in queue.cpp and wait.cpp.
//
//     static Error check(Network& network, const ScanRequest& request);
//     static Task<Result<>> run(Network& network, ScanRequest& request);
//     static constexpr OperationDescription kScan = describe_operation<ScanRequest, check, run>(Operation::scan,
//     Needs::segment); ScanRequest::ScanRequest() : Request(kScan) {}
#pragma once

#include "network/network.hpp"
#include "util/task.hpp"

#include <margay/request.hpp>

namespace margay {

// What no other request may use as long as this one is busy.
enum class Needs : std::uint8_t {
    nothing,
    its_slave,  // of a SlaveRequest; slave 0: the segment
    segment,
    segment_to_begin,  // begins while no operation has the segment; later such operations may begin beside it
};

// How long a request of this kind stays busy: until its work is done, or until it is cancelled.
enum class Ends : std::uint8_t { by_itself, when_canceled };

// Who ends a request whose timeout is over: the queue, or its own sequence, which has more to say about it.
enum class Timing : std::uint8_t { by_queue, by_sequence };

struct OperationDescription {
    Operation operation;
    Step step;  // of errors that concern the request as a whole
    Needs needs;
    Ends ends;
    Timing timing;
    // The slave that the request is for; 0: all slaves, or none in particular.
    std::uint16_t (*slave)(const Request& request);
    // What is wrong with the parameters; code none: nothing. Asked again when the request begins.
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

// Adds an error that belongs to no slave to errors(); errors of slaves are there already.
inline void note_of_segment(Network& network, const Error& error) {
    if (error.code != Errc::none && error.slave == 0) network.note(error);
}

// ------------------------------------------------------------------ checks that several operations have in common

template <class R>
Error check_nothing(Network&, const R&) {
    return {};
}

[[nodiscard]] inline Error check_slave(Network& network, std::uint16_t slave, Step step) {
    if (slave >= 1 && slave <= network.count) return {};
    return {.code = Errc::unknown_slave, .step = step, .slave = slave, .expected = network.count};
}

// Slave 0 is all slaves.
[[nodiscard]] inline Error check_slave_or_all(Network& network, std::uint16_t slave, Step step) {
    return slave == 0 ? Error{} : check_slave(network, slave, step);
}

}  // namespace margay
