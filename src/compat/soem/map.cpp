// Mapping a group: computes the sizes, places and pointers of the interface from the mapping of the library.
#include "compat/soem/facade.hpp"
#include "wire/esc.hpp"

#include <bitset>
#include <vector>

namespace margay::soem {
namespace {

constexpr std::size_t kLongestSegment = EC_MAXLRWDATA;

bool takes_part(const ec_slavet& slave, std::uint8_t group) { return group == 0 || slave.group == group; }

// The memory of the program. The library sets it to zero. The interface must not change it, so the old contents are
// restored.
struct ImageOfProgram {
    std::byte* begin = nullptr;
    std::vector<std::byte> before{};

    static std::span<std::byte> provide(std::size_t bytes, void* user) {
        auto& self = *static_cast<ImageOfProgram*>(user);
        // At the second call in the same mapping, the library has already set the octets to zero.
        if (bytes > self.before.size())
            self.before.insert(self.before.end(), self.begin + self.before.size(), self.begin + bytes);
        return {self.begin, bytes};
    }
    void restore() const { std::ranges::copy(before, begin); }
};

// Applies the settings of the program for a slave before the mapping.
void prepare_slave(ecx_contextt& context, Session& session, std::uint16_t number, std::uint8_t group) {
    const ec_slavet& s = slaves_of(context)[number];
    bool changed = false;
    {
        const Session::Guard guard(session);
        changed = std::memcmp(session.shown(number).data(), s.SM, sizeof(s.SM)) != 0;
        const Slave& slave = session.slave(number);
        slave.config.group = group;
        slave.config.block_lrw = s.blockLRW != 0;
        slave.config.no_complete_access = (s.CoEdetails & ECT_COEDET_SDOCA) == 0;
        slave.config.source = ConfigurationSource::none;
        slave.config.sm_count = 0;
        slave.config.unchecked_pdos = true;  // the interface writes the mapped PDOs also if the firmware has changed
        static_cast<void>(clear_error(session.context(), number));  // say_unmapped() prints the error of this mapping
    }
    if (changed) take_sync_managers(context, session, number);
}

// The clock whose time the cycle of the group distributes: the first clock of the segment, if the group has any clock.
// The time of a later clock would write zeros into the clocks before it. Some chips have the feature but no running
// clock, which ecx_configdc() detects. With the lock.
std::uint16_t clock_of(ecx_contextt& context, Session& session, std::uint8_t group) {
    std::uint16_t first = 0;
    for (int n = 1; n <= slave_count(context); ++n) {
        const ec_slavet& s = slaves_of(context)[n];
        const ClockKind kind = slave_clock(session.context(), static_cast<std::uint16_t>(n)).kind;
        if (s.hasdc == 0 || kind == ClockKind::none || kind == ClockKind::receive_times) continue;
        if (first == 0) first = static_cast<std::uint16_t>(n);
        if (takes_part(s, group)) return first;
    }
    return 0;
}

// The FMMUs of a slave, with the numbers that the library gives them: one that the SII names for this use, else one
// that it names as unused, else any. The interface has room for the first of them.
class ShownFmmus {
  public:
    ShownFmmus(ec_slavet& s, const Slave& slave, std::uint32_t start) : s_(s), slave_(slave), start_(start) {
        std::fill_n(s.FMMU, EC_MAXFMMU, ec_fmmut{});
        const bool is_read = !slave.place_kept && !slave.held;
        available_ = is_read ? std::min<std::size_t>(slave.dl.fmmus, taken_.size()) : taken_.size();
    }
    // `bits` may be 0: no FMMU.
    void add(std::uint32_t offset_bits, std::uint32_t bits, std::uint16_t physical, Direction direction) {
        const bool outputs = direction == Direction::outputs;
        const std::size_t number = bits == 0 ? taken_.size() : number_for(outputs ? FmmuUse::outputs : FmmuUse::inputs);
        if (number == taken_.size()) return;
        taken_.set(number);
        if (number >= EC_MAXFMMU) return;
        const std::uint32_t last = offset_bits + bits - 1;
        ec_fmmut& fmmu = s_.FMMU[number];
        fmmu.LogStart = htoel(start_ + offset_bits / 8);
        fmmu.LogLength = htoes(static_cast<uint16>(last / 8 - offset_bits / 8 + 1));
        fmmu.LogStartbit = static_cast<uint8>(offset_bits % 8);
        fmmu.LogEndbit = static_cast<uint8>(last % 8);
        fmmu.PhysStart = htoes(physical);
        fmmu.FMMUtype = outputs ? 2 : 1;
        fmmu.FMMUactive = 1;
    }
    [[nodiscard]] std::uint8_t first_free() const {
        std::uint8_t n = 0;
        while (n < EC_MAXFMMU && taken_.test(n)) ++n;
        return n;
    }

