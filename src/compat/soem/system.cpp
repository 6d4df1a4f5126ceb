// Times and threads of the interface.
#include "compat/soem/facade.hpp"

#include <pthread.h>
#include <sched.h>
#include <cstdio>
#include <ctime>

namespace margay::soem {
namespace {

int create_thread(void* handle, int stack, void* function, void* parameter, bool realtime) {
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0) return 0;
    if (stack > 0) pthread_attr_setstacksize(&attributes, static_cast<std::size_t>(std::max(stack, 65536)));
    using Function = void* (*)(void*);
    auto* const thread = static_cast<pthread_t*>(handle);
    const bool created = pthread_create(thread, &attributes, reinterpret_cast<Function>(function), parameter) == 0;
    pthread_attr_destroy(&attributes);
    if (!created) return 0;
    if (!realtime) return 1;
    sched_param priority{};
    priority.sched_priority = 40;
    if (pthread_setschedparam(*thread, SCHED_FIFO, &priority) == 0) return 1;
    say_once("no permission for a real-time priority: the thread runs with the usual one");
    return 1;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int osal_usleep(uint32 usec) { return Sessions::sleep(usec); }

int osal_thread_create(void* thandle, int stacksize, void* func, void* param) {
    return create_thread(thandle, stacksize, func, param, false);
}
int osal_thread_create_rt(void* thandle, int stacksize, void* func, void* param) {
    return create_thread(thandle, stacksize, func, param, true);
}

}  // extern "C"
