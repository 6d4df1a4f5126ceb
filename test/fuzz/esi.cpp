// The reader of ESI files with random input. The reader ends, and names a problem when it refuses a file. Each device
// gives an SII image or an error. A file that is written from the result has no additional devices.
#include <margay/files/esi.hpp>

#include <array>
#include <cstdlib>

using namespace margay;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto esi = files::read_esi({reinterpret_cast<const char*>(data), size});
    if (!esi) {
        require(!esi.problem.text.empty());
        return 0;
    }
    const auto again = files::read_esi(files::write_esi(*esi).text);
    for (const files::EsiDevice& device : esi->devices) {
        if (device.eeprom && device.eeprom->bytes > 65536) continue;  // large images only cost time
        const auto image = files::make_sii(device);
        require(!image == !image.error.empty());
        if (!image) continue;
        (void)files::describe_sii(image.octets);
        (void)files::entry_name(device, Direction::inputs, 0x6000, 1);
        for (const files::EsiMode& mode : device.modes) (void)files::sync_settings(mode, std::chrono::milliseconds(1));
    }
    if (again) require(again->devices.size() <= esi->devices.size());
    return 0;
}
