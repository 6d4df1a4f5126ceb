// Data that a slave reports: its modules, and a description for an ESI.
#include <margay/files/esi.hpp>
#include <margay/margay.hpp>

#include "files/eni_write.hpp"
#include "files/esi_object.hpp"
#include "files/esi_types.hpp"
#include "files/said.hpp"
#include "files/xml.hpp"
#include "wire/sii_category.hpp"

#include <algorithm>

namespace margay::files {
namespace {

std::string text_of(std::span<const std::byte> octets) {
    std::array<char, 256> text{};
    return std::string(wire::sii::to_utf8(octets, text));
}

char mapping_of(std::uint16_t access) {
    const bool out = (access & 0x0040) != 0;
    const bool in = (access & 0x0080) != 0;
    return out && in ? 'B' : out ? 'R' : in ? 'T' : '\0';
}

EsiObject::Item item_of(const SaidEntry& entry) {
    const bool readable = (entry.access & 0x0007) != 0;
    const bool writable = (entry.access & 0x0038) != 0;
    return {.subindex = entry.subindex,
            .name = entry.name,
            .data_type = std::string(data_type_name(entry.data_type, entry.bits)),
            .bits = entry.bits,
            .access = readable ? (writable ? "rw" : "ro") : "wo",
            .pdo_mapping = mapping_of(entry.access)};
}

// The objects that the slave lists. Entries that it does not describe are left out.
std::string read_dictionary(Context& ctx, std::uint16_t slave, std::vector<EsiObject>& into) {
    std::vector<std::uint16_t> indices;
    const auto collect = [](std::span<const std::uint16_t> some, void* user) {
        auto& all = *static_cast<std::vector<std::uint16_t>*>(user);
        all.insert(all.end(), some.begin(), some.end());
    };
    const auto listed = read_object_list(ctx, slave, ObjectList::all, collect, &indices);
    if (!listed) return said(listed.error());
    for (const std::uint16_t index : indices) {
        const auto object = read_object_description(ctx, slave, index);
        if (!object) return said(object.error());
        std::vector<SaidEntry> entries;
        for (unsigned subindex = 0; subindex <= object->max_subindex; ++subindex) {
            const auto entry = read_entry_description(ctx, slave, index, static_cast<std::uint8_t>(subindex));
            if (entry)
                entries.push_back({entry->subindex, entry->access, entry->data_type, entry->bit_length,
                                   text_of(std::as_bytes(std::span(entry->name())))});
        }
        into.push_back(
            esi_object(index, text_of(std::as_bytes(std::span(object->name()))), object->max_subindex, entries));
    }
    return {};
}

}  // namespace

EsiObject esi_object(std::uint16_t index, std::string name, unsigned max_subindex, std::span<const SaidEntry> entries) {
    EsiObject object{.index = index, .name = std::move(name)};
    for (const SaidEntry& entry : entries) {
        const EsiObject::Item item = item_of(entry);
        if (max_subindex != 0) object.items.push_back(item);
        if (entry.subindex != 0 || max_subindex != 0) continue;
        object.data_type = item.data_type;
        object.bits = item.bits;
        object.access = item.access;
        object.pdo_mapping = item.pdo_mapping;
    }
    return object;
}

std::string read_sii_image(Context& ctx, std::uint16_t slave, std::vector<std::byte>& image) {
    constexpr std::size_t kBlock = 128;
    const std::size_t most =
        std::min<std::size_t>(std::max<std::uint32_t>(ctx.slave(slave).sii_bytes, wire::sii::kFixedBytes + kBlock),
                              wire::sii::kMostContentBytes);
    while (image.size() < most) {
        const std::size_t at = image.size();
        image.resize(at + kBlock);
        const auto read = read_sii(ctx, slave, static_cast<std::uint32_t>(at / 2), std::span(image).subspan(at));
        if (!read) return said(read.error());
        wire::sii::CategoryWalker walker{Bytes(image)};
        while (walker.next()) {
        }
        if (image.size() > wire::sii::kFixedBytes && walker.fault() == wire::sii::Fault::none) break;
    }
    return {};
}

Read<EsiDevice> describe_slave(Context& ctx, std::uint16_t slave) {
    std::vector<std::byte> image;
    Read<EsiDevice> result;
    if (const std::string error = read_sii_image(ctx, slave, image); !error.empty()) {
        result.problem.text = error;
        return result;
    }
    result = describe_sii(image);
    if (!result || (result->mailbox ? result->mailbox->protocols & mailbox_protocol::kCoE : 0) == 0 ||
        (result->mailbox->coe_details & coe_detail::kSdoInformation) == 0)
        return result;
    const std::string error = read_dictionary(ctx, slave, result->dictionary);
    if (!error.empty()) result.remarks.push_back({.text = "the dictionary is not complete: " + error});
    return result;
}

}  // namespace margay::files
