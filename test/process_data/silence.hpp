// A line of three slaves that no frame reaches for a while. Meanwhile slave 2 is exchanged.
#pragma once

#include "process_data/identities.hpp"

namespace margay {

struct Silence : Identities {
    void SetUp() override {}
    void TestBody() override {}  // for tests that use several plants

    void idle(Duration duration) {
        const Time end = osal.now() + duration;
        while (osal.now() < end) {
            osal.advance(1ms);
            (void)poll(*ctx, osal.now());
        }
    }
    void begin_silence() {
        segment.disconnect({line[0], 0});
        segment.reconsider();
    }
    void end_silence() {
        ASSERT_TRUE(segment.connect_master({line[0], 0}));
        segment.reconsider();
    }
    void exchange() {
        take_out(line[1]);
        put_in(tool);
        segment.reconsider();
    }
    void expect_no_outputs_of_slave_2(int count) {
        for (int n = 0; n < count; ++n) {
            write_outputs();
            (void)cycle();
            const auto outputs = program(tool).outputs();
            ASSERT_TRUE(outputs.empty() || outputs[0] != std::byte{0xA2}) << n;
        }
    }
};

}  // namespace margay
