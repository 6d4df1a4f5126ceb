// PDOs as the application wants them: which of them a SyncManager carries, and what each of them holds. Plain data, to
// be written down as the slave's manual lists it:
//
//     static constexpr margay::PdoEntry kControl[] = {{0x6040, 0, 16}, {0x607A, 0, 32}};
//     static constexpr margay::Pdo kOutputs[] = {{0x1600, kControl}};
//     static constexpr margay::Pdo kInputs[] = {{0x1A00}, {0x1A03}};              // with what the slave has in them
//     static constexpr margay::SmPdos kPdos[] = {{2, kOutputs}, {3, kInputs}};
//     static constexpr margay::SlaveSetup kSetup{.pdos = kPdos};
//     ctx.slave(1).config.setup = &kSetup;                                        // before config_map()
#pragma once

#include <margay/borrowed.hpp>

#include <cstdint>

namespace margay {

// Some bits of a PDO: an object of the dictionary, or a gap with index 0.
struct PdoEntry {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint8_t bits = 0;  // 1 to 255
    friend constexpr bool operator==(const PdoEntry&, const PdoEntry&) = default;
};

// One PDO: 0x1600 to 0x17FF are outputs (RxPDOs), 0x1A00 to 0x1BFF inputs (TxPDOs). Without entries: what the slave has
// in it.
struct Pdo {
    std::uint16_t index = 0;
    Borrowed<PdoEntry> entries{};
};

// What a SyncManager carries, in this order. Without PDOs: nothing.
struct SmPdos {
    std::uint8_t sync_manager = 0;
    Borrowed<Pdo> pdos{};
};

}  // namespace margay
