#include "attach/job.hpp"

#include "attach/rescan.hpp"
#include "attach/visit_jobs.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay::attach {
namespace {

constexpr std::size_t kMostObjects = 65536;

// A job that executes a request of the library.
template <class R>
class With : public Job {
  public:
    [[nodiscard]] Request& request() final { return request_; }
    [[nodiscard]] Octets answer() override { return {}; }

  protected:
    With(Arguments arguments) : arguments_(std::move(arguments)) {
        if constexpr (requires { request_.slave; }) request_.slave = arguments_.slave;
        request_.priority = arguments_.urgent ? 3 : 0;
    }
    Arguments arguments_;
    R request_;
};

// Reads into memory of the job. The result `bytes` of the request is the used part of this memory.
template <class R>
class Reading : public With<R> {
  public:
    [[nodiscard]] Octets answer() final {
        if constexpr (requires { this->request_.bytes + std::size_t{0}; })
            memory_.resize(std::min(this->request_.bytes, memory_.size()));
        else if constexpr (requires { this->request_.bytes(); })
            memory_.resize(std::min(this->request_.bytes(), memory_.size()));
        return std::move(memory_);
    }

  protected:
    Reading(Arguments arguments, std::size_t bytes) : With<R>(std::move(arguments)), memory_(bytes) {
        this->request_.data = memory_;
    }
    Octets memory_;
};

template <class R>
class Writing : public With<R> {
  protected:
    Writing(Arguments arguments) : With<R>(std::move(arguments)) { this->request_.data = this->arguments_.data; }
};

struct ReadRegisters final : Reading<RegisterReadRequest> {
    ReadRegisters(Arguments a, std::size_t bytes) : Reading(std::move(a), bytes) {
        request_.address = arguments_.index;
    }
};
struct WriteRegisters final : Writing<RegisterWriteRequest> {
    WriteRegisters(Arguments a) : Writing(std::move(a)) { request_.address = arguments_.index; }
};
struct ReadSii final : Reading<SiiReadRequest> {
    ReadSii(Arguments a, std::size_t bytes) : Reading(std::move(a), bytes) {
        request_.word = arguments_.from;
        request_.beyond_end = true;
    }
};
struct WriteSii final : Writing<SiiWriteRequest> {
    WriteSii(Arguments a) : Writing(std::move(a)) {
        request_.word = arguments_.from;
        request_.beyond_end = true;
    }
};

template <class R>
void set_object(R& request, const Arguments& arguments) {
    request.index = arguments.index;
    request.subindex = arguments.subindex;
    request.complete_access = arguments.complete_access;
}
struct Upload final : Reading<SdoUpload> {
    Upload(Arguments a, std::size_t bytes) : Reading(std::move(a), bytes) { set_object(request_, arguments_); }
};
struct Download final : Writing<SdoDownload> {
    Download(Arguments a) : Writing(std::move(a)) { set_object(request_, arguments_); }
};

class ListObjects final : public With<ObjectListRequest> {
  public:
    ListObjects(Arguments a) : With(std::move(a)) {
        indices_.reserve(kMostObjects);  // poll() adds to it, and must not allocate
        request_.user = &indices_;
        request_.found = [](std::span<const std::uint16_t> some, void* user) {
            auto& all = *static_cast<std::vector<std::uint16_t>*>(user);
            const auto room = std::min(some.size(), all.capacity() - all.size());
            all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(room));
        };
    }
    [[nodiscard]] Octets answer() override {
        Octets out(2 * indices_.size());
        Writer into(out);
        for (const auto index : indices_) into(index);
        return out;
    }

  private:
    std::vector<std::uint16_t> indices_;
};

struct DescribeObject final : With<ObjectDescriptionRequest> {
    DescribeObject(Arguments a) : With(std::move(a)) { request_.index = arguments_.index; }
    [[nodiscard]] Octets answer() override {
        const auto& d = request_.description;
        return octets_of(ObjectFacts{std::string(d.name()), d.object_code, d.max_subindex, d.data_type});
    }
};
struct DescribeEntry final : With<EntryDescriptionRequest> {
    DescribeEntry(Arguments a) : With(std::move(a)) {
        request_.index = arguments_.index;
        request_.subindex = arguments_.subindex;
    }
    [[nodiscard]] Octets answer() override {
        const auto& d = request_.description;
        return octets_of(EntryFacts{d.subindex, d.access, d.data_type, d.bit_length, std::string(d.name())});
    }
};

struct SetTarget final : With<TargetRequest> {
    SetTarget(Arguments a) : With(std::move(a)) { request_.wanted = arguments_.state; }
};