  private:
    [[nodiscard]] std::size_t number_for(FmmuUse use) const {
        for (const FmmuUse wanted : {use, FmmuUse::unused})
            for (std::size_t n = 0; n < available_; ++n) {
                const FmmuUse named = n < slave_.fmmu_count ? slave_.fmmu_use[n] : FmmuUse::unused;
                if (!taken_.test(n) && named == wanted) return n;
            }
        std::size_t n = 0;
        while (n < taken_.size() && taken_.test(n)) ++n;
        return n;
    }

    ec_slavet& s_;
    const Slave& slave_;
    std::uint32_t start_;  // logical address of the group
    std::bitset<16> taken_;
    std::size_t available_ = 0;  // in the chip
};

// The number of bits of all SyncManagers of one direction.
std::uint32_t sum(const Slave& slave, Direction direction) {
    std::uint32_t bits = 0;
    for (const ProcessSm& sm : slave.config.used_sms())
        if (sm.direction == direction) bits += sm.bits;
    return bits;
}

// The FMMUs of one direction, from this place in the image on. SyncManagers that follow each other in the image and in
// the memory of the slave have one FMMU. The end is that of the data, as the original shows it, also where the FMMU of
// the chip ends with the octet.
void show_fmmus(ShownFmmus& fmmus, const Slave& slave, Packing packing, Direction direction, std::uint32_t place) {
    const bool octets =
        packing == Packing::bytes || (slave.dl.features & wire::features::kFmmuBitOperationNotSupported) != 0;
    std::uint32_t begin = place;
    std::uint32_t end = place;
    std::uint16_t physical = 0;
    for (const ProcessSm& sm : slave.config.used_sms()) {
        if (sm.direction != direction || sm.bits == 0) continue;
        const bool first = end == begin;
        const std::uint32_t at = first ? place : (end + 7) / 8 * 8;
        const bool adjacent = !first && (octets || at == end) && (at - begin) % 8 == 0;
        if (!adjacent || physical + (at - begin) / 8 != sm.start) {
            fmmus.add(begin, end - begin, physical, direction);
            begin = at;
            physical = sm.start;
        }
        end = at + sm.bits;
    }
    fmmus.add(begin, end - begin, physical, direction);
}

// The number of slaves that count in a direction. In the packed mode of SOEM 2.0 only slaves whose data ends an octet
// count.
bool counts(const ecx_contextt& context, const ImagePart& part) {
    if (part.bits == 0) return false;
    if (!kBytesUnlessPacked || !packed(context)) return true;
    return (part.offset_bits + part.bits) / 8 > part.offset_bits / 8;
}

// The frames of the group: octets of each, and where the inputs begin.
void show_segments(ec_groupt& g, std::size_t octets, std::size_t inputs_at) {
    g.nsegments = 0;
    g.Isegment = 0;
    g.Ioffset = static_cast<uint16>(inputs_at);
    std::size_t room = kLongestSegment - EC_FIRSTDCDATAGRAM;
    std::size_t at = 0;
    while (at < octets && g.nsegments < EC_MAXIOSEGMENTS) {
        const std::size_t size = std::min(octets - at, room);
        if (inputs_at >= at && inputs_at < at + size) {
            g.Isegment = g.nsegments;
            g.Ioffset = static_cast<uint16>(inputs_at - at);
        }
        g.IOsegment[g.nsegments++] = static_cast<uint32>(size);
        at += size;
        room = kLongestSegment;
    }
}

// The octets for the status of mailboxes behind the inputs: one of each slave with a mailbox and a free FMMU.
int place_status(ecx_contextt& context, Session& session, std::uint8_t group, std::uint8_t* at) {
    if (!kStatusOctets) return 0;
    int count = 0;
    for (int n = 1; n <= slave_count(context); ++n) {
        ec_slavet& s = slaves_of(context)[n];
        if (!takes_part(s, group) || s.mbx_l == 0) continue;
        if (s.FMMUunused >= session.slave(static_cast<std::size_t>(n)).dl.fmmus) continue;
        set_status_slave(groups_of(context)[group], count, static_cast<std::uint16_t>(n));
        set_status(s, at + count++);
    }
    set_status(groups_of(context)[group], count == 0 ? nullptr : at, count);
    return count;
}

// The working counters of the group: a cycle returns twice the counter of the outputs plus the counter of the
// inputs.
void show_counters(ecx_contextt& context, Session& session, std::uint8_t group) {
    ec_groupt& g = groups_of(context)[group];
    const Group& mapped = session.context().group(group);
    unsigned out = 0;
    unsigned in = 0;
    for (int n = 1; n <= slave_count(context); ++n) {
        const Slave& slave = session.slave(static_cast<std::size_t>(n));
        if (slave.image.group != group) continue;
        out += counts(context, slave.image.outputs) ? 1U : 0U;
        in += counts(context, slave.image.inputs) ? 1U : 0U;
    }
    Session::GroupFacts& facts = session.facts(group);
    facts.time = &mapped.dc_time;
    facts.shown_time = &dc_time(context);
    if (facts.empty) facts.blocked = Session::kNotBlocked;
    facts.block_lrw = facts.empty ? &Session::kEmpty : &g.blockLRW;
    const Writing writing = writing_datagrams(session, group);
    facts.set_written(writing.datagrams);
    const unsigned written = writing.wkc;
    const bool split = written != 0;
    g.outputsWKC = static_cast<uint16>(out);
    g.inputsWKC = static_cast<uint16>(in);
    // Data of one slave in two frames counts in both.
    const unsigned sum = mapped.expected_wkc + written;
    if (mapped.datagrams.size() > (split ? 2U : 1U) && sum > 2 * out) g.inputsWKC = static_cast<uint16>(sum - 2 * out);
}

// Where the image of a mapped group begins. The library gives group 0 other addresses at each mapping.
std::uint32_t logical_start(Context& context, std::uint8_t group) {
    std::uint32_t start = static_cast<std::uint32_t>(group) << EC_LOGGROUPOFFSET;
    const auto first = process_datagram(context, 0, group);
    if (first.command == 0) return start;
    start = first.address.value;
    for (std::size_t n = 1; n < context.group(group).datagrams.size(); ++n)
        start = std::min(start, process_datagram(context, n, group).address.value);
    return start;
}

// Sizes and pointers of the group, and of slave 0, which represents all slaves. Returns the number of used octets.
int show_group(ecx_contextt& context, Session& session, std::uint8_t group, std::uint8_t* image, bool overlapped) {
    ec_groupt& g = groups_of(context)[group];
    const Session::Guard guard(session);
    const Group& mapped = session.context().group(group);
    g.logstartaddr = logical_start(session.context(), group);
    std::uint32_t begin = 0;  // of the slave in the logical address space, where its outputs and inputs overlap
    std::uint32_t end = 0;
    std::uint32_t inputs_end = 0;
    for (int n = 1; n <= slave_count(context); ++n) {
        if (!takes_part(slaves_of(context)[n], group)) continue;
        fill_process_data(context, session, static_cast<std::uint16_t>(n), group, image);
        const SlaveImage& data = session.slave(static_cast<std::size_t>(n)).image;
        const std::uint32_t out = data.outputs.bits == 0 ? 0 : (data.outputs.offset_bits + data.outputs.bits + 7) / 8;
        const std::uint32_t in =
            data.inputs.bits == 0 ? 0 : (data.inputs.offset_bits + data.inputs.bits + 7) / 8 - mapped.output_bytes;
        begin = end;
        end = std::max({end, out, in});
        inputs_end = data.inputs.bits == 0 ? begin : in;
    }
    g.Obytes = mapped.output_bytes;
    // In the overlapped mode the interface shows the end of the inputs of the last slave, or the place where they would
    // begin.
    g.Ibytes = overlapped ? inputs_end : mapped.input_bytes;
    g.outputs = image;
    g.inputs = image + g.Obytes;
    const int status = place_status(context, session, group, image + g.Obytes + g.Ibytes);
    const auto extra = static_cast<std::uint32_t>(status);
    const std::uint32_t cyclic = overlapped ? std::max(g.Obytes, g.Ibytes + extra) : g.Obytes + g.Ibytes + extra;
    show_segments(g, cyclic, overlapped ? 0 : g.Obytes);
    session.facts(group).empty = cyclic == 0;
    show_counters(context, session, group);
    // Slaves that were in another group do not count in that group any more.
    for (int n = 0; n < most_groups(context); ++n)
        if (n != group && session.known_group(static_cast<std::uint8_t>(n)))
            show_counters(context, session, static_cast<std::uint8_t>(n));
    if (group == 0) {
        ec_slavet& all = slaves_of(context)[0];
        all.outputs = g.outputs;
        all.inputs = g.inputs;
        all.Obytes = g.Obytes;
        all.Ibytes = g.Ibytes + extra;
        set_status(all, status != 0 ? g.inputs + g.Ibytes : nullptr);
    }
    return static_cast<int>(g.Obytes + g.Ibytes + extra);
}

// Whether the slave has a dictionary that could not be read.
bool is_unread(const Slave& slave) {
    return slave.pdos_failed && slave.seen && !slave.held && slave.al.state == AlState::preop &&
           slave.config.source != ConfigurationSource::application;
}

// Gives a slave without a readable dictionary the sizes of its SII, so that all other slaves have the same places as in
// the original. False: the SII contains no sizes.
bool take_sizes_of_sii(ecx_contextt& context, Session& session, std::uint16_t number) {
    ec_eepromPDOt outputs;
    ec_eepromPDOt inputs;
    const bool any = ecx_siiPDO(&context, number, &outputs, 1) + ecx_siiPDO(&context, number, &inputs, 0) != 0;
    const Session::Guard guard(session);
    const Slave& slave = session.slave(number);
    if (!any || !is_unread(slave)) return false;
    slave.config.sm_count = 0;
    for (std::uint8_t n = 0; n < EC_MAXSM; ++n) {
        const std::uint16_t bits = outputs.SMbitsize[n] != 0 ? outputs.SMbitsize[n] : inputs.SMbitsize[n];
        if (bits == 0) continue;
        const SmInfo& sm = slave.sync_managers[n];
        static_cast<void>(
            slave.config.add({.number = n,
                              .direction = outputs.SMbitsize[n] != 0 ? Direction::outputs : Direction::inputs,
                              .control = sm.control,
                              .start = sm.start,
                              .bits = bits}));
    }
    slave.config.source = ConfigurationSource::application;
    return true;
}

// Ends the mappings of the other groups that lose all their slaves to this one: the program may use their memory again.
void empty_others(ecx_contextt& context, Session& session, std::uint8_t group) {
    for (int n = 0; n < most_groups(context); ++n) {
        const auto other = static_cast<std::uint8_t>(n);
        if (other == group || !session.known_group(other)) continue;
        bool empty = true;
        {
            const Session::Guard guard(session);
            for (int s = 1; s <= slave_count(context); ++s)
                empty &= session.slave(static_cast<std::size_t>(s)).config.group != other;
        }
        MapRequest nothing;
        nothing.group = other;
        if (!empty) continue;
        static_cast<void>(session.run(nothing));
        const Session::Guard guard(session);
        session.facts(other).empty = true;
    }
}

// The interface returns the sizes also when slaves do not reach SAFEOP. A message then names the reason. `mapped`: the
// result of the mapping. Its error is the error of the first slave or of the group.
void say_unmapped(ecx_contextt& context, Session& session, std::uint8_t group, const Result<>& mapped) {
    if (mapped || mapped.error().code == Errc::image_overlaps || session.closing()) return;
    std::array<char, 256> text{};
    std::vector<std::string> sentences;
    bool others = false;
    for (int n = 1; n <= slave_count(context); ++n) {
        if (!takes_part(slaves_of(context)[n], group)) continue;
        const Session::Guard guard(session);
        const Slave& slave = session.slave(static_cast<std::size_t>(n));
        if (slave.al.state >= AlState::safeop) continue;
        others |= slave.error.code == Errc::none;
        if (slave.error.code != Errc::none)
            sentences.push_back("not in SAFEOP after the mapping: " + std::string(describe(slave.error, text)));
    }
    if (others)
        sentences.push_back("not in SAFEOP after the mapping: slaves of group " + std::to_string(group) + ": " +
                            std::string(describe(mapped.error(), text)));
    for (const std::string& sentence : sentences) say(sentence);
}

// Maps the group. The mapping finds slaves whose dictionary cannot be read. If there are any, the group is mapped a
// second time, without the hooks.
Result<> map(ecx_contextt& context, Session& session, MapRequest& request, HookCaller& hooks) {
    empty_others(context, session, request.group);
    const Result<> mapped = session.run(request, &hooks);
    if (!mapped && mapped.error().code == Errc::image_overlaps)
        say_once("group " + std::to_string(request.group) +
                 " is not mapped, because its memory is that of another group with slaves");
    bool again = false;
    for (int n = 1; n <= slave_count(context); ++n) {
        if (!takes_part(slaves_of(context)[n], request.group)) continue;
        const auto number = static_cast<std::uint16_t>(n);
        bool unread = false;
        {
            const Session::Guard guard(session);
            unread = is_unread(session.slave(number));
        }
        again |= unread && take_sizes_of_sii(context, session, number);
    }
    if (!again) return mapped;
    hooks.rest();
    return session.run(request);
}

}  // namespace

Writing writing_datagrams(Session& session, std::uint8_t group) {
    const Group& mapped = session.context().group(group);
    // Applies also to a group without inputs, and to slaves that refuse LRW: the first datagram is an LWR.
    constexpr std::uint8_t kLwr = 11;
    std::size_t count = 0;
    Writing writing;
    for (const DatagramStatus& datagram : mapped.datagrams) {
        if (process_datagram(session.context(), count, group).command != kLwr) break;
        writing.wkc += datagram.full;
        ++count;
    }
    writing.datagrams = mapped.datagrams.first(count);
    return writing;
}

void take_sync_managers(ecx_contextt& context, Session& session, std::uint16_t number) {
    ec_slavet& s = slaves_of(context)[number];
    const Session::Guard guard(session);
    const Slave& slave = session.slave(number);
    slave.config.sm_count = 0;
    for (std::uint8_t n = 0; n < EC_MAXSM; ++n) {
        if (s.SMtype[n] != static_cast<uint8>(SmType::outputs) && s.SMtype[n] != static_cast<uint8>(SmType::inputs))
            continue;
        const bool outputs = s.SMtype[n] == static_cast<uint8>(SmType::outputs);
        static_cast<void>(slave.config.add({.number = n,
                                            .direction = outputs ? Direction::outputs : Direction::inputs,
                                            .control = static_cast<std::uint8_t>(etohl(s.SM[n].SMflags)),
                                            .start = etohs(s.SM[n].StartAddr),
                                            .bits = etohs(s.SM[n].SMlength) * 8U}));
    }
    slave.config.source = ConfigurationSource::application;
    std::memcpy(session.shown(number).data(), s.SM, sizeof(s.SM));
}

void fill_process_data(ecx_contextt& context, Session& session, std::uint16_t number, std::uint8_t group,
                       std::uint8_t* image) {
    ec_slavet& s = slaves_of(context)[number];
    const Slave& slave = session.slave(number);
    const Group& mapped = session.context().group(group);
    const bool there = slave.image.group == group;
    const ImagePart& outputs = slave.image.outputs;
    const ImagePart& inputs = slave.image.inputs;
    const std::uint32_t out = there && outputs.bits != 0 ? sum(slave, Direction::outputs) : 0;
    const std::uint32_t in = there && inputs.bits != 0 ? sum(slave, Direction::inputs) : 0;
    const auto octets = [](std::uint32_t bits) { return bits < 8 ? 0U : (bits + 7) / 8; };
    s.Obits = static_cast<uint16>(out);
    s.Obytes = octets(out);
    s.outputs = out != 0 ? image + outputs.offset_bits / 8 : nullptr;
    s.Ostartbit = static_cast<uint8>(out != 0 ? outputs.offset_bits % 8 : 0);
    s.Ibits = static_cast<uint16>(in);
    s.Ibytes = octets(in);
    s.inputs = in != 0 ? image + inputs.offset_bits / 8 : nullptr;
    s.Istartbit = static_cast<uint8>(in != 0 ? inputs.offset_bits % 8 : 0);
    set_offsets(s, out != 0 ? outputs.offset_bits / 8 : 0, in != 0 ? inputs.offset_bits / 8 : 0);
    set_status(s, nullptr);

    for (const ProcessSm& sm : slave.config.used_sms()) {
        if (sm.number >= EC_MAXSM) continue;
        s.SM[sm.number].StartAddr = htoes(sm.start);
        s.SM[sm.number].SMlength = htoes(static_cast<uint16>(sm.bytes()));
        s.SM[sm.number].SMflags = htoel(static_cast<uint32>(sm.control | (sm.bits != 0 ? 0x10000U : 0U)));
        s.SMtype[sm.number] = sm.direction == Direction::outputs ? 3 : 4;
    }
    std::memcpy(session.shown(number).data(), s.SM, sizeof(s.SM));

    const std::uint32_t start = logical_start(session.context(), group);
    const std::uint32_t shift = mapped.config.overlapped ? mapped.output_bytes * 8 : 0;
    ShownFmmus fmmus(s, slave, start);
    const Packing packing = mapped.config.packing;
    if (out != 0) show_fmmus(fmmus, slave, packing, Direction::outputs, outputs.offset_bits);
    if (in != 0) show_fmmus(fmmus, slave, packing, Direction::inputs, inputs.offset_bits - shift);
    s.FMMUunused = fmmus.first_free();
}

int config_map(ecx_contextt& context, void* image, std::uint8_t group, bool overlapped, bool bytes) {
    const Pinned session = session_of(context);
    if (session == nullptr || image == nullptr || HookCaller::is_refused(*session, "ecx_config_map_group")) return 0;
    if (group >= most_groups(context)) {
        say_once("group " + std::to_string(group) + " is not mapped: the highest is " +
                 std::to_string(most_groups(context) - 1));
        return 0;
    }
    HookCaller hooks(context, *session, true);
    if (slave_count(context) < 1) return 0;
    for (int n = 1; n <= slave_count(context); ++n) {
        if (!takes_part(slaves_of(context)[n], group)) continue;
        const auto number = static_cast<std::uint16_t>(n);
        // config_init() has counted the slaves in group 0.
        if (group != 0 && slaves_of(context)[n].blockLRW != 0) {
            const Session::Guard guard(*session);  // another thread may exchange the group
            ++groups_of(context)[group].blockLRW;
        }
        prepare_slave(context, *session, number, group);
        hooks.attach(number);
    }
    ImageOfProgram memory{.begin = static_cast<std::byte*>(image)};
    MapRequest request;
    request.group = group;
    request.memory = &ImageOfProgram::provide;
    request.memory_user = &memory;
    {
        const Session::Guard guard(*session);
        GroupConfiguration& config = session->context().group(group).config;
        config.packing = bytes ? Packing::bytes : Packing::bits;
        config.overlapped = overlapped;
        session->facts(group).blocked = groups_of(context)[group].blockLRW;
        config.block_lrw = groups_of(context)[group].blockLRW != 0;
        if (group != 0) config.start = {static_cast<std::uint32_t>(group) << EC_LOGGROUPOFFSET};
        config.dc_reference = clock_of(context, *session, group);
    }
    say_unmapped(context, *session, group, map(context, *session, request, hooks));
    const int used = show_group(context, *session, group, static_cast<std::uint8_t*>(image), overlapped);
    {
        const Session::Guard guard(*session);
        memory.restore();
    }
    if (context.manualstatechange != 0) {
        WriteStateRequest down;
        down.wanted = AlState::preop;
        static_cast<void>(session->run(down));
    }
    return session->closing() ? 0 : used;
}

}  // namespace margay::soem
