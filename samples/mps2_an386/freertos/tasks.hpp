// The common functions of the programs with FreeRTOS: a task with static memory, and printing.
#pragma once

#include <board.hpp>  // of the folder of the board, which may have another name in a copy

#include <margay/parts/util/text_writer.hpp>

#include <FreeRTOS.h>
#include <task.h>

#include <array>
#include <cstddef>

template <std::size_t Words>
struct StaticTask {
    std::array<StackType_t, Words> stack;
    StaticTask_t memory;
    TaskHandle_t handle = nullptr;

    // A higher priority is a higher number.
    void start(const char* name, UBaseType_t priority, void (*body)(void*), void* argument = nullptr) {
        handle = xTaskCreateStatic(body, name, Words, argument, priority, stack.data(), &memory);
    }
};

// Lines of two tasks are not mixed.
template <class... Parts>
void print(const Parts&... parts) {
    std::array<char, 200> line;
    margay::TextWriter text(line);
    (text << ... << parts);
    vTaskSuspendAll();
    board::print(text.text());
    (void)xTaskResumeAll();
}
