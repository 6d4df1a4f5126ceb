/* The types that osal/freertos uses, of a kernel with ticks of 64 bits, for freertos_osal_test.cpp. */
#pragma once

#include <stdint.h>

typedef uint64_t TickType_t;
typedef int BaseType_t;
typedef void* TaskHandle_t;
typedef void* SemaphoreHandle_t;
typedef struct {
    int given;
} StaticSemaphore_t;

#define portMAX_DELAY ((TickType_t)0xffffffffffffffffULL)
#define configTICK_RATE_HZ 1000
#define pdFALSE 0
#define portYIELD_FROM_ISR(other) ((void)(other))
