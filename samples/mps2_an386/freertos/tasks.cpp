#include "tasks.hpp"

extern "C" void stop_at_assert() {
    board::print("an assertion of FreeRTOS has failed");
    for (;;) {
    }
}
