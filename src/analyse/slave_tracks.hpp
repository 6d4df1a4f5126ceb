// The slaves of a recording: the slave that a datagram addresses, and the content of its registers and its SII.
#pragma once

#include "analyse/exchanges.hpp"
#include "wire/sync_manager.hpp"

namespace margay::analyse {

// The memory of the analysis for one slave, beside the facts of the slave.
struct SlaveTrack {
    std::size_t number = 0;  // in Analysis::slaves
    std::vector<std::byte> sii{};
    std::vector<bool> sii_read{};
    std::optional<std::uint32_t> sii_word{};  // the SII word that the master reads now
    bool sii_reading = false;
    bool sii_eight = false;  // the slave reads 8 octets at once
    std::map<unsigned, wire::SyncManager> sync_managers{};
    std::vector<std::byte> last_mail[2]{};                      // to and from the slave, since its mailbox was set up
    std::map<std::uint32_t, std::vector<std::byte>> objects{};  // identity, PDOs: index << 8 | subindex
    std::map<std::uint32_t, std::string> names{};               // of objects (subindex 0xFFF) and entries
    std::optional<std::size_t> joined_to{};                     // number of the track that continues in its place
    [[nodiscard]] bool sii_has(std::size_t from, std::size_t octets) const;
};

class SlaveTracks {
  public:
    explicit SlaveTracks(Analysis& analysis) : analysis_(analysis) {}

    // The slave that a datagram addresses. A new slave is added if it answers. nullptr: all slaves, a logical address,
    // no answer of an unknown slave, or too many slaves.
    [[nodiscard]] SlaveTrack* find(const Exchanged& e);
    // Reads addresses, registers and SII of the slave from a datagram. Returns the track of the slave. It is another
    // track if the new station address belongs to a track without a known position, because both are the same slave.
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

// The octets of a datagram at `address`, taken from `data` (e.sent or e.received); nullopt: the datagram does not
// contain all of them.
[[nodiscard]] inline std::optional<Bytes> octets_at(const Exchanged& e, Bytes data, std::uint32_t address,
                                                    std::size_t octets) {
    const std::uint32_t ado = e.header.address.ado();
    if (address < ado || address + octets > ado + data.size()) return std::nullopt;
    return data.subspan(address - ado, octets);
}
// Whether the command addresses registers of one slave or of all slaves.
[[nodiscard]] bool reads_registers(wire::Command c);
[[nodiscard]] bool writes_registers(wire::Command c);

}  // namespace margay::analyse
