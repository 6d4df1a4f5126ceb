// The slaves of a recording: which slave a datagram addresses, and what its registers and its SII say.
#pragma once

#include "analyse/exchanges.hpp"
#include "wire/sync_manager.hpp"

namespace margay::analyse {

// What is remembered of a slave beside its facts.
struct SlaveTrack {
    std::size_t number = 0;  // in Analysis::slaves
    std::vector<std::byte> sii{};
    std::vector<bool> sii_read{};
    std::optional<std::uint32_t> sii_word{};  // that the master reads now
    bool sii_reading = false;
    bool sii_eight = false;  // the slave reads 8 octets at once
    std::map<unsigned, wire::SyncManager> sync_managers{};
    std::vector<std::byte> last_mail[2]{};                      // to and from the slave, since its mailbox was set up
    std::map<std::uint32_t, std::vector<std::byte>> objects{};  // identity, PDOs: index << 8 | subindex
    std::map<std::uint32_t, std::string> names{};               // of objects (subindex 0xFFF) and entries
    std::optional<std::size_t> joined_to{};                     // number of the track that goes on in its place
    [[nodiscard]] bool sii_has(std::size_t from, std::size_t octets) const;
};

class SlaveTracks {
  public:
    explicit SlaveTracks(Analysis& analysis) : analysis_(analysis) {}

    // The slave that a datagram addresses; one that was not seen before is added if it answers. nullptr: all slaves, a
    // logical address, no answer of an unknown slave, or too many slaves.
    [[nodiscard]] SlaveTrack* find(const Exchanged& e);
    // What a datagram says about the slave's addresses, registers and SII. Returns the slave, which is another track
    // where its new station address is that of a slave whose position was not known: both are one slave.
    [[nodiscard]] SlaveTrack* look(const Exchanged& e, SlaveTrack* slave);
    // Removes the slaves that were joined to others. Call once, at the end; numbers of tracks are not valid then.
    void finish();
    [[nodiscard]] Slave& facts(const SlaveTrack& track) { return analysis_.slaves[track.number]; }
    [[nodiscard]] std::vector<SlaveTrack>& all() { return tracks_; }

  private:
    [[nodiscard]] SlaveTrack* by_position(std::uint16_t position, bool add);
    [[nodiscard]] SlaveTrack* by_station(std::uint16_t station, bool add);
    [[nodiscard]] SlaveTrack* added();
    void look_at_ring(const Exchanged& e);
    [[nodiscard]] SlaveTrack& assign_station(SlaveTrack& slave, std::uint16_t station);
    [[nodiscard]] SlaveTrack* without_position(std::uint16_t station);
    [[nodiscard]] SlaveTrack& join(SlaveTrack& slave, SlaveTrack& to);
    void look_at_sii(const Exchanged& e, SlaveTrack& slave);
    void take_sii(SlaveTrack& slave, Bytes data);
    void look_at_sync_managers(const Exchanged& e, SlaveTrack& slave);

    Analysis& analysis_;
    std::vector<SlaveTrack> tracks_{};  // reserved for kMostSlaves, so that pointers stay valid
    std::map<std::uint16_t, std::size_t> positions_{};
    std::map<std::uint16_t, std::size_t> stations_{};
    std::map<std::uint16_t, std::size_t> cleared_{};  // stations_ before a broadcast write of all station addresses
    std::optional<std::uint16_t> ring_{};
};

// What the datagram carries at `address`; nullopt: not all of the octets. Of `data`, which is e.sent or e.received.
[[nodiscard]] inline std::optional<Bytes> octets_at(const Exchanged& e, Bytes data, std::uint32_t address,
                                                    std::size_t octets) {
    const std::uint32_t ado = e.header.address.ado();
    if (address < ado || address + octets > ado + data.size()) return std::nullopt;
    return data.subspan(address - ado, octets);
}
// Commands that address registers of one slave or of all slaves.
[[nodiscard]] bool reads_registers(wire::Command c);
[[nodiscard]] bool writes_registers(wire::Command c);

}  // namespace margay::analyse