template <class R>
void set_file(R& request, const Arguments& arguments) {
    request.name = arguments.name;
    request.password = arguments.from;
}
struct ReadFile final : Reading<FoeRead> {
    ReadFile(Arguments a, std::size_t bytes) : Reading(std::move(a), bytes) { set_file(request_, arguments_); }
    [[nodiscard]] std::string slave_text() override { return std::string(request_.slave_text()); }
    [[nodiscard]] std::pair<std::size_t, std::size_t> progress() override { return {request_.bytes(), 0}; }
};
struct WriteFile final : Writing<FoeWrite> {
    WriteFile(Arguments a) : Writing(std::move(a)) { set_file(request_, arguments_); }
    [[nodiscard]] std::string slave_text() override { return std::string(request_.slave_text()); }
    [[nodiscard]] std::pair<std::size_t, std::size_t> progress() override {
        return {request_.bytes(), arguments_.data.size()};
    }
};

template <class R>
void set_parameter(R& request, const Arguments& arguments) {
    request.drive = arguments.subindex;
    request.idn = Idn{arguments.index};
    request.elements = arguments.elements;
}
struct ReadParameter final : Reading<SoeRead> {
    ReadParameter(Arguments a, std::size_t bytes) : Reading(std::move(a), bytes) {
        set_parameter(request_, arguments_);
    }
};
struct WriteParameter final : Writing<SoeWrite> {
    WriteParameter(Arguments a) : Writing(std::move(a)) { set_parameter(request_, arguments_); }
};

struct SetIp final : With<EoeSetIp> {
    SetIp(Arguments a, const EoeIp& ip) : With(std::move(a)) { request_.ip = ip; }
};

std::unique_ptr<Job> make_set_ip(Arguments arguments, std::string& refusal) {
    EoeIp ip;
    Reader from(arguments.data);
    from(ip);
    if (from.complete()) return std::make_unique<SetIp>(std::move(arguments), ip);
    refusal = "the IP parameters are not complete";
    return nullptr;
}

std::unique_ptr<Job> make_rescan(AttachScan allowed, std::string& refusal) {
    if (allowed != AttachScan::refused) return std::make_unique<RescanJob>(allowed);
    refusal = "the application does not let other programs scan its segment";
    return nullptr;
}

}  // namespace

bool writes(Operation operation) {
    switch (operation) {
        case Operation::set_target:
        case Operation::write_registers:
        case Operation::write_sii:
        case Operation::sdo_download:
        case Operation::foe_write:
        case Operation::soe_write:
        case Operation::eoe_set_ip:
        case Operation::rescan:
        case Operation::set_debug_level: return true;
        default: return false;
    }
}

std::unique_ptr<Job> make_job(Operation operation, Arguments a, const AttachSettings& settings, std::string& refusal) {
    const std::size_t bytes = a.bytes;
    if (bytes > settings.transfer_bytes) {
        refusal = std::to_string(bytes) + " octets are wanted, and the server transfers at most " +
                  std::to_string(settings.transfer_bytes);
        return nullptr;
    }
    switch (operation) {
        case Operation::master:
        case Operation::slaves:
        case Operation::group:
        case Operation::startup:
        case Operation::eoe_ports: return make_visit(operation, std::move(a));
        case Operation::rescan: return make_rescan(settings.scan, refusal);
        case Operation::set_target: return std::make_unique<SetTarget>(std::move(a));
        case Operation::read_registers: return std::make_unique<ReadRegisters>(std::move(a), bytes);
        case Operation::write_registers: return std::make_unique<WriteRegisters>(std::move(a));
        case Operation::read_sii: return std::make_unique<ReadSii>(std::move(a), bytes);
        case Operation::write_sii: return std::make_unique<WriteSii>(std::move(a));
        case Operation::sdo_upload: return std::make_unique<Upload>(std::move(a), bytes);
        case Operation::sdo_download: return std::make_unique<Download>(std::move(a));
        case Operation::object_list: return std::make_unique<ListObjects>(std::move(a));
        case Operation::object_description: return std::make_unique<DescribeObject>(std::move(a));
        case Operation::entry_description: return std::make_unique<DescribeEntry>(std::move(a));
        case Operation::foe_read: return std::make_unique<ReadFile>(std::move(a), bytes);
        case Operation::foe_write: return std::make_unique<WriteFile>(std::move(a));
        case Operation::soe_read: return std::make_unique<ReadParameter>(std::move(a), bytes);
        case Operation::soe_write: return std::make_unique<WriteParameter>(std::move(a));
        case Operation::eoe_set_ip: return make_set_ip(std::move(a), refusal);
        default: break;
    }
    refusal = "there is no operation " + std::to_string(static_cast<unsigned>(operation));
    return nullptr;
}

}  // namespace margay::attach
