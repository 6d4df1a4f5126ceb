// The object dictionary of an ESI file.
#include "files/esi_read.hpp"

#include <algorithm>
#include <map>

namespace margay::files {
namespace {

constexpr std::size_t kMostItems = 256;

char mapping_of(std::string_view text) {
    bool out = false;
    bool in = false;
    for (const char c : text) {
        out |= c == 'R' || c == 'r';
        in |= c == 'T' || c == 't';
    }
    return out && in ? 'B' : out ? 'R' : in ? 'T' : '\0';
}

std::string access_of(Node flags) { return Reader::text(child(flags, "Access")); }

// The data types of one dictionary by their names.
class Types {
  public:
    Types(Reader& reader, Node dictionary) : r_(reader) {
        for (const Node type : dictionary.child("DataTypes").children("DataType"))
            types_.emplace(Reader::text(child(type, "Name")), type);
    }

    [[nodiscard]] Node find(std::string_view name) const {
        const auto found = types_.find(name);
        return found == types_.end() ? Node{} : found->second;
    }

    // An upper limit of the number of subindices of the type.
    [[nodiscard]] std::size_t count(Node type) const {
        std::size_t sum = 0;
        for (const Node sub : type.children("SubItem")) {
            const Node bounds = find(child(sub, "Type").text).child("ArrayInfo");
            const Number elements = parse_number(child(bounds, "Elements").text);
            const bool array = !child(sub, "SubIdx").there && elements.valid;
            sum += array ? static_cast<std::size_t>(std::min<std::uint64_t>(elements.magnitude, kMostItems)) : 1;
        }
        return sum;
    }

    // The subindices of an object of this type.
    [[nodiscard]] std::vector<EsiObject::Item> items(Node type) const {
        std::vector<EsiObject::Item> items;
        for (const Node sub : type.children("SubItem")) {
            EsiObject::Item item;
            item.name = english(sub, "Name");
            item.data_type = Reader::text(child(sub, "Type"));
            item.bits = r_.number<std::uint32_t>(child(sub, "BitSize"));
            item.access = access_of(sub.child("Flags"));
            item.pdo_mapping = mapping_of(child(sub.child("Flags"), "PdoMapping").text);
            if (const Value number = child(sub, "SubIdx"); number.there) {
                item.subindex = r_.number<std::uint8_t>(number);
                items.push_back(std::move(item));
            } else {
                add_elements(sub, item, items);
            }
            if (items.size() > kMostItems) {
                r_.fail(type, "a data type has more than 256 subindices");
                return {};
            }
        }
        return items;
    }

  private:
    // The elements of an array: the array type has their number and their base type.
    void add_elements(Node sub, const EsiObject::Item& like, std::vector<EsiObject::Item>& items) const {
        const Node array = find(like.data_type);
        const Node bounds = array.child("ArrayInfo");
        const auto first = r_.number<std::uint32_t>(child(bounds, "LBound"), 1);
        const auto count = r_.number<std::uint32_t>(child(bounds, "Elements"));
        if (!bounds || first > 255 || count > kMostItems || first + count > kMostItems) {
            r_.remark(sub, "the elements of the array '" + like.data_type + "' are not described as the standard says");
            return;
        }
        for (std::uint32_t n = 0; n < count; ++n) {
            EsiObject::Item item = like;
            item.subindex = static_cast<std::uint8_t>(first + n);
            item.name = like.name + " " + std::to_string(first + n);
            item.data_type = Reader::text(child(array, "BaseType"));
            item.bits = like.bits / count;
            items.push_back(std::move(item));
        }
    }

    Reader& r_;
    std::map<std::string, Node, std::less<>> types_;
};

void read_object(Reader& r, const Types& types, Node node, std::vector<EsiObject>& into) {
    EsiObject object;
    object.index = r.required<std::uint16_t>(node, "Index");
    object.name = english(node, "Name");
    object.data_type = Reader::text(child(node, "Type"));
    object.bits = r.number<std::uint32_t>(child(node, "BitSize"));
    object.access = access_of(node.child("Flags"));
    object.pdo_mapping = mapping_of(child(node.child("Flags"), "PdoMapping").text);
    object.default_data = r.octets(child(node.child("Info"), "DefaultData"));
    const Node type = types.find(object.data_type);
    if (!r.expand(node, types.count(type))) return;
    object.items = types.items(type);
    // The object has its own names for its subindices, in their order.
    std::size_t n = 0;
    for (const Node sub : node.child("Info").children("SubItem")) {
        if (n >= object.items.size()) break;
        if (const std::string name = english(sub, "Name"); !name.empty()) object.items[n].name = name;
        ++n;
    }
    into.push_back(std::move(object));
}

}  // namespace

std::vector<EsiObject> read_esi_dictionary(Reader& r, Node device) {
    std::vector<EsiObject> objects;
    for (const Node profile : device.children("Profile")) {
        if (const Node file = profile.child("DictionaryFile"))
            r.remark(file,
                     "the dictionary is in another file, '" + Reader::text(content(file)) + "', which is not read");
        const Node dictionary = profile.child("Dictionary");
        const Types types(r, dictionary);
        for (const Node node : dictionary.child("Objects").children("Object")) read_object(r, types, node, objects);
    }
    return objects;
}

}  // namespace margay::files
