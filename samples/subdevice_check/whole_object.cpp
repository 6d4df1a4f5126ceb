#include "subdevice_check/whole_object.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

// The objects that are read from a device that describes no objects.
constexpr std::uint16_t kUsual[] = {0x1018, 0x1C00, 0x1C12, 0x1C13, 0x1600, 0x1A00};

enum class Form : std::uint8_t { aligned, packed, by_length };

// The octets of complete access, and the bits of them that are compared.
struct Image {
    std::vector<std::byte> data{};
    std::vector<std::byte> mask{};
    std::size_t bits = 0;
    void add(const SubindexValue& value, std::size_t bits_of_value, Form form) {
        if (form != Form::packed && bits_of_value >= 8) bits = (bits + 7) / 8 * 8;
        const auto end = bits + bits_of_value;
        data.resize((end + 7) / 8);
        mask.resize(data.size());
        for (std::size_t n = 0; value.data && n < bits_of_value; ++n, ++bits) {
            const auto bit = std::byte{1} << (bits % 8);
            mask[bits / 8] |= bit;
            const bool set =
                n / 8 < value.data->size() && ((*value.data)[n / 8] >> (n % 8) & std::byte{1}) != std::byte{};
            if (set) data[bits / 8] |= bit;
        }
        bits = end;
    }
};

Image image_of(const std::vector<SubindexValue>& values, std::uint8_t from, Form form) {
    Image image;
    for (const auto& value : values) {
        if (value.subindex < from) continue;
        const bool by_length = form == Form::by_length && value.data;
        image.add(value, value.subindex == 0 ? 16 : by_length ? value.data->size() * 8 : value.bits, form);
    }
    return image;
}

bool agrees(const Image& image, Bytes data) {
    if (data.size() != image.data.size()) return false;
    for (std::size_t n = 0; n < data.size(); ++n)
        if (((data[n] ^ image.data[n]) & image.mask[n]) != std::byte{0}) return false;
    return true;
}

bool is_text(coe::DataType type) {
    using enum coe::DataType;
    return type == visible_string || type == octet_string || type == unicode_string || type == domain;
}

constexpr std::size_t kMostWritable = 4;  // of one kind of objects

bool is_mapping(std::uint16_t index) {
    return (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00);
}

}  // namespace

bool is_pdo_assignment(std::uint16_t index) { return index >= 0x1C12 && index <= 0x1C2F; }

std::vector<std::uint16_t> whole_objects(const Session& session) {
    std::vector<std::uint16_t> indices;
    for (const auto& entry : session.sdo.entries)
        if (entry.subindex != 0 && (indices.empty() || indices.back() != entry.index)) indices.push_back(entry.index);
    if (session.sdo.entries.empty()) indices.assign(std::begin(kUsual), std::end(kUsual));
    return indices;
}

ObjectSummary summary_of(const Session& session, std::uint16_t index) {
    ObjectSummary summary{.writable = true, .parameters = true};
    bool any = false;
    for (const auto& entry : session.sdo.entries) {
        if (entry.index != index) continue;
        any = true;
        const bool padding = entry.type == coe::DataType::none;
        summary.bits += entry.subindex == 0 ? 16U : entry.bits;
        summary.varies = summary.varies || is_text(entry.type) || entry.bits == 0;
        summary.unreadable = summary.unreadable || (entry.access & coe::access::kReadPreop) == 0;
        if (entry.subindex == 0 || padding) continue;
        summary.writable = summary.writable && (entry.access & coe::access::kWritePreop) != 0;
        summary.parameters =
            summary.parameters && (entry.access & (coe::access::kBackup | coe::access::kSettings)) != 0;
    }
    if (!any) summary.writable = summary.parameters = false;
    return summary;
}

std::vector<std::uint16_t> writable_objects(const Session& session) {
    std::vector<std::uint16_t> found;
    std::array<std::size_t, 3> count{};
    for (const auto index : whole_objects(session)) {
        const auto access = summary_of(session, index);
        const bool modules = index == 0xF020 || index == 0xF030;
        const std::size_t kind = is_pdo_assignment(index) ? 0 : is_mapping(index) ? 1 : 2;
        if (!access.writable || access.varies || access.unreadable) continue;
        if (kind == 2 && index != 0x10F1 && !modules && !access.parameters) continue;
        if (++count[kind] <= kMostWritable) found.push_back(index);
    }
    return found;
}

std::optional<std::vector<SubindexValue>> read_values(Session& session, std::uint16_t index) {
    const auto count = session.sdo.number(index, 0);
    if (!count) return std::nullopt;
    std::vector<SubindexValue> values{{0, 16, std::vector{static_cast<std::byte>(*count), std::byte{0}}}};
    for (unsigned n = 1; n <= *count && n <= 255; ++n) {
        const auto subindex = static_cast<std::uint8_t>(n);
        const auto described = std::ranges::find_if(session.sdo.entries, [&](const DictionaryEntry& entry) {
            return entry.index == index && entry.subindex == subindex;
        });
        const bool known = described != session.sdo.entries.end();
        SubindexValue value{subindex, known ? described->bits : 0U};
        // The bits of padding have no value.
        if (known && (described->type == coe::DataType::none || (described->access & coe::access::kReadPreop) == 0)) {
            values.push_back(std::move(value));
            continue;
        }
        auto up = session.sdo.upload(index, subindex);
        if (!known && up.abort == Abort::no_subindex) continue;  // a gap
        if (!up.fault.empty() || (!up.ok() && !known)) return std::nullopt;
        if (known && up.ok() && !up.size_indicated)
            up.data.resize(std::min<std::size_t>(up.data.size(), (described->bits + 7U) / 8U));
        if (!known || value.bits == 0) value.bits = up.data.size() * 8;
        if (up.ok()) value.data = std::move(up.data);
        values.push_back(std::move(value));
    }
    return values;
}

bool leave_out_changes(std::vector<SubindexValue>& values, const std::vector<SubindexValue>& again) {
    const auto same = [](const SubindexValue& a, const SubindexValue& b) { return a.subindex == b.subindex; };
    if (!std::ranges::equal(values, again, same) || values.front().data != again.front().data) return false;
    for (std::size_t n = 0; n < values.size(); ++n)
        if (values[n].data != again[n].data) values[n].data.reset();
    return true;
}

std::optional<std::string> difference(const std::vector<SubindexValue>& values, std::uint8_t from, Bytes data) {
    for (const auto form : {Form::aligned, Form::packed, Form::by_length})
        if (agrees(image_of(values, from, form), data)) return std::nullopt;
    const auto expected = image_of(values, from, Form::aligned);
    return fmt::format("{} octets ({}), its subindices{} have {} ({})", data.size(), hex(data),
                       from == 0 ? " with 16 bits for subindex 0" : "", expected.data.size(), hex(expected.data));
}

}  // namespace margay::samples::conformance
