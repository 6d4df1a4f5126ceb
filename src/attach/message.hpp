// The messages between an AttachServer and its clients: a header, then values in a fixed order. Both ends use this
// file; see README.md for the rules.
#pragma once

#include "util/bytes.hpp"

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace margay::attach {

// Raise it with every change of the messages, and of enumerations whose values are in them (Errc, Step, EventKind …).
// These parts never change, so that any two versions can refuse each other with a sentence: Header, `hello` with its
// two numbers, and Status::refused with a string.
inline constexpr std::uint32_t kProtocolVersion = 3;
inline constexpr std::uint32_t kMagic = 0x5947'524D;  // "MRGY"

enum class Operation : std::uint16_t {
    hello,    // the first message of a connection: magic number and version
    master,   // MasterFacts
    slaves,   // a few SlaveFacts from a number on
    group,    // GroupFacts, and a part of the image
    startup,  // the start-up commands of a slave
    events,   // the events after a number
    set_target,
    read_registers,
    write_registers,
    read_sii,
    write_sii,
    sdo_upload,
    sdo_download,
    object_list,
    object_description,
    entry_description,
    foe_read,
    foe_write,
    soe_read,
    soe_write,
    eoe_set_ip,
    eoe_ports,  // the EoE ports of the application, with their counters
    rescan,
    set_debug_level,
    end,  // no operation: the number of operations
};

enum class Status : std::uint16_t {
    done,
    failed,    // an error of the library: Error, and the text of the slave
    refused,   // refused by the server: a sentence
    progress,  // not the end yet: octets done, octets in total (0: not known)
};

struct Header {
    static constexpr std::size_t kBytes = 12;
    std::uint32_t bytes = 0;   // of the payload
    std::uint32_t number = 0;  // chosen by the client; the answer has the number of its request
    std::uint16_t what = 0;    // Operation in a request, Status in an answer
    std::uint16_t reserved = 0;

    [[nodiscard]] static Header load(Bytes from) {
        return {load_le<std::uint32_t>(from, 0), load_le<std::uint32_t>(from, 4), load_le<std::uint16_t>(from, 8),
                load_le<std::uint16_t>(from, 10)};
    }
    void store(MutableBytes to) const {
        store_le(to, 0, bytes);
        store_le(to, 4, number);
        store_le(to, 8, what);
        store_le(to, 10, reserved);
    }
};

template <class T>
concept Scalar = std::is_arithmetic_v<T> || std::is_enum_v<T>;

// Writes values into memory of a fixed size: no allocation, so that poll() can use it.
class Writer {
  public:
    explicit Writer(MutableBytes memory) : memory_(memory) {}
    template <class... T>
    void operator()(const T&... values) {
        (one(values), ...);
    }
    // The number of octets, then the octets.
    void octets(Bytes from) {
        one(static_cast<std::uint32_t>(from.size()));
        if (!from.empty() && room(from.size())) {
            std::memcpy(memory_.data() + used_, from.data(), from.size());
            used_ += from.size();
        }
    }
    [[nodiscard]] Bytes written() const { return memory_.first(used_); }
    // False: the memory was too small, and the content is invalid.
    [[nodiscard]] bool ok() const { return ok_; }

  private:
    bool room(std::size_t bytes) {
        ok_ &= bytes <= memory_.size() - used_;
        return ok_;
    }
    template <class T>
    void one(const T& value) {
        if constexpr (std::is_same_v<T, bool>) {
            one(static_cast<std::uint8_t>(value));
        } else if constexpr (Scalar<T>) {
            if (!room(sizeof(T))) return;
            store_le(memory_, used_, value);
            used_ += sizeof(T);
        } else if constexpr (std::is_same_v<T, std::string>) {
            octets(std::as_bytes(std::span(value)));
        } else if constexpr (std::is_same_v<T, std::vector<std::byte>>) {
            octets(value);
        } else if constexpr (requires { std::tuple_size<T>::value; }) {
            for (const auto& each : value) one(each);
        } else {
            fields(*this, const_cast<T&>(value));
        }
    }

    MutableBytes memory_;
    std::size_t used_ = 0;
    bool ok_ = true;
};

// Reads values. A missing value reads as 0, and then ok() is false.
class Reader {
  public:
    explicit Reader(Bytes from) : from_(from) {}
    template <class... T>
    void operator()(T&... values) {
        (one(values), ...);
    }
    [[nodiscard]] Bytes octets() {
        std::uint32_t bytes = 0;
        one(bytes);
        if (!there(bytes)) return {};
        const auto found = from_.subspan(at_, bytes);
        at_ += bytes;
        return found;
    }
    [[nodiscard]] bool ok() const { return ok_; }
    // All values were present, and there are no other octets.
    [[nodiscard]] bool complete() const { return ok_ && at_ == from_.size(); }
    [[nodiscard]] std::size_t left() const { return from_.size() - at_; }

  private:
    bool there(std::size_t bytes) {
        ok_ &= bytes <= from_.size() - at_;
        return ok_;
    }
    template <class T>
    void one(T& value) {
        if constexpr (std::is_same_v<T, bool>) {
            std::uint8_t octet = 0;
            one(octet);
            value = octet != 0;
        } else if constexpr (Scalar<T>) {
            value = T{};
            if (!there(sizeof(T))) return;
            value = load_le<T>(from_, at_);
            at_ += sizeof(T);
        } else if constexpr (std::is_same_v<T, std::string>) {
            const auto found = octets();
            value.assign(reinterpret_cast<const char*>(found.data()), found.size());
        } else if constexpr (std::is_same_v<T, std::vector<std::byte>>) {
            const auto found = octets();
            value.assign(found.begin(), found.end());
        } else if constexpr (requires { std::tuple_size<T>::value; }) {
            for (auto& each : value) one(each);
        } else {
            fields(*this, value);
        }
    }

    Bytes from_;
    std::size_t at_ = 0;
    bool ok_ = true;
};

}  // namespace margay::attach
