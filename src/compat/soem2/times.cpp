// Times and mutexes of SOEM 2.0, by functions of the system.
#include <soem_version.hpp>

#include <pthread.h>
#include <cstdlib>
#include <ctime>

extern "C" {

void osal_get_monotonic_time(ec_timet* ts) { clock_gettime(CLOCK_MONOTONIC, ts); }

ec_timet osal_current_time(void) {
    ec_timet now{};
    clock_gettime(CLOCK_REALTIME, &now);
    return now;
}

void osal_time_diff(ec_timet* start, ec_timet* end, ec_timet* diff) { osal_timespecsub(end, start, diff); }

int osal_monotonic_sleep(ec_timet* ts) { return clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, ts, nullptr); }

void osal_timer_start(osal_timert* self, uint32 timeout_usec) {
    ec_timet now{};
    osal_get_monotonic_time(&now);
    ec_timet timeout{};
    osal_timespec_from_usec(timeout_usec, &timeout);
    osal_timespecadd(&now, &timeout, &self->stop_time);
}

boolean osal_timer_is_expired(osal_timert* self) {
    ec_timet now{};
    osal_get_monotonic_time(&now);
    return osal_timespeccmp(&now, &self->stop_time, <) ? FALSE : TRUE;
}

void* osal_malloc(size_t size) { return std::malloc(size); }
void osal_free(void* ptr) { std::free(ptr); }

void* osal_mutex_create(void) {
    auto* const mutex = static_cast<pthread_mutex_t*>(std::malloc(sizeof(pthread_mutex_t)));
    if (mutex == nullptr) return nullptr;
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    const bool made = pthread_mutex_init(mutex, &attributes) == 0;
    pthread_mutexattr_destroy(&attributes);
    if (made) return mutex;
    std::free(mutex);
    return nullptr;
}

void osal_mutex_destroy(void* mutex) {
    if (mutex == nullptr) return;
    pthread_mutex_destroy(static_cast<pthread_mutex_t*>(mutex));
    std::free(mutex);
}

void osal_mutex_lock(void* mutex) { pthread_mutex_lock(static_cast<pthread_mutex_t*>(mutex)); }
void osal_mutex_unlock(void* mutex) { pthread_mutex_unlock(static_cast<pthread_mutex_t*>(mutex)); }

}  // extern "C"
