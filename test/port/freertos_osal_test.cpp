// The number of ticks that osal/freertos requests, with the types of a kernel whose ticks have 64 bits.
#include "osal/freertos/freertos_osal.cpp"

#include <gtest/gtest.h>

#include <vector>

namespace {

std::vector<TickType_t> taken;

}  // namespace

SemaphoreHandle_t xSemaphoreCreateBinaryStatic(StaticSemaphore_t* memory) { return memory; }
void vSemaphoreDelete(SemaphoreHandle_t) {}
BaseType_t xSemaphoreTake(SemaphoreHandle_t, TickType_t ticks) {
    taken.push_back(ticks);
    return pdFALSE;
}
BaseType_t xSemaphoreGive(SemaphoreHandle_t) { return pdFALSE; }
BaseType_t xSemaphoreGiveFromISR(SemaphoreHandle_t, BaseType_t*) { return pdFALSE; }

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(FreertosOsal, WaitsAsManyTicksAsAreLeftWhateverTheirWidth) {
    taken.clear();
    FreertosOsal osal([]() -> std::uint32_t { return 0; }, 1'000'000);
    osal.wait(osal.now() + 100us, -1);
    osal.wait(osal.now() + 20ms, -1);
    osal.wait(osal.now() + 24h, -1);
    osal.wait(kNever, -1);
    osal.wait(osal.now(), -1);  // returns at once
    EXPECT_EQ(taken, (std::vector<TickType_t>{0, 20, 86'400'000, portMAX_DELAY}));
    const std::atomic<std::uint32_t> word{1};
    osal.sleep_while(word, 1, osal.now() - 1s);
    osal.sleep_while(word, 1, osal.now() + 3s);
    EXPECT_EQ(taken.size(), 6u);
    EXPECT_EQ(taken[4], 0u);
    EXPECT_EQ(taken[5], 3000u);
}

}  // namespace
}  // namespace margay
