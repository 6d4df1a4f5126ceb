// Entries of process data that the application uses by their object or their place in a PDO: matched while the PDOs of
// a slave are read, and bound to their place once the image is laid out.
#pragma once

#include "mailbox/found_sms.hpp"
#include "network/network.hpp"

#include <margay/entry.hpp>

namespace margay {

// Access of the library to the private part of a handle.
struct EntryAccess {
    using Found = EntryHandle::Found;
    [[nodiscard]] static Found& found(EntryHandle& handle) { return handle.found_; }
    [[nodiscard]] static Direction direction(const EntryHandle& handle) { return handle.direction_; }
    [[nodiscard]] static EntryKind kind(const EntryHandle& handle) { return handle.kind_; }
    [[nodiscard]] static std::uint32_t type_bits(const EntryHandle& handle) { return handle.type_bits_; }
    // `half_octet`: offset of the entry's first octet in the outputs or in the inputs of the image.
    static void bind(EntryHandle& handle, const EntryPlace& place, MutableBytes image, std::uint32_t half_octet);
    // For an entry that is not mapped any more.
    static void release(EntryHandle& handle);
};

// Matches the handles of one slave with the entries found in its PDOs. For a SyncManager whose entries the application
// lists completely, the lists are used instead.
class EntryMatcher final : public EntrySink {
  public:
    // Deletes earlier results of the slave, and searches the application's lists.
    EntryMatcher(std::span<EntryHandle* const> handles, const Slave& slave);
    // Whether any handle is of this slave.
    [[nodiscard]] bool wanted() const { return wanted_; }
    // Deletes the results of the slave's PDOs; the results of the lists stay.
    void forget() override;

    void add(const FoundEntry& entry) override;
    // Completes the data type of entries that another source has found: the PDO mapping of CoE does not name types.
    void note_type(const FoundEntry& by_sii) override;

  private:
    void match(const FoundEntry& entry);

    std::span<EntryHandle* const> handles_;
    const Slave& slave_;
    std::uint16_t listed_ = 0;  // SyncManagers whose entries are listed completely, one bit each
    bool wanted_ = false;
};

// Passes only the data types of the SII's entries to the matcher.
class EntryTypes final : public EntrySink {
  public:
    explicit EntryTypes(EntrySink& entries) : entries_(entries) {}
    void add(const FoundEntry& entry) override { entries_.note_type(entry); }
    void note_type(const FoundEntry& entry) override { entries_.note_type(entry); }
    void forget() override {}

  private:
    EntrySink& entries_;
};

// The group whose list has the entries of the slave; nullptr: the slave's configuration has an unknown group number.
[[nodiscard]] inline const ProcessGroup* group_of_entries(const Network& network, const Slave& slave) {
    // During the first mapping the slave is not part of an image yet.
    const std::uint16_t group = slave.image.group != SlaveImage::kNoGroup ? slave.image.group : slave.config.group;
    return group < network.process.groups.size() ? &network.process.groups[group] : nullptr;
}

// The handles of the slave's group; none when the slave's configuration has an unknown group number.
[[nodiscard]] std::span<EntryHandle* const> entries_of(const Network& network, const Slave& slave);

// Checks whether a value of this type fits an entry. Returns `where` with the error code when it does not.
[[nodiscard]] Error check_entry_type(Error where, EntryKind kind, std::uint32_t type_bits, std::uint32_t bits,
                                     std::uint8_t data_type);

// Returns the place of the matched entry in the image. Errors: entry_not_mapped, entry_direction.
[[nodiscard]] Result<EntryPlace> place_of(const Slave& slave, const ProcessGroup& group, const EntryAddress& address,
                                          const EntryAccess::Found& found);

// Binds the handles of a laid out group, of all slaves or of one. Entries that are not mapped or do not fit are
// reported in errors(); the first error is returned.
[[nodiscard]] Error place_entries(Network& network, ProcessGroup& group, const Slave* only = nullptr);

// The functions for the entries of a group.
struct detail::EntryPart {
    Task<Result<>> (*discover)(Network& network, Slave& slave);
    Error (*place)(Network& network, ProcessGroup& group, const Slave* only);
};

// Marks all handles of the group as not mapped.
void release_entries(ProcessGroup& group);

}  // namespace margay
