// Complete access: what it returns for each record and array against what the subindices return, and what it writes.
#include "subdevice_check/check.hpp"
#include "subdevice_check/whole_object.hpp"

#include <algorithm>
#include <set>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kComplete = "ETG.1000.6, SDO Upload (complete access)";
constexpr Duration kLongest = 60s;  // for the comparison of all objects

bool announced(Session& session) {
    begin_sdo_check(session);
    return (session.bench.slave().coe_details & coe_detail::kCompleteAccess) != 0;
}

// The codes for an access that the device does not support, and for an object that is too large for it.
bool says_unsupported(Abort abort) {
    return abort == Abort::unsupported_access || abort == Abort::complete_access_unsupported;
}
bool says_too_large(Abort abort) { return abort == Abort::out_of_memory || abort == Abort::exceeds_mailbox; }

void check_complete_access(Session& session) {
    auto& bench = session.bench;
    const bool supported = announced(session);
    const auto up = session.sdo.upload(0x1018, 0, true);
    if (!supported) {
        if (!says_unsupported(up.abort))
            bench.remark(fmt::format("the SII does not announce complete access, and the slave answers {}",
                                     up.abort == Abort::none ? "with a value" : abort_text(up.abort)));
        return;
    }
    if (!up.ok()) {
        bench.fail(fmt::format("the SII announces complete access, and 0x1018 ended with {}",
                               reason_text(up.fault, up.abort)));
        return;
    }
    const auto values = read_values(session, 0x1018);
    if (!values) bench.skip("0x1018 cannot be read by its subindices (information.identity)");
    if (const auto wrong = difference(*values, 0, up.data)) bench.fail("0x1018 by complete access has " + *wrong);
    const auto rest = session.sdo.upload(0x1018, 1, true);
    if (!rest.ok() || difference(*values, 1, rest.data))
        bench.fail(fmt::format("0x1018 by complete access from subindex 1 on: {}",
                               rest.ok() ? std::string("another value") : reason_text(rest.fault, rest.abort)));
    if (session.sdo.upload(0x1018, 2, true).ok()) bench.fail("complete access from subindex 2 on is not refused");
    if (session.sdo.upload(0x5FFE, 0, true).abort != Abort::no_object)
        bench.fail("complete access to object 0x5FFE, which does not exist, is not refused with 0x06020000");
}

// All records and arrays.
class ObjectComparison {
  public:
    ObjectComparison(Session& session, bool supported) : session_(session), supported_(supported) {}

    void compare(std::uint16_t index) {
        for (const std::uint8_t from : {std::uint8_t{0}, std::uint8_t{1}}) {
            const auto up = session_.sdo.upload(index, from, true);
            if (!up.fault.empty()) {
                fail(fmt::format("0x{:04x} by complete access from subindex {} on: {}", index, from, up.fault));
            } else if (up.abort != Abort::none) {
                refused(index, from, up.abort);
            } else if (const auto wrong = lasting_difference(index, from, up.data)) {
                fail(fmt::format("0x{:04x} by complete access from subindex {} on has {}", index, from, *wrong));
            }
            if (up.ok()) ++answers_[from];
            if (from == 0 && !up.ok()) return;  // the next one would be the same finding again
        }
    }
    void conclude(std::size_t left) {
        auto& bench = session_.bench;
        if (findings_ > kMostFindings)
            bench.fail(fmt::format("complete access is wrong for {} more objects", findings_ - kMostFindings));
        if (!supported_ && answers_[0] != 0 && refusals_ != 0)
            bench.remark(fmt::format("the SII does not announce complete access; {} objects allow it, and {} refuse it",
                                     answers_[0], refusals_));
        if (!supported_ && codes_.size() > 1)
            bench.remark(fmt::format(
                "complete access, which is not supported, is refused with {} different abort codes", codes_.size()));
        if (supported_ && !refusing_.empty())
            bench.remark(fmt::format("the SII announces complete access, and {} objects refuse it: {}",
                                     refusing_.size(), list_text(refusing_)));
        if (left != 0) bench.remark(fmt::format("{} objects were not compared: the device is slow", left));
    }

