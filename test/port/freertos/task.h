#pragma once

#include <FreeRTOS.h>

#define taskENTER_CRITICAL() ((void)0)
#define taskEXIT_CRITICAL() ((void)0)
inline void vTaskSuspendAll() {}
inline BaseType_t xTaskResumeAll() { return pdFALSE; }
inline TaskHandle_t xTaskGetCurrentTaskHandle() { return nullptr; }
