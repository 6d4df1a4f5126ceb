// Times of SOEM 1.4: seconds and microseconds.
#include <soem_version.hpp>

#include <ctime>

namespace {

ec_timet time_of(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return {static_cast<uint32>(now.tv_sec), static_cast<uint32>(now.tv_nsec / 1000)};
}

}  // namespace

extern "C" {

ec_timet osal_current_time(void) { return time_of(CLOCK_REALTIME); }

void osal_time_diff(ec_timet* start, ec_timet* end, ec_timet* diff) {
    const bool borrow = end->usec < start->usec;
    diff->sec = end->sec - start->sec - (borrow ? 1U : 0U);
    diff->usec = end->usec + (borrow ? 1000000U : 0U) - start->usec;
}

void osal_timer_start(osal_timert* self, uint32 timeout_us) {
    ec_timet stop = time_of(CLOCK_MONOTONIC);
    stop.sec += timeout_us / 1000000;
    stop.usec += timeout_us % 1000000;
    if (stop.usec >= 1000000) {
        ++stop.sec;
        stop.usec -= 1000000;
    }
    self->stop_time = stop;
}

boolean osal_timer_is_expired(osal_timert* self) {
    const ec_timet now = time_of(CLOCK_MONOTONIC);
    const ec_timet& stop = self->stop_time;
    return now.sec > stop.sec || (now.sec == stop.sec && now.usec >= stop.usec) ? TRUE : FALSE;
}

}  // extern "C"
