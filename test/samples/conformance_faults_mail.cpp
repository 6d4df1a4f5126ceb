// Faults of the mailbox and of the SDO information service, which subdevice_check finds.
#include "samples/conformance_faults.hpp"

namespace margay::samples::conformance {
namespace {

constexpr Fault kMailFaults[] = {
    {"mailbox.states", "no reply in SAFEOP and OP",
     [](std::uint16_t address, Octets& data) {
         static unsigned state = 0;
         if (address == reg::kAlStatus.address) state = std::to_integer<unsigned>(data[0]) & 0x0F;
         return state < 4 || address < 0x1400 || address >= 0x1480;
     }},
    {"mailbox.states", "the first request in OP leads to SAFEOP",
     [](std::uint16_t address, Octets& data) {
         static bool op = false;
         if (address == reg::kAlStatus.address) op = data[0] == std::byte{8};
         if (op && is_mail(address, data)) leave_op = true;
         return true;
     },
     nullptr,
     [](subdevice::EscAccess& esc) {
         if (std::exchange(leave_op, false)) set_al_status(esc, 0x14, 0x0001);
     }},
    {.check = "mailbox.type",
     .what = "the SII announces FoE",
     .prepare = [](sim::Device& device) { device.sii[0x1C * 2] |= std::byte{mailbox_protocol::kFoE}; }},
    {"mailbox.octets", "the reply to a message of the size of the mailbox is empty",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && full_message) store_le<std::uint16_t>(data, 0, 0);
         return true;
     },
     [](std::uint16_t address, MutableBytes data) {
         if (address == 0x1000 && data.size() >= 6) full_message = load_le<std::uint16_t>(data, 0) == 128 - 6;
     }},
    {"mailbox.full", "every fourth reply has another type",
     [](std::uint16_t address, Octets& data) {
         static unsigned count = 0;
         if (is_mail(address, data) && ++count % 4 == 0) data[5] |= std::byte{0x0F};
         return true;
     }},
    {.check = "mailbox.channel",
     .what = "the channel is not checked",
     .read =
         [](std::uint16_t address, MutableBytes data) {
             if (address == 0x1000 && data.size() >= 6) data[4] &= std::byte{0xC0};
         },
     .severity = kRemark},
    {"mailbox.duplicate", "each message looks new", nullptr,
     [](std::uint16_t address, MutableBytes data) {
         static unsigned count = 0;
         if (address == 0x1000 && data.size() >= 6)
             data[5] = (data[5] & std::byte{0x8F}) | static_cast<std::byte>((++count % 7 + 1) << 4);
     }},
    {"mailbox.repeat", "a repeat is never acknowledged",
     [](std::uint16_t address, Octets& data) {
         if (address == 0x080F) data[0] &= ~std::byte{wire::sm_pdi_control::kRepeatAcknowledge};
         return true;
     }},
    {"mailbox.type", "another detail", replace_error_detail},
    {"mailbox.length", "another detail", replace_error_detail},
    {"information.subindices", "subindex 0 is higher than the description says",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::object_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1018)
             data[16] = std::byte{3};
         return true;
     }},
    {"information.limits", "the minimum is 1 and the maximum is 0",
     [](std::uint16_t address, Octets& data) {
         if (!is_information(address, data, coe::InfoOpcode::entry_response)) return true;
         const auto length = load_le<std::uint16_t>(data, 0);
         const std::size_t bytes = load_le<std::uint16_t>(data, 18) / 8U;
         if (bytes == 0 || data.size() != length + 6U || data.size() + 2 * bytes > 64) return true;
         data[15] = std::byte{coe::value_info::kMinimum | coe::value_info::kMaximum};
         Octets limits(2 * bytes);
         limits[0] = std::byte{1};
         data.insert(data.begin() + 22, limits.begin(), limits.end());
         store_le(MutableBytes(data), 0, static_cast<std::uint16_t>(length + 2 * bytes));
         return true;
     }},
    {"information.lists", "another list is named",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::list_response)) data[12] = std::byte{0};
         return true;
     }},
    {"information.uses", "a list of mappable objects has one that cannot be mapped",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::list_response) && data[12] == std::byte{2})
             store_le<std::uint16_t>(MutableBytes(data), data.size() - 2, 0x1018);
         return true;
     }},
    {.check = "information.uses",
     .what = "the list of mappable objects is empty",
     .write =
         [](std::uint16_t address, Octets& data) {
             if (!is_information(address, data, coe::InfoOpcode::list_response) || data[12] != std::byte{3})
                 return true;
             data.resize(14);
             store_le<std::uint16_t>(MutableBytes(data), 0, 8);
             return true;
         },
     .severity = kRemark},
    {"information.entries", "another object is described",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::object_response)) data[13] = std::byte{0x77};
         return true;
     }},
    {"information.entries", "the data type has another size",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1000)
             data[16] = std::byte{3};
         return true;
     }},
    {"information.identity", "another product code",
     [](std::uint16_t address, Octets& data) {
         if (is_upload(address, data, 0x1018, 2)) data[12] ^= std::byte{1};
         return true;
     }},
    {"information.lists", "a wrong length",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::list_response) && data[12] == std::byte{0})
             data[14] ^= std::byte{1};
         return true;
     }},
    {"information.entries", "another number of bits",
     [](std::uint16_t address, Octets& data) {
         if (is_information(address, data, coe::InfoOpcode::entry_response) &&
             load_le<std::uint16_t>(data, 12) == 0x1000)
             data[18] ^= std::byte{8};
         return true;
     }},
    {"information.errors", "another abort code", replace_abort<0x06020000, 0x08000000>},
    {"messages.headers", "the channel is 1",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data)) data[4] |= std::byte{1};
         return true;
     }},
    {"messages.headers", "the number of CoE is 1",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && (std::to_integer<unsigned>(data[5]) & 0x0F) == 3) data[6] |= std::byte{1};
         return true;
     }},
    {"messages.headers", "bit 7 of the octet with the counter is 1",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data)) data[5] |= std::byte{0x80};
         return true;
     }},
    {"messages.headers", "an abort is an SDO response",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_request)) data[7] = std::byte{0x30};
         return true;
     }},
    {"messages.headers", "complete access is not confirmed",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_response) && (data[8] & std::byte{0xF0}) == std::byte{0x50})
             data[8] &= std::byte{0xEF};
         return true;
     }},
    {"messages.headers", "each upload is one of complete access",
     [](std::uint16_t address, Octets& data) {
         if (is_service(address, data, coe::Service::sdo_response) && (data[8] & std::byte{0xF0}) == std::byte{0x40})
             data[8] |= std::byte{0x10};
         return true;
     }},
    {"messages.lengths", "the length is one octet too long",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && load_le<std::uint16_t>(data, 0) == coe::kSdoBytes)
             store_le(MutableBytes(data), 0, std::uint16_t{coe::kSdoBytes + 1});
         return true;
     }},
    {"messages.counters", "the counter runs from 1 to 6",
     [](std::uint16_t address, Octets& data) {
         if (is_mail(address, data) && (std::to_integer<unsigned>(data[5]) >> 4) == 7) data[5] &= std::byte{0x1F};
         return true;
     }},
};

}  // namespace

std::span<const Fault> mail_faults() { return kMailFaults; }

}  // namespace margay::samples::conformance
