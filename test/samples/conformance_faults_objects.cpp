// Faults of SDO services, PDOs, synchronization types and modules, which subdevice_check finds.
#include "samples/conformance_faults.hpp"

namespace margay::samples::conformance {
namespace {

constexpr Fault kObjectFaults[] = {
    {.check = "modules.lists",
     .what = "a PDO of an empty slot",
     .write = show_number<0xF050, 2, 0>,
     .device = "modular_io"},
    {.check = "modules.lists", .what = "too many slots", .write = show_number<0xF000, 2, 3>, .device = "modular_io"},
    {.check = "modules.lists",
     .what = "profiles of other slots",
     .write = show_number<0xF010, 0, 2>,
     .device = "modular_io"},
    {.check = "modules.match", .what = "a right list is refused", .read = take_module<0x77>, .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "another module is accepted",
     .read = take_module<0x04>,
     .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "another code",
     .write = replace_code<0x0070, 0x0001>,
     .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "only the first module is compared",
     .read = take_right_module<2, 0x208>,
     .device = "modular_io"},
    {.check = "modules.mismatch",
     .what = "the last module is not compared",
     .read = take_right_module<4, 0x401>,
     .device = "modular_io"},
    {.check = "sync.types", .what = "every type is accepted", .write = grant<0x1C32, 1, 0x1100>, .device = "split_io"},
    {.check = "sync.types",
     .what = "a type that is announced is refused",
     .read =
         [](std::uint16_t address, MutableBytes data) {
             // The firmware receives an expedited download of type 2 as a download of type 99.
             if (address != 0x1006 || data.size() < 10 || load_le<std::uint16_t>(data, 3) != 0x1C33) return;
             if ((std::to_integer<unsigned>(data[2]) >> 5) == coe::request::kDownload && data[6] == std::byte{2})
                 data[6] = std::byte{99};
         },
     .device = "split_io"},
    {.check = "sync.types",
     .what = "a type is acknowledged and not written",
     .write = [](std::uint16_t address, Octets& data) { return show_number<0x1C32, 1, 5>(address, data); },
     .device = "split_io"},
    {"sdo.read_only", "a read-only entry is written", grant<0x1018, 1>},
    {"sdo.read_only", "a write to a read-only entry gets no reply",
     [](std::uint16_t address, Octets& data) {
         return !is_mail(address, data) || data.size() < 16 || data[8] != std::byte{0x80} ||
                load_le<std::uint32_t>(data, 12) != 0x06010002;
     }},
    {"sdo.rights", "the count is written in SAFEOP and OP", grant<0x1C13, 0>},
    {"sdo.complete_download", "complete access is for uploads only", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x33)) data[2] = std::byte{0xE0};
     }},
    {"sdo.complete_download", "the last entry of a mapping is another one", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x31) && load_le<std::uint16_t>(data, 3) == 0x1600 && data.size() > 25)
             data[25] = std::byte{5};
     }},
    {"sdo.complete_objects", "another value in 0x1C00",
     [](std::uint16_t address, Octets& data) {
         if (is_whole(address, data, 0x1C00)) data[18] ^= std::byte{4};
         return true;
     }},
    {"sdo.complete_objects", "another value in 0x1C00 from subindex 1 on",
     [](std::uint16_t address, Octets& data) {
         if (is_whole(address, data, 0x1C00, 1)) data[12] ^= std::byte{4};
         return true;
     }},
    {"sdo.complete_objects", "subindex 0 of a mapping has 8 bits",
     [](std::uint16_t address, Octets& data) {
         if (!is_whole(address, data, 0x1600)) return true;
         store_le(MutableBytes(data), 0, static_cast<std::uint16_t>(load_le<std::uint16_t>(data, 0) - 1));
         store_le(MutableBytes(data), 12, load_le<std::uint32_t>(data, 12) - 1);
         data.erase(data.begin() + 17);
         data.push_back(std::byte{0});
         return true;
     }},
    {"sdo.complete_objects", "an object is refused with an abort code that says nothing",
     refuse_whole<0x1A00, 0x08000000>},
    {.check = "sdo.complete_objects",
     .what = "one of the objects is refused",
     .write = refuse_whole<0x1A00, 0x06010004>,
     .severity = kRemark},
    {.check = "sdo.complete_objects",
     .what = "the SII does not announce complete access, and one object refuses it",
     .write = refuse_whole<0x1A00, 0x06010004>,
     .prepare = hide_complete_access,
     .severity = kRemark},
    {.check = "sdo.complete_objects",
     .what = "complete access that is not announced has another value",
     .write =
         [](std::uint16_t address, Octets& data) {
             if (is_whole(address, data, 0x1C00)) data[18] ^= std::byte{4};
             return true;
         },
     .prepare = hide_complete_access},
    {"sdo.write_only", "a write-only entry is read",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1000)
             data[20] = std::byte{0x38};
         return true;
     }},
    {"sdo.aborts", "another abort code", replace_abort<0x06010002, 0x08000000>},
    {"sdo.aborts", "another abort code for a subindex", replace_abort<0x06090011, 0x08000000>},
    {"sdo.write", "wrong lengths have another abort code", replace_abort<0x06070012, 0x08000000>},
    {"segments.download", "the toggle bit of a download is read the wrong way", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         const bool segment = address == 0x1006 && data.size() >= 10 &&
                              coe::load_header(data).service == coe::Service::sdo_request &&
                              (std::to_integer<unsigned>(data[2]) & 0xE1) == 0x01;
         if (segment) data[2] ^= std::byte{0x10};
     }},
    {"segments.toggle", "only the first toggle bit is compared", count_segments, read_right_toggle},
    {"segments.download", "the toggle bit of a response is always 0",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_response) && data[8] == std::byte{0x30})
             data[8] = std::byte{0x20};
         return true;
     }},
    {"segments.download", "the last of many segments is stored wrongly", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static bool many = false;
         if (!is_download_segment(address, data)) return;
         if (many && (data[2] & std::byte{1}) != std::byte{0}) data[3] ^= std::byte{1};
         many = (data[2] & std::byte{1}) == std::byte{0};
     }},
    {"segments.download_toggle", "only the first toggle bit of a download is compared", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static unsigned segments = 0;
         if (is_request(address, data, 0x21)) segments = 0;
         if (!is_download_segment(address, data)) return;
         constexpr std::byte kToggle{0x10};
         if (segments > 0) data[2] = (data[2] & ~kToggle) | (segments % 2 != 0 ? kToggle : std::byte{0});
         ++segments;
     }},
    {"segments.download_abort", "an abort in a download is taken as the next segment", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x80)) data[2] = std::byte{0x10};
     }},
    {"segments.download_length", "fewer octets are announced than come", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x21) && load_le<std::uint32_t>(data, 6) == 1023)
             store_le(data, 6, std::uint32_t{1024});
     }},
    {"segments.download_toggle", "another abort code", replace_abort<0x05030000, 0x08000000>},
    {"segments.client_abort", "an abort is answered", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x80)) data[2] = std::byte{0x60};
     }},
    // Before the first segment, an abort ends the transfer. After the first segment, the next request still gets a
    // segment.
    {"segments.client_abort", "an abort behind the first segment is ignored",
     [](std::uint16_t address, Octets& data) {
         if (ignores_abort && is_service(address, data, coe::Service::sdo_request) && data[8] == std::byte{0x80}) {
             coe::store_header(MutableBytes(data).subspan(6), {0, coe::Service::sdo_response});
             data[8] = segments_sent % 2 != 0 ? std::byte{0x10} : std::byte{0};
         }
         return count_segments(address, data);
     },
     [](std::uint16_t address, MutableBytes data) {
         if (is_request(address, data, 0x80)) ignores_abort = segments_sent > 0;
         if (is_request(address, data, 0x40) || is_request(address, data, 0x50)) ignores_abort = false;
     }},
    {"segments.new_request", "a new request behind the first segment gets no reply", count_segments,
     [](std::uint16_t address, MutableBytes data) {
         if (segments_sent == 0 || !is_request(address, data, 0x40) || load_le<std::uint16_t>(data, 3) != 0x1000)
             return;
         data[2] = std::byte{0x80};
         segments_sent = 0;
     }},
    {"segments.new_request", "a new request ends the transfer without a reply", note_segments,
     [](std::uint16_t address, MutableBytes data) {
         if (!in_segments || !is_request(address, data, 0x40) || load_le<std::uint16_t>(data, 3) != 0x1000) return;
         data[2] = std::byte{0x80};
         in_segments = false;
     }},
    {"segments.toggle", "another abort code", replace_abort<0x05030000, 0x08000000>},
    {"segments.without_begin", "another abort code", replace_abort<0x05040001, 0x08000000>},
    {"pdos.mapping", "the count is acknowledged and not written", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         // The firmware receives an expedited download of 0x1600:00 with the present value.
         if (!is_request(address, data, 0x2F) || load_le<std::uint16_t>(data, 3) != 0x1600 || data[5] != std::byte{0})
             return;
         data[2] = std::byte{0x40};
     }},
    {"pdos.assignment", "a value is written while the count is not 0", grant<0x1C12, 1>},
    {"pdos.unknown", "a PDO that does not exist", grant<0x1C12, 1>},
    {"pdos.locked", "the count of the assignment is written in SAFEOP", grant<0x1C12, 0>},
    {"pdos.locked", "the count of the mapping is written in OP",
     [](std::uint16_t address, Octets& data) {
         static bool op = false;
         if (address == reg::kAlStatus.address) op = data[0] == std::byte{8};
         return !op || grant<0x1600, 0>(address, data);
     }},
    {"pdos.mapped", "an entry is not mappable",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x7000)
             data[20] &= ~std::byte{0x40};
         return true;
     }},
};

}  // namespace

std::span<const Fault> object_faults() { return kObjectFaults; }

}  // namespace margay::samples::conformance
