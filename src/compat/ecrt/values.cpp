// Real numbers in process data: little-endian on every host.
#include <margay/coe.hpp>

#include <ecrt.h>

#include <array>
#include <cstring>

using namespace margay;

extern "C" {

float ecrt_read_real(const void* data) {
    std::array<std::byte, 4> octets{};
    std::memcpy(octets.data(), data, octets.size());
    return value_from_octets<float>(octets);
}

double ecrt_read_lreal(const void* data) {
    std::array<std::byte, 8> octets{};
    std::memcpy(octets.data(), data, octets.size());
    return value_from_octets<double>(octets);
}

void ecrt_write_real(void* data, float value) {
    const auto octets = octets_of(value);
    std::memcpy(data, octets.data(), octets.size());
}

void ecrt_write_lreal(void* data, double value) {
    const auto octets = octets_of(value);
    std::memcpy(data, octets.data(), octets.size());
}

}  // extern "C"
