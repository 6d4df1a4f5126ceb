// The mandatory objects of a device with CoE, created from its SII: identity, name, SyncManager types, PDO assignment
// and mapping, and the mapped objects. A master that reads the device by CoE gets the same process data as from the
// SII.
#pragma once

#include "sim/sii_model.hpp"
#include "subdevice/object_dictionary.hpp"

#include <deque>
#include <map>
#include <string>
#include <vector>

namespace margay::sim {

class SiiDictionary {
  public:
    static constexpr std::uint16_t kAssignments = 0x1C10;  // plus the number of the SyncManager

    // The image is not needed after construction. Invalid content (objects at reserved indices, two objects with one
    // index) is left out.
    SiiDictionary(Bytes sii, const SiiModel& model);
    SiiDictionary(const SiiDictionary&) = delete;
    SiiDictionary& operator=(const SiiDictionary&) = delete;

    [[nodiscard]] std::span<const subdevice::Object> objects() const { return objects_; }
    [[nodiscard]] std::size_t image_bytes() const { return image_bytes_; }

  private:
    using Entry = subdevice::Entry;
    // Entries of the mapped objects, by index and subindex.
    using Mapped = std::map<std::uint16_t, std::map<std::uint8_t, Entry>>;
    struct ReadPdo {
        wire::sii::Pdo pdo;
        bool outputs;
    };

    void read(Bytes sii);
    void add_fixed(const SiiModel& model);
    void add_pdos(bool configurable);
    void add_assignments(const SiiModel& model);
    void collect(Mapped& mapped, const ReadPdo& read);
    void add_mapped(const Mapped& mapped);
    void add(std::uint16_t index, std::string_view name, std::vector<Entry> entries,
             const subdevice::ObjectHooks* hooks = nullptr, subdevice::DataType type = subdevice::DataType::none);
    // A count followed by a list of numbers. The master may change the list when `room` is not 0.
    [[nodiscard]] std::vector<Entry> list(const std::vector<std::uint32_t>& values, std::size_t room,
                                          subdevice::DataType type);
    [[nodiscard]] Entry in_image(std::uint8_t subindex, const char* name, subdevice::DataType type, std::uint32_t bits,
                                 std::uint16_t access, std::uint64_t initial = 0);
    [[nodiscard]] const char* name(wire::sii::StringNumber number, const char* otherwise);

    Bytes strings_;
    std::vector<ReadPdo> pdos_;
    std::deque<std::string> names_;
    std::deque<std::vector<Entry>> entries_;
    std::map<std::uint16_t, subdevice::Object> by_index_;
    std::vector<subdevice::Object> objects_;
    std::size_t image_bytes_ = 0;
};

}  // namespace margay::sim
