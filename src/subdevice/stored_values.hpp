// Values that survive a loss of power: objects 0x1010 "Store parameters", 0x1011 "Restore default parameters" and
// 0x10F0 "Backup parameter handling" (ETG.1020). They are the values of all entries with od::kBackup.
//
//     struct Flash final : ValueStore { … };
//     struct Lamps final : Application { … StoredValues* stored_values() override { return &stored; } };
//     StoredValues stored(dictionary, flash, buffer);
//     (void)stored.load();  // before Device::start()
//     … array(0x1010, "Store parameters", kStoreEntries, &kStoreHooks),
//     … array(0x1011, "Restore default parameters", kRestoreEntries, &kRestoreHooks),
//     … record(0x10F0, "Backup parameter handling", kBackupEntries, &kBackupHooks),
#pragma once

#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

// The non-volatile memory, which the author of a device implements. One block of octets.
class ValueStore {
  public:
    // Copies the block to `into`. Returns its size; 0: there is none, or it is larger than `into`. After a save() that
    // answered later(), the master has given that command up: `into` may be the memory of its block.
    [[nodiscard]] virtual std::size_t load(MutableBytes into) = 0;

    // Stores a block in the place of the last one; an empty block erases it. Must not wait: while the memory is busy,
    // it returns HookAnswer::later(), and is called again with the same block, or with another one if the master has
    // given up and sends another command. The stack does not continue a command that the master has given up (INIT, or
    // 10 s without an end), because its result would reach no master. A memory that is written in pieces is then
    // between the old block and the new one until the next command. Abort::hardware_error: the memory has failed. Such
    // a memory, and a loss of power in between, must leave the old block, the new one, or a damaged one: load() of
    // StoredValues recognizes a damaged block.
    [[nodiscard]] virtual HookAnswer save(Bytes block, Time now) = 0;

  protected:
    ~ValueStore() = default;
};

// The size of a block: a head, and the values of all entries with od::kBackup. In the block of a modular device follows
// a part for each module that has such values: a head, and the values.
[[nodiscard]] constexpr bool is_stored(const Entry& entry) {
    return (entry.access & od::kBackup) != 0 && entry.storage == Storage::image;
}
[[nodiscard]] constexpr std::size_t stored_bytes(const Entry& entry) {
    return is_stored(entry) ? std::size_t{entry.bytes()} * entry.count : 0;
}
inline constexpr std::size_t kStoredHeadBytes = 12;
inline constexpr std::size_t kStoredPartHeadBytes = 8;
[[nodiscard]] constexpr std::size_t stored_value_bytes(std::span<const Object> table) {
    std::size_t bytes = 0;
    for (const Object& object : table)
        for (const Entry& entry : object.entries) bytes += stored_bytes(entry);
    return bytes;
}
[[nodiscard]] constexpr std::size_t stored_bytes(std::span<const Object> table) {
    return kStoredHeadBytes + stored_value_bytes(table);
}

class StoredValues {
  public:
    // All arguments must outlive the object. `buffer` has at least stored_bytes() of the table octets; of a modular
    // device, ModuleTables::kStoredBytes more.
    StoredValues(ObjectDictionary& dictionary, ValueStore& store, MutableBytes buffer)
        : dictionary_(dictionary), store_(store), buffer_(buffer) {}

    // Copies the stored values into the dictionary. Call it before Device::start(), and after Modules::lay_out().
    // Returns false and changes nothing if there is no block, the block is damaged, or it belongs to another table of
    // objects: one with other indices, subindices, data types or sizes. The values of a module are stored with its slot
    // and its kind: they are loaded where a module of that kind is in that slot. A module of another kind, or in
    // another slot, keeps its initial values. So does a value outside the limits of this table (a firmware with other
    // limits has stored it); the other values are loaded.
    [[nodiscard]] bool load();
    // The same for the module in one slot, from 1 on, that was plugged in after the start: call it in
    // Application::after() of INIT→PREOP. False: nothing is stored for this kind of module in this slot. A command that
    // is not finished has been given up by the master with INIT: load_module() ends it.
    [[nodiscard]] bool load_module(unsigned slot);

    // The CRC of the present values: a master compares it with the value that it knows, to see whether it must write
    // the parameters again. A value is copied under the lock in pieces of 64 octets: while an interrupt handler changes
    // a longer value, the CRC may be that of a mix.
    [[nodiscard]] std::uint32_t checksum();

    // For the hooks of the objects: called until the answer is not later(), with `again` from the second call of a
    // command on. After a success the memory has values of the time of this command, each as a whole; restore() also
    // sets the initial values in the dictionary. A block contains the values of the modules that are present when it is
    // stored, and not those of modules that were removed before.
    [[nodiscard]] HookAnswer save(Time now, bool again = false);
    [[nodiscard]] HookAnswer restore(Time now);
    // Four octets with a number, which the master reads or overwrites.
    [[nodiscard]] MutableBytes show(std::uint32_t number);
    [[nodiscard]] MutableBytes shown() { return shown_; }  // with the number of the last show()

  private:
    [[nodiscard]] Bytes block(std::size_t own_bytes, std::uint32_t layout);
    void load_part(unsigned slot, Bytes values);
    [[nodiscard]] bool load_parts(Bytes parts, unsigned only);
    void collect();  // values and head into buffer_

    ObjectDictionary& dictionary_;
    ValueStore& store_;
    MutableBytes buffer_;
    bool collected_ = false;   // buffer_ has a block that is being stored
    bool unfinished_ = false;  // the memory has not finished a command
    bool outdated_ = false;    // the memory may finish the block of another command
    std::array<std::byte, 4> shown_{};
};

// The values that the master writes.
inline constexpr std::uint32_t kSave = 0x65766173;     // "save"
inline constexpr std::uint32_t kRestore = 0x64616F6C;  // "load"

namespace stored_values {
[[nodiscard]] bool exists(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_save(const ObjectAccess& access, Bytes data);
[[nodiscard]] HookAnswer before_restore(const ObjectAccess& access, Bytes data);
[[nodiscard]] MutableBytes command(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_checksum(const ObjectAccess& access);
[[nodiscard]] MutableBytes checksum(const ObjectAccess& access);
}  // namespace stored_values

// Subindex 1 reads as 1: the device stores all parameters on command. "load" restores the initial values at once, so it
// is for PREOP; "save" is for all states with a mailbox. Another value is refused with Abort::cannot_store.
inline constexpr std::array kStoreEntries{
    entry_count(1), provided(1, "Store all parameters", DataType::unsigned32, 32, od::kReadWrite)};
inline constexpr std::array kRestoreEntries{
    entry_count(1), provided(1, "Restore all default parameters", DataType::unsigned32, 32, od::kReadWritePreop)};
inline constexpr std::array kBackupEntries{entry_count(1),
                                           provided(1, "Checksum", DataType::unsigned32, 32, od::kReadOnly)};

inline constexpr ObjectHooks kStoreHooks{
    .exists = stored_values::exists, .before_write = stored_values::before_save, .memory = stored_values::command};
inline constexpr ObjectHooks kRestoreHooks{
    .exists = stored_values::exists, .before_write = stored_values::before_restore, .memory = stored_values::command};
inline constexpr ObjectHooks kBackupHooks{
    .exists = stored_values::exists, .before_read = stored_values::before_checksum, .memory = stored_values::checksum};

}  // namespace margay::subdevice
