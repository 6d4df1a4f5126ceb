// The object dictionary of the master (ETG.1510), which is read only, and its CoE server, which is the CoE server of
// the slave stack.
#pragma once

#include "gateway/frame.hpp"
#include "gateway/slave_table.hpp"
#include "subdevice/coe_server.hpp"

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <vector>

namespace margay::gateway {

class MasterObjects {
  public:
    MasterObjects(std::string name, const Identity& identity);
    MasterObjects(const MasterObjects&) = delete;
    MasterObjects& operator=(const MasterObjects&) = delete;

    // Describes these slaves from now on.
    void update(const std::vector<SlaveFacts>& slaves);

    struct Answer {
        std::optional<wire::MailboxErrorCode> refusal{};
        std::vector<Octets> mails{};  // data of CoE messages
    };
    // `data` of a CoE message.
    [[nodiscard]] Answer answer(Bytes data);

  private:
    using Entries = std::vector<subdevice::Entry>;
    void build();
    void add_lists(std::uint16_t first, const char* name, const std::vector<const SlaveFacts*>& slaves);
    void add_slaves(std::uint16_t first, const char* name, const std::vector<const SlaveFacts*>& slaves, bool wanted);
    void add_array(std::uint16_t index, std::string name, Entries entries);
    void add_record(std::uint16_t index, std::string name, Entries entries,
                    subdevice::DataType type = subdevice::DataType::none);
    void add_variable(std::uint16_t index, std::string name, const subdevice::Entry& entry);
    [[nodiscard]] const Entries& keep(Entries entries) { return entries_.emplace_back(std::move(entries)); }
    [[nodiscard]] std::string_view keep(std::string name) { return names_.emplace_back(std::move(name)); }

    std::string name_;
    Identity identity_;
    std::vector<SlaveFacts> slaves_{};
    std::deque<Entries> entries_{};
    std::deque<std::string> names_{};
    std::vector<subdevice::Object> objects_{};
    std::array<std::byte, 4096> staging_{};
    std::optional<subdevice::ObjectDictionary> dictionary_{};
    std::optional<subdevice::CoeServer> server_{};
};

}  // namespace margay::gateway
