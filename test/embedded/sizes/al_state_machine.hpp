// The sequence change_al_state() of src/station/al_state.cpp, written by hand as a state machine. The difference in
// size is the cost of the coroutine itself. table.cmake prints both sizes. test/segment/al_state_machine_test.cpp shows
// that both exchange the same frames.
#pragma once

#include "station/al_state.hpp"

#include <algorithm>
#include <memory>

namespace margay {

class AlStateMachine {
  public:
    AlStateMachine(Station station, AlState state, bool device_emulation, Duration timeout)
        : station_(station), state_(state), device_emulation_(device_emulation), timeout_(timeout) {}
    AlStateMachine(const AlStateMachine&) = delete;
    AlStateMachine& operator=(const AlStateMachine&) = delete;
    ~AlStateMachine() { release(); }

    void start() { read(Phase::before); }
    [[nodiscard]] bool done() const { return phase_ == Phase::over; }
    [[nodiscard]] const Result<AlStatus>& result() const { return result_; }

  private:
    // What the machine waits for: the AL status before the request; the request; AL status, pause and request again
    // while the slave does not answer the request; the AL status after the request; the pause before this status is
    // read again.
    enum class Phase : std::uint8_t { before, request, again_status, again_pause, again_request, status, pause, over };

    static constexpr Duration kShortestPause = std::chrono::microseconds(200);
    static constexpr Duration kLongestPause = std::chrono::milliseconds(5);
    static constexpr Duration kPatience = std::chrono::milliseconds(200);

    void step() {
        switch (phase_) {
            case Phase::before: return before_read();
            case Phase::request: return request_written();
            case Phase::again_status: return status_read_again();
            case Phase::again_pause: return write(Phase::again_request);
            case Phase::again_request: return request_written_again();
            case Phase::status: return status_read();
            case Phase::pause: return read(Phase::status);
            case Phase::over: return;
        }
    }

    void before_read() {
        const auto read = slot_.read.await_resume();
        if (!read) return end(read);
        before_ = *read;
        give_up_ = later(now(), timeout_);
        const bool acknowledge = before_.error && !device_emulation_;
        request_ = static_cast<std::uint16_t>(static_cast<unsigned>(state_) |
                                              (acknowledge ? wire::al::kErrorAcknowledge : 0U));
        write(Phase::request);
    }
    void request_written() {
        const auto written = slot_.write.await_resume();
        if (!does_not_answer(written.error())) return wait_for_state(written);
        give_up_again_ = later(now(), std::min(timeout_, kPatience));
        pause_ = kShortestPause;
        read(Phase::again_status);
    }
    void status_read_again() {
        const auto read = slot_.read.await_resume();
        if (!read) return end(read);
        actual_ = read->state;
        sleep(Phase::again_pause);
    }
    void request_written_again() {
        const auto written = slot_.write.await_resume();
        if (!does_not_answer(written.error())) return wait_for_state(written);
        if (now() < give_up_again_) return read(Phase::again_status);
        fail(Errc::timeout, actual_);
    }
    void wait_for_state(const Result<>& written) {
        if (!written) return end(written.error());
        give_up_old_ = now() + kPatience;
        pause_ = kShortestPause;
        read(Phase::status);
    }
    void status_read() {
        const auto read = slot_.read.await_resume();
        if (!read || (read->state == state_ && !read->error)) return end(read);
        const bool old = *read == before_ && now() < give_up_old_;
        if ((!read->error || old) && now() < give_up_) return sleep(Phase::pause);
        fail(read->error ? Errc::al_status : Errc::timeout, read->state, read->code);
    }

    void fail(Errc code, AlState actual, std::uint16_t detail = 0) {
        Error error = station_.error(code, Step::request_state);
        error.expected = static_cast<std::uint32_t>(state_);
        error.actual = static_cast<std::uint32_t>(actual);
        error.detail = detail;
        end(error);
    }
    void end(const Result<AlStatus>& result) {
        result_ = result;
        release();
        phase_ = Phase::over;
    }

    [[nodiscard]] Time now() const { return station_.engine.now(); }
    // The engine resumes the machine like a coroutine. The memory of a coroutine begins with the same two pointers.
    [[nodiscard]] std::coroutine_handle<> handle() { return std::coroutine_handle<>::from_address(&frame_); }
    static void resume(void* frame) { static_cast<Frame*>(frame)->machine->step(); }
    void release() {
        if (reads()) std::destroy_at(&slot_.read);
        if (writes()) std::destroy_at(&slot_.write);
    }
    [[nodiscard]] bool reads() const {
        return phase_ == Phase::before || phase_ == Phase::again_status || phase_ == Phase::status;
    }
    [[nodiscard]] bool writes() const { return phase_ == Phase::request || phase_ == Phase::again_request; }
    void read(Phase next) {
        release();
        phase_ = next;
        (void)std::construct_at(&slot_.read, station_)->await_suspend(handle());
    }
    void write(Phase next) {
        release();
        phase_ = next;
        const auto address = wire::reg::kAlControl.address;
        (void)std::construct_at(&slot_.write, station_, address, request_, sizeof(request_), Step::request_state)
            ->await_suspend(handle());
    }
    void sleep(Phase next) {
        release();
        phase_ = next;
        station_.engine.sleep(timer_, handle(), later(now(), pause_));
        pause_ = std::min(pause_ * 2, kLongestPause);
    }

    struct Frame {
        void (*resume)(void* frame);
        void (*destroy)(void* frame);
        AlStateMachine* machine;
    };
    union Slot {
        Slot() {}
        ~Slot() {}
        ReadAlStatus read;
        WriteRegister write;
    };

    Frame frame_{resume, nullptr, this};
    Station station_;
    AlState state_;
    bool device_emulation_;
    Phase phase_ = Phase::over;
    AlState actual_ = AlState::none;
    std::uint16_t request_ = 0;
    AlStatus before_;
    Duration timeout_;
    Duration pause_{0};
    Time give_up_ = kNever;
    Time give_up_old_ = kNever;
    Time give_up_again_ = kNever;
    Result<AlStatus> result_;
    Engine::Sleep::Timer timer_;
    Slot slot_;
};

}  // namespace margay
