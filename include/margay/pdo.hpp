// PDOs as the application requires them: the PDOs of each SyncManager, and the entries of each PDO. Plain data, written
// down as the slave's manual lists it. PDO 0x1A00 below has no list of entries: it keeps the entries of the slave. The
// configuration is set after config_init() and before config_map().
//
//     static constexpr margay::PdoEntry kControl[] = {{0x6040, 0, 16}, {0x607A, 0, 32}};
//     static constexpr margay::Pdo kOutputs[] = {{0x1600, kControl}};
//     static constexpr margay::Pdo kInputs[] = {{0x1A00}, {0x1A03}};
//     static constexpr margay::SmPdos kPdos[] = {{2, kOutputs}, {3, kInputs}};
//     static constexpr margay::SlaveSetup kSetup{.pdos = kPdos};
//     ctx.slave(1).config.setup = &kSetup;
#pragma once

#include <margay/borrowed.hpp>

#include <cstdint>

namespace margay {

// An entry of a PDO: some bits that belong to an object of the dictionary, or a gap (index 0).
struct PdoEntry {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint8_t bits = 0;  // 1 to 255
    friend constexpr bool operator==(const PdoEntry&, const PdoEntry&) = default;
};

// One PDO: 0x1600 to 0x17FF are outputs (RxPDOs), 0x1A00 to 0x1BFF inputs (TxPDOs). Without entries: the PDO keeps the
// entries that the slave has.
struct Pdo {
    std::uint16_t index = 0;
    Borrowed<PdoEntry> entries{};
};

// The PDOs of one SyncManager, in this order. Without PDOs: the SyncManager carries no data.
struct SmPdos {
    std::uint8_t sync_manager = 0;
    Borrowed<Pdo> pdos{};
};

}  // namespace margay