  private:
    void fail(std::string text) {
        if (++findings_ <= kMostFindings) session_.bench.fail(std::move(text));
    }
    static std::string list_text(const std::set<std::uint16_t>& indices) {
        std::string text;
        std::size_t n = 0;
        for (const auto index : indices)
            if (++n <= kMostFindings) text += fmt::format("{}0x{:04x}", text.empty() ? "" : ", ", index);
        return n > kMostFindings ? text + ", …" : text;
    }
    void refused(std::uint16_t index, std::uint8_t from, Abort abort) {
        ++refusals_;
        const auto access = summary_of(session_, index);
        if (!supported_) {
            codes_.insert(static_cast<std::uint32_t>(abort));
            if (!says_unsupported(abort))
                session_.bench.remark(fmt::format("complete access to 0x{:04x}, which is not supported, ended with {}",
                                                  index, abort_text(abort)));
            return;
        }
        // An object of variable length has an abort code of its own. One with entries that cannot be read now may say
        // so.
        const bool unreadable = access.unreadable && (abort == Abort::write_only || abort == Abort::device_state);
        if (unreadable || (access.varies && abort == Abort::complete_access_unsupported)) return;
        if (from == 0 && (says_unsupported(abort) || says_too_large(abort)))
            refusing_.insert(index);
        else
            fail(fmt::format("complete access to 0x{:04x} from subindex {} on ended with {}, and the SII announces it",
                             index, from, abort_text(abort)));
    }
    // Values may change while they are read: a value that is another one in a second reading is not compared.
    std::optional<std::string> lasting_difference(std::uint16_t index, std::uint8_t from, std::vector<std::byte> data) {
        std::optional<std::string> wrong;
        for (int attempt = 0; attempt < 3; ++attempt) {
            auto values = read_values(session_, index);
            if (!values) return std::nullopt;  // the checks of the information service say why
            wrong = difference(*values, from, data);
            if (!wrong) return std::nullopt;
            auto up = session_.sdo.upload(index, from, true);
            if (!up.ok()) return fmt::format("a value once, and {} the next time", reason_text(up.fault, up.abort));
            const auto again = read_values(session_, index);
            if (again && leave_out_changes(*values, *again) && !difference(*values, from, up.data)) return std::nullopt;
            data = std::move(up.data);
        }
        return wrong;
    }

    Session& session_;
    bool supported_;
    std::size_t findings_ = 0;
    std::size_t refusals_ = 0;
    std::array<std::size_t, 2> answers_{};
    std::set<std::uint32_t> codes_;
    std::set<std::uint16_t> refusing_;
};

void check_complete_objects(Session& session) {
    ObjectComparison comparison(session, announced(session));
    const auto indices = whole_objects(session);
    if (indices.empty()) session.bench.skip("the device has no records and arrays");
    const Time until = session.bench.now() + kLongest;
    std::size_t left = indices.size();
    for (const auto index : indices) {
        if (session.bench.now() >= until) break;
        comparison.compare(index);
        --left;
    }
    comparison.conclude(left);
}

void check_complete_download(Session& session) {
    auto& bench = session.bench;
    if (!announced(session)) bench.skip("the SII does not announce complete access");
    const auto indices = writable_objects(session);
    if (indices.empty()) bench.skip("the dictionary has no writable object that the check may write back");
    for (const auto index : indices) {
        const auto before = session.sdo.upload(index, 0, true);
        if (!before.ok()) continue;  // sdo.complete_objects
        const auto abort = session.sdo.download(index, 0, before.data, true);
        if (abort != Abort::none && !is_pdo_assignment(index) && (says_unsupported(abort) || says_too_large(abort)))
            bench.remark(
                fmt::format("0x{:04x} can be read by complete access; a download of its own value ended with "
                            "{}",
                            index, abort_text(abort)));
        else if (abort != Abort::none)
            bench.fail(
                fmt::format("the SII announces complete access, and a download of its own value to 0x{:04x} ended "
                            "with {}",
                            index, abort_text(abort)));
        const auto after = session.sdo.upload(index, 0, true);
        const auto values = read_values(session, index);
        if (!after.ok() || after.data != before.data || (values && difference(*values, 0, before.data)))
            bench.fail(
                fmt::format("0x{:04x} has another value after a download of its own value by complete access", index));
    }
}

constexpr Check kCompleteAccessChecks[] = {
    {"sdo.complete_download", "complete access writes a whole object", "ETG.1000.6, SDO Download (complete access)",
     check_complete_download},
    {"sdo.complete_access", "complete access returns the subindices one after the other", kComplete,
     check_complete_access},
    {"sdo.complete_objects", "complete access returns the values of the subindices of each object", kComplete,
     check_complete_objects},
};

}  // namespace

std::span<const Check> complete_access_checks() { return kCompleteAccessChecks; }

}  // namespace margay::samples::conformance
