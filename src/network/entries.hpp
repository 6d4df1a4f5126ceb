// Entries of process data that the application wants by name: matched while the PDOs of a slave are read, and placed
// once the image is laid out.
#pragma once

#include "mailbox/found_sms.hpp"
#include "network/network.hpp"

#include <margay/entry.hpp>

namespace margay {

// What the library may do with a handle.
struct EntryAccess {
    using Found = EntryHandle::Found;
    [[nodiscard]] static Found& found(EntryHandle& handle) { return handle.found_; }
    [[nodiscard]] static Direction direction(const EntryHandle& handle) { return handle.direction_; }
    [[nodiscard]] static EntryKind kind(const EntryHandle& handle) { return handle.kind_; }
    [[nodiscard]] static std::uint32_t type_bits(const EntryHandle& handle) { return handle.type_bits_; }
    // `half_octet`: of its first octet in the outputs or the inputs of the image.
    static void bind(EntryHandle& handle, const EntryPlace& place, MutableBytes image, std::uint32_t half_octet);
    // It is not mapped any more.
    static void release(EntryHandle& handle);
};

// The handles of one slave, by what a walk over its PDOs comes upon. What the application lists whole for a SyncManager
// counts above the walk.
class EntryMatcher final : public EntrySink {
  public:
    // Forgets what was found of the slave before, and looks through the application's lists.
    EntryMatcher(std::span<EntryHandle* const> handles, const Slave& slave);
    // Some of the handles are of this slave.
    [[nodiscard]] bool wanted() const { return wanted_; }
    // Of the walk; the lists stay.
    void forget();

    void take(const FoundEntry& entry) override;

  private:
    void match(const FoundEntry& entry);

    std::span<EntryHandle* const> handles_;
    const Slave& slave_;
    std::uint16_t listed_ = 0;  // SyncManagers that are listed whole, a bit each
    bool wanted_ = false;
};

// The handles of a group; none when the slave's configuration names no group that there is.
[[nodiscard]] std::span<EntryHandle* const> entries_of(const Network& network, const Slave& slave);

// Whether a value of this type fits an entry; `where` with the reason when not.
[[nodiscard]] Error check_entry_type(Error where, EntryKind kind, std::uint32_t type_bits, std::uint32_t bits,
                                     std::uint8_t data_type);

// Where the entry that was matched lies in the image. Errors: entry_not_mapped, entry_direction.
[[nodiscard]] Result<EntryPlace> place_of(const Slave& slave, const ProcessGroup& group, const EntryAddress& address,
                                          const EntryAccess::Found& found);

// Binds the handles of a group that was laid out, of all slaves or of one. What is not mapped or not right is told in
// errors(); the first of that is returned.
[[nodiscard]] Error place_entries(Network& network, ProcessGroup& group, const Slave* only = nullptr);

// Nothing is mapped any more.
void release_entries(ProcessGroup& group);

}  // namespace margay
